"""The bridge for real ArduPilots against a strict stand-in, and its frames by themselves."""

import json
import logging
import math
import socket
import struct
import threading
import time
from types import SimpleNamespace

import pytest
from ardupilot_stand_in import ArdupilotStandIn, read
from autopilot_bench import SilenceClock, irises

from volery.bridges.bridge_host import BridgeHost
from volery.core.errors import BridgeError, PartnerError
from volery.graph.rotor_layout import RotorPosition
from volery.mavlink.hil.ardupilot_bridge import ArdupilotBridge
from volery.mavlink.hil.ardupilot_json import (
    STATE_HZ,
    State,
    motors_of,
    parse_servos,
    rotor_fractions,
    state_line,
)
from volery.mavlink.hil.lock_step import TimeoutPolicy
from volery.mavlink.scenario_setup import with_ardupilot
from volery.runtime import Simulation
from volery.scenario.load import parse_scenario

X = (
    RotorPosition(0.1, -0.2, "ccw"),
    RotorPosition(-0.1, 0.2, "ccw"),
    RotorPosition(0.1, 0.2, "cw"),
    RotorPosition(-0.1, -0.2, "cw"),
)
PATIENT = TimeoutPolicy(60.0)
CLIMB = 1780
"""microseconds: 0.78 of full speed; 0.73 carries an iris."""
STILL = State(
    (0.0, 0.0, 9.8), (0.1, 0.2, 0.3), (1.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0), (4.0, 5.0, 6)
)


def scenario(count):
    return with_ardupilot(irises(count))


@pytest.fixture
def opened():
    """A simulation of `count` UAVs and its bridge."""
    closing = []

    def open_one(count=1, timeout_policy=PATIENT):
        simulation = Simulation(scenario(count), threads=1)
        bridges = BridgeHost(simulation.gateway)
        closing.extend([bridges, simulation])
        bridge = ArdupilotBridge(port=0, timeout_policy=timeout_policy)
        bridges.open(bridge)
        simulation.process_commands()
        return simulation, bridge

    yield open_one
    for one in closing:
        one.close()


def meet(simulation, bridge, count):
    """Run until that many have spoken."""
    end = time.monotonic() + 60.0
    while len(bridge.connected) < count and time.monotonic() < end:
        time.sleep(0.01)
        simulation.process_commands()
    assert len(bridge.connected) == count


def finish(*autopilots):
    for autopilot in autopilots:
        assert autopilot.done.wait(60.0)
        if autopilot.fault:
            raise autopilot.fault


@pytest.mark.parametrize("magic", [18458, 29569])
def test_a_vehicle_flies_in_lock_step(opened, magic):
    simulation, bridge = opened()
    autopilot = ArdupilotStandIn(bridge.ports[0], 960, pwm=CLIMB, arm_at=80, magic=magic)
    autopilot.start()
    meet(simulation, bridge, 1)
    simulation.run(1.2)
    finish(autopilot)
    resting, climbing = autopilot.states[40], autopilot.states[-1]
    assert resting["imu", "accel_body"][2] == pytest.approx(-9.81, abs=0.4)
    assert climbing["", "velocity"][2] < -0.3
    assert climbing["", "position"][2] < resting["", "position"][2] - 0.1
    assert simulation.uavs["uav1"].position_map[2] > 0.3


def test_several_have_ports_of_their_own(opened):
    simulation, bridge = opened(count=2)
    autopilots = [ArdupilotStandIn(bridge.ports[k], 160, pwm=1000 + k) for k in range(2)]
    for autopilot in autopilots:
        autopilot.start()
    meet(simulation, bridge, 2)
    simulation.run(0.2)
    finish(*autopilots)
    positions = [autopilot.states[0]["", "position"] for autopilot in autopilots]
    assert positions[1][1] - positions[0][1] == pytest.approx(5.0, abs=0.1)


