"""Sockets and serial lines: pymavlink as a client of a running simulation."""

import contextlib
import os
import random
import socket
import threading
import time

import pytest
from flying_bench import scenario

from volery.bridges.bridge_factory import BridgeOptions, make_bridge
from volery.bridges.bridge_host import BridgeHost
from volery.cli.bridges import open_bridges
from volery.cli.flight import RunOptions
from volery.core.errors import BridgeError
from volery.mavlink.links.serial_bridge import MavlinkSerial
from volery.mavlink.links.tcp_bridge import MavlinkTcp
from volery.mavlink.links.udp_bridge import MavlinkUdp
from volery.runtime import Simulation

mavutil = pytest.importorskip("pymavlink.mavutil")

BASES = range(24540, 32000, 300)
"""Away from 14540, where a run of the user's may stand; the first one that is free is taken."""


class Running:
    """A simulation that runs in real time in a thread of its own, and its bridges."""

    def __init__(self, simulation):
        self.simulation = simulation
        self.bridges = BridgeHost(simulation.gateway)
        self._thread = threading.Thread(target=lambda: simulation.run(600.0, speed=1.0))

    def __enter__(self):
        self.simulation.gateway.use_low_latency()
        self._thread.start()
        return self

    def __exit__(self, *_):
        self.simulation.clock.resume()
        self.simulation.clock.quit()
        self._thread.join()
        self.bridges.close()
        self.simulation.close()


@pytest.fixture(scope="module")
def running():
    with Running(Simulation(scenario(count=2), threads=1)) as running:
        for running.base in BASES:
            with contextlib.suppress(BridgeError):
                running.bridges.open(MavlinkUdp(port=running.base))
                break
        yield running


@pytest.fixture
def client(running):
    link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{running.base}", source_system=245)
    yield link
    link.close()


def ack_of(client, command, *params):
    client.mav.command_long_send(1, 1, command, 0, *params, *(0,) * (7 - len(params)))
    ack = client.recv_match(type="COMMAND_ACK", blocking=True, timeout=60.0)
    assert ack.command == command
    return ack.result


def test_a_client_is_found_and_answered(client):
    assert client.wait_heartbeat(timeout=60.0).autopilot == 12
    assert client.target_system == 1
    assert ack_of(client, 512, 242) == 0
    client.mav.param_request_read_send(1, 1, b"MIS_TAKEOFF_ALT", -1)
    value = client.recv_match(type="PARAM_VALUE", blocking=True, timeout=60.0)
    assert value.param_value == 2.5


def test_every_vehicle_has_a_port_and_the_ground_station_receives_all(running):
    second = mavutil.mavlink_connection(f"udpin:127.0.0.1:{running.base + 1}")
    ground = mavutil.mavlink_connection(f"udpin:127.0.0.1:{running.base + 10}")
    try:
        assert second.wait_heartbeat(timeout=60.0).get_srcSystem() == 2
        systems = set()
        end = time.monotonic() + 60.0
        while systems != {1, 2} and time.monotonic() < end:
            message = ground.recv_match(type="HEARTBEAT", blocking=True, timeout=1)
            systems |= {message.get_srcSystem()} if message else set()
        assert systems == {1, 2}
    finally:
        second.close()
        ground.close()


def test_heartbeats_go_on_while_the_simulation_stands_still(running, client):
    assert client.wait_heartbeat(timeout=60.0)
    running.simulation.clock.pause()
    running.simulation.post(lambda: None).result(60.0)  # it stands still
    stands_at_ns = running.simulation.time_ns
    while client.recv_msg():
        pass
    beats = [client.recv_match(type="HEARTBEAT", blocking=True, timeout=60.0) for _ in range(3)]
    assert running.simulation.time_ns == stands_at_ns
    running.simulation.clock.resume()
    assert all(beats)


def test_a_port_that_is_taken_is_reported(running):
    other = Simulation(scenario(), threads=1)
    with other, BridgeHost(other.gateway) as bridges, pytest.raises(BridgeError) as error:
        bridges.open(MavlinkUdp(port=running.base))
    assert (
        str(error.value)
        == f"uav1: cannot listen on UDP port {running.base + 40}: the port is taken"
    )
    with pytest.raises(BridgeError, match="other machines"):
        running.bridges.open(make_bridge("mavlink=0.0.0.0:14540", BridgeOptions()))


def test_tcp_carries_all_vehicles_on_each_connection(running):
    bridge = MavlinkTcp(port=0)
    running.bridges.open(bridge)
    first, second = (
        mavutil.mavlink_connection(f"tcp:127.0.0.1:{bridge.port}", source_system=s)
        for s in (250, 251)
    )
    try:
        systems = set()
        end = time.monotonic() + 60.0
        while systems != {1, 2} and time.monotonic() < end:
            message = first.recv_match(type="HEARTBEAT", blocking=True, timeout=1)
            systems |= {message.get_srcSystem()} if message else set()
        assert systems == {1, 2}
        second.mav.command_long_send(2, 1, 512, 0, 242, 0, 0, 0, 0, 0, 0)
        ack = second.recv_match(type="COMMAND_ACK", blocking=True, timeout=60.0)
        assert (ack.get_srcSystem(), ack.target_system, ack.result) == (2, 251, 0)
    finally:
        first.close()
        second.close()


def test_a_serial_line_carries_them_too(running):
    ours, theirs = os.openpty()
    path = os.ttyname(theirs)
    running.bridges.open(MavlinkSerial(path, 57600))
    station = mavutil.mavlink.MAVLink(None, 249, 190)
    station.robust_parsing = True
    kinds, asked = set(), False
    end = time.monotonic() + 60.0
    while "COMMAND_ACK" not in kinds and time.monotonic() < end:
        for message in station.parse_buffer(os.read(ours, 4096)) or ():
            kinds.add(message.get_type())
        if not asked and "HEARTBEAT" in kinds:
            request = station.command_long_encode(1, 1, 512, 0, 242, 0, 0, 0, 0, 0, 0)
            os.write(ours, request.pack(station))
            asked = True
    assert "COMMAND_ACK" in kinds
    os.close(theirs)
    os.close(ours)


def test_noise_on_the_socket_disturbs_no_vehicle(running, client):
    assert client.wait_heartbeat(timeout=60.0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as noise:
        for data in (b"", b"\xfd", bytes(300), b"\xfd" * 5000, random.Random(1).randbytes(1000)):
            noise.sendto(data, ("127.0.0.1", running.base + 40))
    assert ack_of(client, 512, 242) == 0


def test_names_of_the_command_line(running):
    simulation = Simulation(scenario(), threads=1)
    with simulation:
        options = RunOptions("flat", bridges=(f"mavlink={running.base + 200}", "mavlink-tcp=0"))
        with open_bridges(simulation.gateway, options):
            simulation.run(0.1)
        with (
            pytest.raises(BridgeError, match="is not a serial line"),
            open_bridges(
                simulation.gateway, RunOptions("flat", bridges=("mavlink-serial=/dev/null:57600",))
            ),
        ):
            pass
