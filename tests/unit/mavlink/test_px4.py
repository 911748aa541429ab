"""The server for real PX4s against a strict stand-in, and its frames against the physics."""

import asyncio
import contextlib
import logging
import socket
import threading
import time

import pytest
from autopilot_bench import SilenceClock, irises
from px4_stand_in import StandIn, Terminal

from volery.bridges.bridge_host import BridgeHost
from volery.core.errors import BridgeError, PartnerError
from volery.mavlink.codec import Codec, dialect
from volery.mavlink.hil.lock_step import TimeoutPolicy
from volery.mavlink.hil.protocol import HilLink
from volery.mavlink.hil.px4_bridge import Px4Bridge, _Connection
from volery.mavlink.hil.px4_serial_bridge import Px4SerialBridge
from volery.mavlink.hil.session import HilSession
from volery.mavlink.scenario_setup import with_px4
from volery.runtime import Simulation
from volery.scenario.load import parse_scenario

PATIENT = TimeoutPolicy(60.0)
CLIMB = 0.78
"""Fraction of full speed; 0.73 carries an iris: the root of its fraction of thrust."""


def scenario(count=1):
    return with_px4(irises(count))


@pytest.fixture
def opened():
    """A simulation of `count` UAVs, its bridge and the first port."""
    closing = []

    def open_one(count=1, timeout_policy=PATIENT):
        simulation = Simulation(scenario(count), threads=1)
        bridges = BridgeHost(simulation.gateway)
        closing.extend([bridges, simulation])
        bridge = Px4Bridge(port=0, timeout_policy=timeout_policy)
        bridges.open(bridge)
        simulation.process_commands()
        return simulation, bridge

    yield open_one
    for one in closing:
        one.close()


@pytest.fixture
def silence(monkeypatch):
    return SilenceClock(monkeypatch)


def meet(simulation, bridge, count):
    """Run until all PX4s of the stand-ins are connected."""
    end = time.monotonic() + 60.0
    while len(bridge.connected) < count and time.monotonic() < end:
        time.sleep(0.01)
        simulation.process_commands()
    assert len(bridge.connected) == count


def start(simulation, sessions, *autopilots):
    """Run until all stand-ins have answered, before which the simulation waits for none."""
    for autopilot in autopilots:
        autopilot.start()
    for _ in range(60):
        simulation.run(0.004)
        soon = time.monotonic() + 1.0
        while time.monotonic() < soon:
            if all(session._link.locked for session in sessions):
                return
            time.sleep(0.001)
    raise AssertionError("no answer came")


def test_a_vehicle_flies_in_lock_step(opened):
    simulation, bridge = opened()
    autopilot = StandIn(bridge.ports[0], 400, throttle=CLIMB, arm_at=100)
    meet(simulation, bridge, 1)
    start(simulation, bridge._sessions, autopilot)
    simulation.run(2.0)
    assert autopilot.done.wait(60.0)
    if autopilot.fault:
        raise autopilot.fault
    assert len(autopilot.sensors) == 400
    assert autopilot.groups & 0x1FFF == 0x1BFF  # all groups but the differential pressure
    assert len(autopilot.fixes) >= 3
    at_rest, climbing = autopilot.sensors[50], autopilot.sensors[390]
    assert at_rest.zacc == pytest.approx(-9.81, abs=0.4)
    assert climbing.zacc < -10.0
    assert simulation.uavs["uav1"].position_map[2] > 0.3


def is_ended(connection):
    connection.settimeout(60.0)
    with contextlib.suppress(ConnectionResetError):
        while connection.recv(4096):
            pass
    return True


def test_a_client_without_mavlink_is_replaced_and_one_after_a_px4_is_closed(opened, caplog):
    simulation, bridge = opened()
    address = ("127.0.0.1", bridge.ports[0])
    with socket.create_connection(address) as client:
        meet(simulation, bridge, 1)
        client.sendall(b"hello, is this the way to the aviary?" * 5)
        end = time.monotonic() + 60.0
        while "does not send MAVLink" not in caplog.text and time.monotonic() < end:
            time.sleep(0.01)
        with socket.create_connection(address) as px4:
            assert is_ended(client)
            px4.sendall(HilLink(1).heartbeat())
            while not bridge._sessions[0].has_received and time.monotonic() < end:
                time.sleep(0.01)
            with socket.create_connection(address) as second:
                assert is_ended(second)
            assert bridge.connected == ("uav1",)
    texts = [text for text in caplog.messages if "does not send MAVLink" in text]
    assert texts == ["uav1: the connected client does not send MAVLink; connect a PX4"]
    assert "uav1: its PX4 is connected already; another connection is closed" in caplog.messages


