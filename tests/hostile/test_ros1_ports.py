"""Unknown clients at the ports that rospy opens: silent, slow and oversize ones."""

from __future__ import annotations

import http.client
import importlib
import socket
import struct
import threading
from contextlib import ExitStack, closing, contextmanager
from io import BytesIO
from xmlrpc.client import Fault, MultiCall, ServerProxy, dumps

import pytest

from volery.bridges.ros1 import port_guards
from volery.bridges.ros1.connection_headers import MAX_HEADER_BYTES, HeaderServer
from volery.bridges.ros1.environment import load_rospy, rospy_is_installed
from volery.core.connection_limits import ConnectionLimits
from volery.core.listener import MAX_UNPROVEN, open_listener

HANG_S = 600.0
HEADER = b"\x0a\0\0\0\x06\0\0\0topic="
needs_rospy = pytest.mark.skipif(not rospy_is_installed(), reason="rospy is not installed")


def connect(address):
    return socket.create_connection(address, HANG_S)


class Headers:
    """A server of connection headers that responds to each header with its own bytes."""

    def __init__(self, header_s=HANG_S):
        self.listener = open_listener("127.0.0.1", 0, "TCPROS", limits=ConnectionLimits(512))
        self.address = self.listener.getsockname()
        self._server = HeaderServer(self.listener, self._respond, header_s)
        self._thread = threading.Thread(target=self._server.run)
        self._thread.start()

    def _respond(self, connection, _address):
        with connection:
            connection.setblocking(False)  # all of it is there
            (length,) = struct.unpack("<I", connection.recv(4))
            connection.sendall(connection.recv(length))

    def close(self):
        self._server.stop()
        self._thread.join(HANG_S)
        assert not self._thread.is_alive()
        assert self.listener.fileno() < 0


@pytest.fixture
def headers():
    with closing(Headers()) as served:
        yield served


def is_ended(connection):
    """Whether the other side closes a connection; with bytes unread that is a reset."""
    try:
        return connection.recv(64) == b""
    except ConnectionResetError:
        return True


def is_answered(address):
    with connect(address) as honest:
        honest.sendall(HEADER)
        return honest.recv(64) == HEADER[4:]


@pytest.mark.parametrize("sent", [b"", HEADER[:2], HEADER[:9]])
def test_silent_connections_keep_no_client_out(headers, sent):
    with ExitStack() as clients:
        for _ in range(2 * MAX_UNPROVEN):
            clients.enter_context(connect(headers.address)).sendall(sent)
        assert is_answered(headers.address)


def test_a_header_may_come_in_pieces(headers):
    with connect(headers.address) as slow:
        for byte in HEADER:
            slow.sendall(bytes([byte]))
            assert is_answered(headers.address)
        assert slow.recv(64) == HEADER[4:]


@pytest.mark.parametrize("length", [0, MAX_HEADER_BYTES + 1, (1 << 32) - 1])
def test_headers_of_absurd_lengths_end_the_connection(headers, length):
    with connect(headers.address) as client:
        client.sendall(struct.pack("<I", length))
        assert is_ended(client)
    assert is_answered(headers.address)


def test_the_longest_header_arrives(headers):
    longest = struct.pack("<I", MAX_HEADER_BYTES) + bytes(MAX_HEADER_BYTES)
    with connect(headers.address) as client:
        client.sendall(longest[:-1])
        assert is_answered(headers.address)
        client.sendall(longest[-1:])
        assert client.makefile("rb").read() == longest[4:]


def test_a_header_that_does_not_come_ends_the_connection():
    with closing(Headers(header_s=0.05)) as served, connect(served.address) as client:
        client.sendall(HEADER[:3])
        assert is_ended(client)


def test_a_client_that_leaves_early_is_forgotten(headers):
    with connect(headers.address) as client:
        client.sendall(HEADER[:9])
        client.shutdown(socket.SHUT_WR)
        assert is_ended(client)


