"""Measures ten autopilots: CPU load, response time of commands, latency of setpoints."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from volery.core.errors import VoleryError

if TYPE_CHECKING:
    from volery.runtime import Simulation

_VEHICLES = 10
_STEADY_S = 10.0
_LIFT_S = 6.0
_COMMANDS = 400
_PORT = 34540
"""UDP port away from the usual ones of a user's run."""
_PHYSICS_HZ = 250


def measure() -> dict[str, float]:
    """Returns the core share, wall time of responses, simulated time from setpoints to rotors."""
    with_streams, ack_ms = _fly_ten(streams=True)
    without, _ = _fly_ten(streams=False)
    return {
        "ten_vehicles_core_share": with_streams - without,
        "ack_p95_ms": float(np.percentile(ack_ms, 95)),
        "ack_median_ms": float(np.median(ack_ms)),
        "setpoint_to_motor_ms": _setpoint_to_motor_ms(),
    }


def _scenario(count: int, physics_hz: int = 1000) -> Any:
    from volery.mavlink.scenario_setup import with_autopilots
    from volery.scenario.load import parse_scenario

    data = {
        "name": "bench_mavlink",
        "duration_s": 1e5,
        "physics": {"rate_hz": physics_hz},
        "types": {"iris": {"airframe": "iris"}},
        "uavs": [
            {
                "type": "iris",
                "count": count,
                "position_m": [0.0, 0.0],
                "last_position_m": [5.0 * count, 0.0],
                "on_start": "take_off",
            }
        ],
    }
    scenario = parse_scenario(data, where="bench")
    return scenario, with_autopilots(scenario)


def _fly_ten(*, streams: bool) -> tuple[float, list[float]]:
    """Returns CPU seconds per second in real time, and ms from commands to their responses."""
    from volery.bridges.bridge_host import BridgeHost
    from volery.mavlink.links.udp_bridge import MavlinkUdp
    from volery.runtime import Simulation

    plain, outfitted = _scenario(_VEHICLES)
    simulation = Simulation(outfitted if streams else plain)
    with simulation, BridgeHost(simulation.gateway) as bridges:
        if streams:
            bridges.open(MavlinkUdp(port=_PORT))
        simulation.run(_LIFT_S, speed=1.0)
        before = time.process_time()
        simulation.run(_STEADY_S, speed=1.0)
        core_fraction = (time.process_time() - before) / _STEADY_S
        return core_fraction, _ask(simulation) if streams else []


def _ask(simulation: Simulation) -> list[float]:
    """Sends requests to a vehicle of a running simulation from another process."""
    simulation.gateway.use_low_latency()
    thread = threading.Thread(target=lambda: simulation.run(600.0, speed=1.0))
    thread.start()
    command = [
        sys.executable,
        "-P",
        "-m",
        "volery_benchmarks.mavlink_client",
        str(_PORT),
        str(_COMMANDS),
    ]
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, timeout=120)
    finally:
        simulation.clock.quit()
        thread.join()
    if done.returncode:
        raise VoleryError("the client of the bench mavlink failed")
    answers: list[float] = json.loads(done.stdout)
    return answers


def _setpoint_to_motor_ms() -> float:
    """Returns the max over several phases between the guidance steps, at 250 Hz of physics."""
    from volery.graph.messages import message_type
    from volery.mavlink.codec import Codec, dialect
    from volery.mavlink.node import PACKETS
    from volery.runtime import Simulation

    simulation = Simulation(_scenario(1, _PHYSICS_HZ)[1])
    codec = Codec(255, 190)
    setpoint = dialect().MAVLink_set_position_target_local_ned_message
    long = dialect().MAVLink_command_long_message
    with simulation:
        frames = simulation.graph.advertise("/uav1/mavlink/in", PACKETS)

        def send(message: Any) -> None:
            data = np.frombuffer(codec.pack(message, 0), np.uint8)
            frames.publish(message_type(PACKETS)(link=1, profile=0, closed=False, data=data))
            simulation.process_commands()
            simulation.graph.deliver()

        def steer(north: float) -> None:
            send(setpoint(0, 1, 1, 1, 2503, 0, 0, 0, north, 0, 0, 0, 0, 0, 0, 0))

        simulation.run(_LIFT_S)
        steer(0.0)
        send(long(1, 1, 176, 0, 1.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        longest = 0
        for phase in range(8):
            for _ in range(50):
                steer(0.0)
                simulation.run(0.05)
            simulation.step(phase)
            steady = simulation.uavs["uav1"].rotor_reference
            steer(3.0)
            steps = 0
            while np.abs(simulation.uavs["uav1"].rotor_reference - steady).max() < 5.0:
                simulation.step()
                steps += 1
            longest = max(longest, steps)
    return 1e3 * longest / _PHYSICS_HZ
