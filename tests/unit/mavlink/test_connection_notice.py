"""Warnings about autopilots that are not running."""

import time

import pytest
from autopilot_bench import irises
from px4_stand_in import Terminal, connect

from volery.bridges.bridge_host import BridgeHost
from volery.mavlink.hil.ardupilot_bridge import ArdupilotBridge
from volery.mavlink.hil.connection_notice import notice
from volery.mavlink.hil.px4_bridge import Px4Bridge, how_to_start
from volery.mavlink.hil.px4_serial_bridge import Px4SerialBridge
from volery.mavlink.scenario_setup import with_ardupilot, with_px4
from volery.runtime import Simulation

SOON_S = 0.1
NEVER_S = 600.0


@pytest.fixture
def opened():
    """A simulation with a bridge open."""
    closing = []

    def open_one(scenario, bridge):
        simulation = Simulation(scenario, threads=1)
        bridges = BridgeHost(simulation.gateway)
        closing.extend([bridges, simulation])
        bridges.open(bridge)
        return simulation, bridges

    yield open_one
    for one in closing:
        one.close()


def notices(caplog):
    return [text for text in caplog.messages if "yet for" in text]


def notices_of_run(caplog, simulation):
    """Notices of a run in real time, up to the first one and for three times as long as it took."""
    end = time.monotonic() + 60.0
    while not notices(caplog) and time.monotonic() < end:
        simulation.run(0.02, speed=1.0)
    simulation.run(3.0 * SOON_S, speed=1.0)
    return notices(caplog)


def test_missing_px4s_are_reported_once_while_time_goes_on(opened, caplog):
    bridge = Px4Bridge(port=0, notice_s=SOON_S)
    simulation, _ = opened(with_px4(irises(2)), bridge)
    first, second = bridge.ports
    assert notices_of_run(caplog, simulation) == [
        f"no PX4 yet for uav1 (127.0.0.1:{first}), uav2 (127.0.0.1:{second}): they stay on the "
        "ground until one connects; PX4's instances connect to ports 4560 and following"
    ]
    assert simulation.time_s >= 3.0 * SOON_S


def test_only_missing_px4s_are_reported(opened, caplog):
    bridge = Px4Bridge(port=0, notice_s=NEVER_S)
    opened(with_px4(irises(2)), bridge)
    with connect(bridge.ports[0]):
        end = time.monotonic() + 60.0
        while not bridge.connected and time.monotonic() < end:
            time.sleep(0.01)
        bridge._absence._look()
        (warning,) = notices(caplog)
    assert f"uav2 (127.0.0.1:{bridge.ports[1]}): it stays on the ground" in warning
    assert "uav1" not in warning


@pytest.mark.parametrize(("port", "more"), [(4560, ""), (4570, " --first 10")])
def test_the_hint_names_instances_that_connect_there(port, more):
    warning = how_to_start(3, port)
    assert warning == f"start with: volery px4 --px4-dir PX4-Autopilot --count 3{more}"


def test_nothing_is_said_by_a_bridge_that_closes_before_or_is_not_to(opened, caplog):
    quiet, closed = Px4Bridge(port=0, notice_s=None), Px4Bridge(port=0, notice_s=NEVER_S)
    opened(with_px4(irises()), quiet)
    assert quiet._absence is None
    _, bridges = opened(with_px4(irises()), closed)
    timer = closed._absence._timer
    assert not timer.cancelled()
    bridges.close()
    assert timer.cancelled()
    assert notices(caplog) == []


def test_missing_ardupilots_are_reported(opened, caplog):
    bridge = ArdupilotBridge(port=0, notice_s=SOON_S)
    simulation, _ = opened(with_ardupilot(irises()), bridge)
    (warning,) = notices_of_run(caplog, simulation)
    assert warning.startswith(
        f"no ArduPilot yet for uav1 (UDP 127.0.0.1:{bridge.ports[0]}): it stays on the ground"
    )
    assert "start with: arducopter --model JSON" in warning


def test_a_silent_serial_line_is_reported(opened, caplog):
    terminal = Terminal()
    bridge = Px4SerialBridge(terminal.path, notice_s=SOON_S)
    simulation, _ = opened(with_px4(irises()), bridge)
    (warning,) = notices_of_run(caplog, simulation)
    assert warning.startswith(f"no PX4 yet for uav1 ({terminal.path} at 921600 baud): it stays")
    assert "SYS_HITL = 1" in warning


def test_of_many_three_are_named():
    addresses = {f"uav{k}": f"127.0.0.1:{4559 + k}" for k in range(1, 51)}
    warning = notice("PX4", addresses, "start them")
    assert warning.startswith("no PX4 yet for uav1 (127.0.0.1:4560), uav2 ")
    assert "uav3 (127.0.0.1:4562) and 47 more: they stay on the ground" in warning