def test_several_vehicles_share_one_clock(opened):
    simulation, bridge = opened(count=2)
    autopilots = [StandIn(bridge.ports[k], 150) for k in range(2)]
    meet(simulation, bridge, 2)
    start(simulation, bridge._sessions, *autopilots)
    simulation.run(1.0)
    for autopilot in autopilots:
        assert autopilot.done.wait(60.0)
        assert autopilot.fault is None
    assert len(set(bridge.ports)) == 2
    assert bridge.address(1) == f"127.0.0.1:{bridge.ports[1]}"
    first, second = ([s.time_usec for s in autopilot.sensors[2:]] for autopilot in autopilots)
    assert set(first) & set(second)


def test_a_silent_one_ends_the_run_with_an_error(opened, silence):
    simulation, bridge = opened(timeout_policy=TimeoutPolicy(0.5))
    silence.autopilot = autopilot = StandIn(bridge.ports[0], 50, falls_silent=True)
    meet(simulation, bridge, 1)
    start(simulation, bridge._sessions, autopilot)
    with pytest.raises(PartnerError) as error:
        simulation.run(1.0)
    reported_s = round(autopilot.sensors[-1].time_usec / 1e6 + 0.004, 3)
    assert str(error.value) == (
        f"partner 'px4_of_uav1' did not answer within 0.5 s of wall time at {reported_s:.3f} s"
    )
    autopilot.close()


def test_a_silent_one_is_given_up_where_that_is_wanted_and_may_come_back(opened, silence, caplog):
    simulation, bridge = opened(timeout_policy=TimeoutPolicy(0.5, drops=True))
    autopilot = StandIn(bridge.ports[0], 50, throttle=CLIMB, falls_silent=True)
    silence.autopilot = autopilot
    meet(simulation, bridge, 1)
    start(simulation, bridge._sessions, autopilot)
    begun_s = simulation.time_s
    with caplog.at_level(logging.WARNING, logger="volery.mavlink"):
        simulation.run(1.0)
    assert simulation.time_s == pytest.approx(begun_s + 1.0)
    assert len(autopilot.sensors) == 50
    text = "uav1: its autopilot has been silent for 0.5 s; the simulation goes on without it"
    assert text in caplog.messages
    silence.autopilot = again = StandIn(bridge.ports[0], 50)
    meet(simulation, bridge, 1)
    start(simulation, bridge._sessions, again)
    simulation.run(0.5)
    assert again.done.wait(60.0)
    assert again.fault is None
    autopilot.close()


def test_time_goes_on_without_one_that_is_disarmed_and_says_nothing(opened, caplog):
    """As PX4 in Offboard without setpoints: it responds again when time has gone on."""
    simulation, bridge = opened()
    autopilot = StandIn(bridge.ports[0], 50, arm_at=1000, dozes=100)
    meet(simulation, bridge, 1)
    start(simulation, bridge._sessions, autopilot)
    simulation.run(1.0)
    assert autopilot.done.wait(60.0)
    if autopilot.fault:
        raise autopilot.fault
    assert len(autopilot.sensors) == 200
    texts = {text for text in caplog.messages if "silent" in text}
    assert texts == {
        "uav1: its autopilot is disarmed and silent; the simulation goes on without it"
    }


