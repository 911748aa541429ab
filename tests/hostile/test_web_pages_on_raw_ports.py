"""A foreign web page sends HTTP or TLS to ports that speak binary protocols.

`fetch('http://127.0.0.1:PORT', {method: 'POST', mode: 'no-cors', body})` puts bytes of the page's
choice behind an HTTP head; parsers that search for frames would find them.
"""

import asyncio
import contextlib
import socket
import threading
from functools import partial

import pytest
from held_ports import held_port
from hypothesis import given
from hypothesis import strategies as st
from live_graph import LiveGraph

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros_tcp.endpoint import RosTcpEndpoint
from volery.bridges.ros_tcp.wire import frame as ros_tcp_frame
from volery.bridges.sensor_link.payloads import encode_payload
from volery.bridges.sensor_link.server import SensorLink
from volery.bridges.sensor_link.wire import SensorLinkKind as SensorKind
from volery.bridges.sensor_link.wire import encode_frame as sensor_frame
from volery.comms.control_payloads import Hello, encode_hello
from volery.comms.protocol import StationFrameKind, encode_frame
from volery.comms.server.tcp import CommsServer
from volery.core.preamble import Preamble
from volery.graph import messages as m
from volery.mavlink.codec import dialect
from volery.mavlink.hil.px4_bridge import Px4Bridge
from volery.mavlink.links.tcp_bridge import MavlinkTcp

TIMEOUT_S = 600.0
METHODS = ("GET", "HEAD", "POST", "PUT", "DELETE", "CONNECT", "OPTIONS", "TRACE", "PATCH")
HELLO_OF_TLS = b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"


def head(method, body=b""):
    return (
        f"{method} / HTTP/1.1\r\nHost: 127.0.0.1:5760\r\nOrigin: https://stranger.example\r\n"
        f"Content-Type: text/plain\r\nContent-Length: {len(body)}\r\n\r\n"
    ).encode() + body


# ------------------------------------------------------------------------------------ the check


@pytest.mark.parametrize("words", [*map(head, METHODS), HELLO_OF_TLS, b"PRI * HTTP/2.0\r\n\r\n"])
@pytest.mark.parametrize("size", [1, 2, 3, 7, 1000])
def test_http_and_tls_are_recognized_in_pieces_of_any_size(words, size):
    preamble = Preamble()
    passed = b"".join(preamble.feed(words[at : at + size]) for at in range(0, len(words), size))
    assert preamble.refused == ("TLS" if words[:1] == b"\x16" else "HTTP")
    assert passed == b""


@pytest.mark.parametrize(
    "first", [b"\xfd", b"\xfe", b"\xaa", b"\x00", b"\x17", b"\x16\x04", b"GEX", b"get ", b"POSTS"]
)
def test_other_bytes_pass_as_soon_as_they_differ(first):
    preamble = Preamble()
    passed = [preamble.feed(first[at : at + 1]) for at in range(len(first))]
    assert b"".join(passed) == first
    assert preamble.refused is None
    assert preamble.feed(b"POST / HTTP/1.1") == b"POST / HTTP/1.1"  # later bytes are data


@given(st.lists(st.binary(max_size=6), max_size=12))
def test_what_is_not_refused_passes_unchanged(pieces):
    preamble = Preamble()
    passed = b"".join(preamble.feed(piece) for piece in pieces)
    everything = b"".join(pieces)
    if preamble.refused is None:
        assert everything.startswith(passed)
        assert passed == everything or len(everything) < 12
    else:
        assert passed == b""


# ------------------------------------------------------------------------------------ the ports