def test_a_restarted_ardupilot_joins_again(opened):
    simulation, bridge = opened()
    for first in (5, 0):
        autopilot = ArdupilotStandIn(bridge.ports[0], 80, first=first)
        autopilot.start()
        end = time.monotonic() + 60.0
        while bridge._sessions[0]._number != first and time.monotonic() < end:
            time.sleep(0.01)
        simulation.run(0.1)
        finish(autopilot)
        assert autopilot.states[0]["", "timestamp"] == pytest.approx([0.00125])


def test_it_flies_on_after_a_reset(opened):
    simulation, bridge = opened()
    autopilot = ArdupilotStandIn(bridge.ports[0], 160, pwm=CLIMB, may_jump=True)
    autopilot.start()
    meet(simulation, bridge, 1)
    simulation.run(0.1)
    simulation.reset()
    simulation.run(0.1)
    finish(autopilot)
    assert autopilot.jumps == 1


def test_a_silent_ardupilot_ends_the_run_or_is_given_up(opened, monkeypatch, caplog):
    silence = SilenceClock(monkeypatch)
    simulation, bridge = opened(timeout_policy=TimeoutPolicy(0.3))
    silence.autopilot = autopilot = ArdupilotStandIn(bridge.ports[0], 5)
    autopilot.start()
    meet(simulation, bridge, 1)
    with pytest.raises(PartnerError, match=r"'ardupilot_of_uav1' did not answer within 0\.3 s"):
        simulation.run(1.0)
    simulation, bridge = opened(timeout_policy=TimeoutPolicy(0.3, drops=True))
    silence.autopilot = autopilot = ArdupilotStandIn(bridge.ports[0], 5, pwm=CLIMB)
    autopilot.start()
    meet(simulation, bridge, 1)
    with caplog.at_level(logging.WARNING, logger="volery.mavlink"):
        simulation.run(0.5)
    assert (
        "uav1: its autopilot has been silent for 0.3 s; the simulation goes on without it"
        in caplog.messages
    )
    assert bridge.connected == ()


def test_lost_messages_are_sent_again(opened):
    simulation, bridge = opened()
    autopilot = ArdupilotStandIn(bridge.ports[0], 1)
    autopilot.link.settimeout(60.0)
    autopilot.send(0)
    meet(simulation, bridge, 1)
    run = threading.Thread(target=simulation.run, args=(0.0022,))
    run.start()
    first = autopilot.link.recv(65000)
    autopilot.send(0)  # as one that has not received it
    assert autopilot.link.recv(65000) == first
    autopilot.send(1)
    run.join(60.0)
    assert not run.is_alive()
    autopilot.link.close()


def test_noise_and_a_second_one_are_reported_and_ignored(opened, monkeypatch, caplog):
    now = SimpleNamespace(monotonic=lambda: 100.0)  # else a slow stand-in counts as gone
    monkeypatch.setattr("volery.mavlink.hil.ardupilot_bridge.time", now)
    simulation, bridge = opened()
    autopilot = ArdupilotStandIn(bridge.ports[0], 160, pwm=CLIMB)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        for data in (
            b"",
            b"\x1a",
            b"\x1a\x48" * 21,
            struct.pack("<HHI16H", 18459, 1, 0, *[0] * 16),
        ):
            other.sendto(data, ("127.0.0.1", bridge.ports[0]))
        autopilot.start()
        meet(simulation, bridge, 1)
        for number in (10_000, 0):  # one that flies elsewhere, and one that was just started
            frame = struct.pack("<HHI16H", 18458, 400, number, *[1000] * 16)
            other.sendto(frame, ("127.0.0.1", bridge.ports[0]))
        simulation.run(0.2)
    finish(autopilot)
    assert caplog.messages == [
        "uav1: a sender to its port is not an ArduPilot",
        "uav1: its ArduPilot is connected already; another one is ignored",
    ]