def test_one_that_is_disarmed_and_never_answers_again_ends_the_run(opened, silence):
    timeout_s = 1.0  # longer than a busy machine starves the bridge's thread
    simulation, bridge = opened(timeout_policy=TimeoutPolicy(timeout_s))
    silence.autopilot = autopilot = StandIn(bridge.ports[0], 50, arm_at=1000, falls_silent=True)
    meet(simulation, bridge, 1)
    start(simulation, bridge._sessions, autopilot)
    with (
        contextlib.closing(autopilot),
        pytest.raises(PartnerError, match=r"did not answer within 1\.0 s"),
    ):
        simulation.run(60.0)
    assert len(autopilot.sensors) == 50
    silent_s = simulation.time_s - autopilot.sensors[-1].time_usec / 1e6
    assert silence.now_s >= 6 * timeout_s
    assert 0.04 < silent_s <= silence.now_s  # it goes on, no faster than real time


def test_a_reset_sends_them_away_and_a_restarted_one_flies(opened, caplog):
    simulation, bridge = opened()
    before = StandIn(bridge.ports[0], 10_000, throttle=CLIMB)
    meet(simulation, bridge, 1)
    start(simulation, bridge._sessions, before)
    simulation.run(0.5)
    simulation.reset()
    with caplog.at_level(logging.WARNING, logger="volery.mavlink"):
        simulation.run(0.1)
    assert before.done.wait(60.0)
    assert "the simulator closed the connection" in str(before.fault)
    assert any("the simulation was reset" in message for message in caplog.messages)
    assert bridge.connected == ()
    again = StandIn(bridge.ports[0], 100, throttle=CLIMB)
    meet(simulation, bridge, 1)
    start(simulation, bridge._sessions, again)
    simulation.run(0.6)
    assert again.done.wait(60.0)
    assert again.fault is None
    assert again.sensors[0].time_usec < 200_000


def test_one_with_a_clock_of_its_own_is_not_waited_for(opened):
    simulation, bridge = opened()
    autopilot = StandIn(bridge.ports[0], 20, falls_silent=True, in_lock_step=False)
    meet(simulation, bridge, 1)
    autopilot.start()
    simulation.run(1.0)
    assert autopilot.done.wait(60.0)
    assert autopilot.fault is None
    autopilot.close()


def test_one_on_a_serial_line_flies_the_uav_that_is_left():
    terminals = [Terminal(), Terminal()]
    simulation = Simulation(scenario(count=2), threads=1)
    with simulation, BridgeHost(simulation.gateway) as bridges:
        lines = [Px4SerialBridge(terminal.path) for terminal in terminals]
        autopilots = []
        for terminal, line in zip(terminals, lines, strict=True):
            bridges.open(line)
            simulation.process_commands()
            autopilots.append(StandIn(0, 10_000, throttle=CLIMB, arm_at=50, link=terminal))
        assert [line.uav for line in lines] == ["uav1", "uav2"]
        with pytest.raises(BridgeError, match="no UAV with an IMU is left"):
            bridges.open(Px4SerialBridge(terminals[0].path))
        start(simulation, [line._session for line in lines], *autopilots)
        simulation.run(1.0)
        assert simulation.uavs["uav1"].position_map[2] > 0.2
        assert simulation.uavs["uav2"].position_map[2] > 0.2
    for autopilot in autopilots:
        autopilot.close()
        assert autopilot.done.wait(60.0)
        assert len(autopilot.sensors) > 200
        assert str(autopilot.fault) == "the simulator closed the connection"


def test_a_serial_line_that_is_too_slow_is_reported():
    simulation = Simulation(scenario(), threads=1)
    with simulation, BridgeHost(simulation.gateway) as bridges:
        with pytest.raises(BridgeError, match="57600 baud is too slow for HIL; use 230400 or more"):
            bridges.open(Px4SerialBridge("/dev/null", 57600))
        with pytest.raises(BridgeError, match="/dev/null is not a serial line"):
            bridges.open(Px4SerialBridge("/dev/null"))


def test_a_port_that_is_taken_is_reported():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        simulation = Simulation(scenario(), threads=1)
        with simulation, BridgeHost(simulation.gateway) as bridges:
            with pytest.raises(BridgeError) as error:
                bridges.open(Px4Bridge(port=port))
            assert str(error.value) == (
                f"uav1: cannot listen on 127.0.0.1:{port}: the port is taken"
            )