class Graph:
    """A graph with a UAV, and bridges to it."""

    def __init__(self):
        self.live = LiveGraph()
        self.live.graph.advertise("/uav1/imu", "sensor_msgs/msg/Imu")
        self.received = []
        for topic, kind in (("/uav1/pose_command", m.PoseStamped), ("/in", m.String)):
            subscribe = partial(self.live.graph.subscribe, topic, self.received.append, kind)
            self.live.do(subscribe)
        self.bridges = BridgeHost(self.live.gateway)
        self._held = contextlib.ExitStack()

    def open_px4(self):
        """A bridge for PX4, and its port, which has to have a number."""
        port = self._held.enter_context(held_port())
        return self.open(Px4Bridge(port=port)), port

    def open(self, bridge):
        self.bridges.open(bridge)
        return bridge

    def close(self):
        self.bridges.close()
        self._held.close()
        self.live.close()


@pytest.fixture
def graph():
    made = Graph()
    yield made
    made.close()


class Comms:
    """The communication server in a thread of its own."""

    def __init__(self):
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever)
        self._thread.start()
        self.server = CommsServer(port=0)
        self._do(self.server.start())

    def _do(self, work):
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(TIMEOUT_S)

    def close(self):
        self._do(self.server.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()


@pytest.fixture
def comms():
    made = Comms()
    yield made.server
    made.close()


def heartbeat():
    codec = dialect().MAVLink(None, 245, 190)
    return codec.heartbeat_encode(6, 8, 0, 0, 0).pack(codec)


def pose():
    at = m.Pose(m.Point(1.0, 2.0, 3.0), m.Quaternion(0.0, 0.0, 0.0, 1.0))
    payload = encode_payload(SensorKind.POSE_COMMAND, m.PoseStamped(m.header(5, "map"), at))
    return sensor_frame(SensorKind.POSE_COMMAND, 1, 0, 5, payload)


def hello():
    return encode_frame(
        StationFrameKind.HELLO, 2, 0, payload=encode_hello(Hello(0, 2, 4, "page", ""))
    )


def ports(graph, comms, name):
    """The port of a server by name, and a frame that commands something there."""
    if name == "comms":
        return comms.port, hello()
    if name == "mavlink_tcp":
        return graph.open(MavlinkTcp(port=0)).port, heartbeat()
    if name == "ros_tcp":
        return graph.open(RosTcpEndpoint(port=0)).port, ros_tcp_frame("/in", b"\0" * 8)
    if name == "px4":
        return graph.open_px4()[1], heartbeat()
    link = graph.open(SensorLink(port=0, image_port=0))
    return (link.port if name == "sensor_link" else link.image_port), pose()


NAMES = ("comms", "mavlink_tcp", "ros_tcp", "px4", "sensor_link", "sensor_link_images")


def is_ended(sock):
    """Whether the server ends the connection; what it still says is passed over."""
    sock.settimeout(TIMEOUT_S)
    with contextlib.suppress(ConnectionError):
        while sock.recv(65536):
            pass
    return True


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("at_once", [True, False])
def test_a_page_that_posts_a_frame_is_sent_away(graph, comms, caplog, name, at_once):
    port, frame = ports(graph, comms, name)
    words = head("POST", 3 * frame)
    with socket.create_connection(("127.0.0.1", port)) as sock:
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with contextlib.suppress(OSError):  # it is ended while it still sends
            if at_once:
                sock.sendall(words)
            else:
                for byte in words:
                    sock.sendall(bytes((byte,)))
        assert is_ended(sock)
    graph.live.do(lambda: None)
    assert graph.received == []
    if name == "comms":
        assert comms.router.stations() == {}
    assert any("HTTP" in record.message for record in caplog.records)


@pytest.mark.parametrize("name", NAMES)
def test_tls_is_sent_away(graph, comms, name):
    port, _ = ports(graph, comms, name)
    with socket.create_connection(("127.0.0.1", port)) as sock:
        sock.sendall(HELLO_OF_TLS)
        assert is_ended(sock)


def test_a_page_does_not_keep_a_px4_from_its_port(graph):
    bridge, port = graph.open_px4()
    idle = socket.create_connection(("127.0.0.1", port))
    with idle, socket.create_connection(("127.0.0.1", port)) as px4:
        px4.sendall(heartbeat())
        assert is_ended(idle)
        assert bridge.connected == ("uav1",)