def test_a_late_frame_restarts_nothing(opened):
    simulation, bridge = opened()
    autopilot = ArdupilotStandIn(bridge.ports[0], 1)
    autopilot.link.settimeout(60.0)
    autopilot.send(1000)
    meet(simulation, bridge, 1)
    run = threading.Thread(target=simulation.run, args=(0.0047,))
    run.start()
    times = []
    for number in (1001, 1002, 1003):
        times += read(autopilot.link.recv(65000).decode(), "", "timestamp", 1)
        for late in (990, 999):
            autopilot.send(late)
        autopilot.send(number)
    run.join(60.0)
    assert not run.is_alive()
    assert times == pytest.approx([0.00125, 0.0025, 0.00375])
    autopilot.link.close()


def test_frames_that_are_none():
    good = struct.pack("<HHI16H", 18458, 400, 7, *range(1000, 1016))
    assert parse_servos(good) == (400, 7, tuple(range(1000, 1016)))
    for bad in (b"", b"\x1a", good[:-1], good + b"\0", b"\0" + good[1:]):
        assert parse_servos(bad) is None


def test_the_line_is_as_its_reader_wants_it():
    line = state_line(0.0, STILL._replace(range_m=2.0, battery=(12.0, 3.0)))
    assert line == (
        b'\n{"timestamp":0.0,"imu":{"gyro":[0.1,-0.2,-0.3],"accel_body":[0.0,-0.0,-9.8]},'
        b'"position":[2.0,1.0,-3.0],"quaternion":[0.7071067811865476,0.0,0.0,0.7071067811865476],'
        b'"velocity":[5.0,4.0,-6],"rng_1":2.0,"battery":{"voltage":12.0,"current":3.0}}\n'
    )


def test_its_clock_of_whole_microseconds_does_not_drift():
    """As SIM_JSON reads it: what is added to a count of microseconds is cut to a whole one."""
    clock_us, last_s = 0, 0.0
    for k in range(1, 100_001):
        time_s = json.loads(state_line(k / STATE_HZ, STILL))["timestamp"]
        clock_us, last_s = int(clock_us + (time_s - last_s) * 1e6), time_s
    assert clock_us == 125_000_000


@pytest.mark.parametrize(("given", "flown"), [(None, 800), (1000, 800), (1600, 1600)])
def test_physics_steps_fit_between_two_states(given, flown):
    data = irises(1).model_dump(exclude_unset=True)
    if given is not None:
        data["physics"] = {"rate_hz": given, "on_contact": "bounce"}
    fitted = with_ardupilot(parse_scenario(data, where="flat"))
    assert fitted.physics.rate_hz == flown
    assert fitted.physics.on_contact == ("crash" if given is None else "bounce")


def test_motors_follow_the_arms():
    assert motors_of(X) == (0, 1, 2, 3)
    assert motors_of(tuple(reversed(X))) == (3, 2, 1, 0)
    plus = [
        RotorPosition(0.2, 0.0, "cw"),
        RotorPosition(0.0, 0.2, "ccw"),
        RotorPosition(-0.2, 0.0, "cw"),
        RotorPosition(0, -1, "ccw"),
    ]
    assert motors_of(plus) == (2, 1, 3, 0)
    assert rotor_fractions([1000, 1500, 2100, 900], (1, 0, 3, 2)) == [0.5, 0.0, 0.0, 1.0]


def test_arms_that_arducopter_does_not_fly():
    with pytest.raises(BridgeError, match="turn opposite"):
        motors_of(
            [rotor._replace(direction={"cw": "ccw", "ccw": "cw"}[rotor.direction]) for rotor in X]
        )
    six = [
        RotorPosition(math.cos(k * math.pi / 3), math.sin(k * math.pi / 3), "cw") for k in range(6)
    ]
    with pytest.raises(BridgeError, match="quadrotors"):
        motors_of(six)


def test_a_port_that_is_taken_is_reported():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        simulation = Simulation(scenario(1), threads=1)
        with simulation, BridgeHost(simulation.gateway) as bridges:
            with pytest.raises(BridgeError) as error:
                bridges.open(ArdupilotBridge(port=port))
            assert str(error.value) == (
                f"uav1: cannot listen on UDP 127.0.0.1:{port}: the port is taken"
            )