def test_a_default_imu_is_a_calibrated_one():
    chosen = {"kind": "imu", "model": "adis16448"}
    data = {
        "name": "three_types",
        "types": {
            "plain": {"airframe": "iris", "sensors": [{"kind": "imu"}]},
            "own": {"airframe": "iris", "sensors": [chosen]},
            "bare": {"airframe": "iris"},
        },
        "uavs": [{"type": name, "position_m": [3.0 * k, 0.0]} for k, name in enumerate(
            ("plain", "own", "bare"))],
    }  # fmt: skip
    types = with_px4(parse_scenario(data, where="test")).types
    imus = {name: [s for s in t.sensors if s.kind == "imu"] for name, t in types.items()}
    assert {name: [(s.model, s.rate_hz) for s in found] for name, found in imus.items()} == {
        "plain": [("iim42653", 250.0)],
        "own": [("adis16448", 250.0)],
        "bare": [("iim42653", 250.0)],
    }


def test_in_step_the_simulation_sends_and_wakes_no_thread(opened, monkeypatch):
    simulation, bridge = opened()
    senders = []
    send = HilSession.send_sensors

    def record(session, time_ns, news):
        if session.is_connected:
            senders.append((threading.get_ident(), session._link.locked))
        return send(session, time_ns, news)

    monkeypatch.setattr(HilSession, "send_sensors", record)
    autopilot = StandIn(bridge.ports[0], 50)
    meet(simulation, bridge, 1)
    start(simulation, bridge._sessions, autopilot)
    simulation.run(1.0)
    assert autopilot.done.wait(60.0)
    assert autopilot.fault is None
    in_step = [thread for thread, locked in senders if locked]
    assert len(in_step) > 30
    assert set(in_step[2:]) == {threading.get_ident()}  # the first was on its way to the loop
    assert threading.get_ident() not in {thread for thread, locked in senders if not locked}


def test_values_that_cannot_be_sent_are_reported_and_the_run_goes_on(opened, monkeypatch, caplog):
    simulation, bridge = opened()

    def refuse(_link, _time_ns, _sensed):
        raise OverflowError("infinity is no integer")

    autopilot = StandIn(bridge.ports[0], 50)
    meet(simulation, bridge, 1)
    monkeypatch.setattr(HilLink, "encode_exchange", refuse)
    simulation.run(0.1)
    assert simulation.time_s == pytest.approx(0.1)
    autopilot.close()
    texts = [text for text in caplog.messages if "cannot send sensor values" in text]
    assert texts == ["uav1: cannot send sensor values to its autopilot: infinity is no integer"]


def test_a_released_client_is_not_obeyed(opened):
    simulation, bridge = opened()
    autopilot = StandIn(bridge.ports[0], 50)
    meet(simulation, bridge, 1)
    (session,) = bridge._sessions
    asked = []
    session._lock_step.turn_rotors = session._lock_step.go_on = lambda shares=None: asked.append(
        shares
    )
    late = _NullConnection()
    receive = session.take(late)
    response = Codec(1, 1).pack(
        dialect().MAVLink_hil_actuator_controls_message(10**9, [0.7] * 16, 129, 1), 0
    )
    receive(response)
    assert [len(shares) for shares in asked] == [16]
    session.leave("it went")
    asked.clear()
    receive(response)
    assert asked == []
    autopilot.close()


class _NullConnection:
    """Carries nothing."""

    is_for_any_thread = True

    def send(self, _data):
        return True

    def end(self):
        """Nothing is there to be ended."""


def test_a_px4_that_does_not_read_for_long_receives_whole_frames_again():
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    frame = bytes(range(64))

    async def made():
        return _Connection(None, None)

    connection = asyncio.run(made())
    connection._out = ours
    sent = 0
    while connection.send(frame):
        sent += 1
    assert not connection.send(frame)
    for _ in range(3000):  # more than may wait: lost, whole
        connection.send(frame)
    received = _drained(theirs)
    assert connection.send(frame)
    received += _drained(theirs)
    assert len(received) % 64 == 0
    assert received == frame * (len(received) // 64)
    assert sent < len(received) // 64 < sent + 3000
    ours.close()
    theirs.close()


def _drained(line):
    line.setblocking(False)
    received = b""
    with contextlib.suppress(BlockingIOError):
        while True:
            received += line.recv(1 << 16)
    return received