# -------------------------------------------------------------------------------- rospy's servers


@pytest.fixture
def guarded(monkeypatch):
    """rospy, with guarded ports on loopback."""
    monkeypatch.setenv("ROS_IP", "127.0.0.1")
    load_rospy()
    port_guards.guard_ports()
    port_guards.guard_ports()  # a second time nothing happens


@needs_rospy
def test_rospys_tcpros_port_serves_others_beside_a_silent_connection(guarded):
    base = importlib.import_module("rospy.impl.tcpros_base")
    server = base.TCPROSServer()
    server.topic_connection_handler = lambda connection, _address, _header: connection.close()
    server.start_server()
    try:
        with connect(server.get_address()), connect(server.get_address()) as honest:
            honest.sendall(HEADER)
            assert is_ended(honest)
    finally:
        server.shutdown()


@needs_rospy
def test_what_a_ros1_node_sends_is_bounded(guarded, monkeypatch):
    monkeypatch.setattr(port_guards, "MAX_MESSAGE_BYTES", 1000)
    base = importlib.import_module("rospy.impl.tcpros_base")
    service = importlib.import_module("rospy.impl.tcpros_service")
    for module in (base, service):
        ours, theirs = socket.socketpair()
        with ours, theirs:
            theirs.sendall(bytes(4000))
            buffer = BytesIO()
            while buffer.tell() <= port_guards.MAX_MESSAGE_BYTES:
                module.recv_buff(ours, buffer, 400)
            with pytest.raises(base.TransportTerminated, match="sends more"):
                module.recv_buff(ours, buffer, 400)


@contextmanager
def calls():
    """An XML-RPC server as rospy opens it, with one method; yields its address."""
    xmlrpc = importlib.import_module("rosgraph.xmlrpc")
    server = xmlrpc.ThreadingXMLRPCServer(("127.0.0.1", 0), 0)
    server.register_multicall_functions()
    server.register_function(lambda text: text, "say")
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield server.server_address
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def say(address):
    with ServerProxy("http://{}:{}".format(*address)) as program:
        return program.say("it")


@needs_rospy
def test_silent_callers_give_way(guarded):
    before = threading.active_count()
    with calls() as address, ExitStack() as clients:
        for _ in range(2 * port_guards.MAX_CALLERS):
            clients.enter_context(connect(address))
            assert threading.active_count() < before + port_guards.MAX_CALLERS + 40
        assert say(address) == "it"


@needs_rospy
@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Content-Length": str(port_guards.MAX_CALL_BYTES + 1)}, 413),
        ({"Content-Length": "9" * 5000}, 413),
        ({"Content-Length": "-1"}, 411),
        ({"Content-Length": "\u00b2"}, 411),
        ({}, 411),
        ({"Transfer-Encoding": "chunked"}, 411),
        ({"Content-Length": "100", "Content-Encoding": "gzip"}, 415),
    ],
)
def test_bodies_beyond_bounds_are_not_read(guarded, headers, status):
    with calls() as address:
        client = http.client.HTTPConnection(*address, timeout=HANG_S)
        with closing(client):
            client.putrequest("POST", "/RPC2")
            for name, value in {"Content-Type": "text/xml", **headers}.items():
                client.putheader(name, value)
            client.endheaders()
            assert client.getresponse().status == status
        assert say(address) == "it"


@needs_rospy
def test_one_request_is_one_call(guarded):
    with calls() as address, ServerProxy("http://{}:{}".format(*address)) as program:
        several = MultiCall(program)
        several.say("one")
        several.say("two")
        with pytest.raises(Fault, match="not supported"):
            several()


@needs_rospy
def test_a_call_of_the_maximum_size_is_answered(guarded):
    room = port_guards.MAX_CALL_BYTES - len(dumps(("",), "say"))
    with calls() as address, ServerProxy("http://{}:{}".format(*address)) as program:
        assert program.say("x" * room) == "x" * room
