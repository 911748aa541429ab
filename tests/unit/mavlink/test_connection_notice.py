"""What is said of autopilots that nobody has started."""

import socket
import time

import pytest
from autopilot_bench import free_port, irises
from px4_stand_in import Terminal, connect

from volery.bridges.bridge_host import BridgeHost
from volery.mavlink.hil.ardupilot_bridge import ArdupilotBridge
from volery.mavlink.hil.connection_notice import notice
from volery.mavlink.hil.px4_bridge import Px4Bridge, how_to_start
from volery.mavlink.hil.px4_serial_bridge import Px4SerialBridge
from volery.mavlink.scenario_setup import with_ardupilot, with_px4
from volery.runtime import Simulation

SOON_S = 0.3


@pytest.fixture
def opened():
    """A simulation with a bridge open."""
    closing = []

    def open_one(scenario, bridge):
        simulation = Simulation(scenario, threads=1)
        bridges = BridgeHost(simulation.gateway)
        closing.extend([bridges, simulation])
        bridges.open(bridge)
        return simulation

    yield open_one
    for one in closing:
        one.close()


def heard(caplog, simulation, seconds=3.0 * SOON_S):
    """Warnings of a run in real time."""
    simulation.run(seconds, speed=1.0)
    return [text for text in caplog.messages if "yet for" in text]


def test_missing_px4s_are_told_of_once_while_time_goes_on(opened, caplog):
    port = free_port()
    simulation = opened(with_px4(irises(2)), Px4Bridge(port=port, notice_s=SOON_S))
    assert heard(caplog, simulation) == [
        f"no PX4 yet for uav1 (127.0.0.1:{port}), uav2 (127.0.0.1:{port + 1}): they stay on the "
        "ground until one connects; PX4's instances connect to ports 4560 and following"
    ]
    assert simulation.time_s == pytest.approx(3.0 * SOON_S)


def test_only_those_are_told_of_that_are_missing(opened, caplog):
    bridge = Px4Bridge(port=free_port(), notice_s=4.0 * SOON_S)
    simulation = opened(with_px4(irises(2)), bridge)
    with connect(bridge._port):
        end = time.monotonic() + 60.0
        while not bridge.connected and time.monotonic() < end:
            time.sleep(0.01)
        (told,) = heard(caplog, simulation, 6.0 * SOON_S)
    assert f"uav2 (127.0.0.1:{bridge._port + 1}): it stays on the ground" in told
    assert "uav1" not in told


@pytest.mark.parametrize(("port", "more"), [(4560, ""), (4570, " --first 10")])
def test_the_hint_names_instances_that_connect_there(port, more):
    told = how_to_start(3, port)
    assert told == f"start with: volery px4 --px4-dir PX4-Autopilot --count 3{more}"


def test_nothing_is_said_by_a_bridge_that_closes_before_or_is_not_to(opened, caplog):
    for bridge in (
        Px4Bridge(port=free_port(), notice_s=None),
        Px4Bridge(port=free_port(), notice_s=9.9),
    ):
        assert heard(caplog, opened(with_px4(irises()), bridge), 0.1) == []


def test_missing_ardupilots_are_told_of(opened, caplog):
    port = free_port(socket.SOCK_DGRAM)
    simulation = opened(with_ardupilot(irises()), ArdupilotBridge(port=port, notice_s=SOON_S))
    (told,) = heard(caplog, simulation)
    assert told.startswith(
        f"no ArduPilot yet for uav1 (UDP 127.0.0.1:{port}): it stays on the ground"
    )
    assert "start with: arducopter --model JSON" in told


def test_a_silent_serial_line_is_told_of(opened, caplog):
    terminal = Terminal()
    simulation = opened(with_px4(irises()), Px4SerialBridge(terminal.path, notice_s=SOON_S))
    (told,) = heard(caplog, simulation)
    assert told.startswith(f"no PX4 yet for uav1 ({terminal.path} at 921600 baud): it stays")
    assert "SYS_HITL = 1" in told


def test_of_many_three_are_named():
    places = {f"uav{k}": f"127.0.0.1:{4559 + k}" for k in range(1, 51)}
    told = notice("PX4", places, "start them")
    assert told.startswith("no PX4 yet for uav1 (127.0.0.1:4560), uav2 ")
    assert "uav3 (127.0.0.1:4562) and 47 more: they stay on the ground" in told
