"""Clients that have left leave no memory behind: nothing for the collector, and no free blocks."""

from __future__ import annotations

import gc
import json
import socket
import struct
import time
import weakref
from asyncio import Transport

import pytest
from live_graph import LiveGraph
from patient_websockets import connect
from websockets.protocol import State

from volery.bridges import unfinished
from volery.bridges.bridge_host import BridgeHost
from volery.bridges.rosbridge import first_message
from volery.bridges.rosbridge import server as server_module
from volery.bridges.rosbridge.first_message import GuardedConnection
from volery.bridges.rosbridge.protocol import RosbridgePeer
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.bridges.unfinished import SHARED
from volery.graph import messages as m
from volery.graph.service_reply import ServiceReply
from volery_benchmarks.hostile.websocket import BINARY, frame, frame_head, open_websocket

LONGEST_S = 60.0
MB = 1 << 20


def until(condition):
    ends = time.monotonic() + LONGEST_S
    while not condition():
        assert time.monotonic() < ends
        time.sleep(0.01)


@pytest.fixture
def server(request):
    live = LiveGraph()
    with BridgeHost(live.gateway) as bridges:
        server = RosbridgeServer(port=0, **getattr(request, "param", {}))
        bridges.open(server)
        publisher = live.do(lambda: live.graph.advertise("/a", "std_msgs/msg/String", latched=True))
        live.do(lambda: publisher.publish(m.String("text")))
        large = live.do(lambda: live.graph.advertise("/large", "std_msgs/msg/String", latched=True))
        live.do(lambda: large.publish(m.String("x" * (8 * MB))))
        yield server
    live.close()


def visit(server):
    """A client that uses a bit of everything, and leaves with an incomplete message."""
    with connect(f"ws://127.0.0.1:{server.port}") as client:
        client.send(json.dumps({"op": "subscribe", "topic": "/a"}))
        assert "text" in client.recv(60.0)
        call = {"op": "call_service", "service": "/rosapi/topics", "id": "1"}
        client.send(json.dumps(call))
        assert "/a" in client.recv(60.0)
        client.send(json.dumps({"op": "advertise", "topic": "/b", "type": "std_msgs/String"}))
        client.send(
            json.dumps({"op": "advertise_service", "service": "/s", "type": "std_srvs/Empty"})
        )
        client.send(json.dumps({"op": "bogus"}))
        assert "unknown operation" in client.recv(60.0)
        part = {"op": "fragment", "id": "f", "data": "x" * 100_000, "num": 0, "total": 3}
        client.send(json.dumps(part))
        until(lambda: SHARED.num_bytes > 0)
        return weakref.ref(next(iter(server._clients)))


def test_a_client_that_has_left_waits_for_no_collection(server, monkeypatch):
    peers = []

    class Peer(RosbridgePeer):
        def __init__(self, *args, **options):
            super().__init__(*args, **options)
            peers.append(weakref.ref(self))

    monkeypatch.setattr(server_module, "RosbridgePeer", Peer)
    gc.collect()
    gc.disable()
    try:
        connection = visit(server)
        until(lambda: not server.clients)
        until(lambda: connection() is None)
        until(lambda: peers[0]() is None)
    finally:
        gc.enable()


def reset(sock):
    """Resets a connection."""
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    sock.close()


def send_part(server):
    """Returns a client with an unfinished message."""
    sock = open_websocket(server.port)
    sock.sendall(frame_head(9_900_000, BINARY) + bytes(100_000))
    until(lambda: SHARED.num_bytes > 50_000)
    return sock


def leave(server):
    open_websocket(server.port).close()


def break_off(server):
    reset(send_part(server))


def be_refused(server):
    with socket.create_connection(("127.0.0.1", server.port)) as sock:
        sock.sendall(b"PUT / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        while sock.recv(1000):
            pass


def be_ended(server):
    """The server has no room; the client does not read, and leaves later."""
    sock = send_part(server)
    for share in tuple(SHARED._held_bytes):
        share.evict()
    until(lambda: not server.clients)
    sock.close()


def stop_reading(server):
    """Returns a client for which more waits than the system buffers."""
    sock = open_websocket(server.port)
    sock.sendall(frame(json.dumps({"op": "subscribe", "topic": "/large"}).encode()))
    until(lambda: any(connection.paused for connection in server._clients))
    return sock


def read_nothing(server):
    reset(stop_reading(server))


def answer_no_ping(server):
    with open_websocket(server.port):
        until(lambda: server.clients)
        until(lambda: not server.clients)


def leave_when_a_pong_is_late(server):
    """The server waits for the client's response to its close frame."""
    sock = open_websocket(server.port)
    until(lambda: any(connection.state is State.CLOSING for connection in server._clients))
    reset(sock)


SOON = {"keepalive_s": 0.2}
ENDS = [({}, visit) for visit in (leave, break_off, be_refused, be_ended, read_nothing)]
ENDS += [(SOON, visit) for visit in (answer_no_ping, leave_when_a_pong_is_late)]


@pytest.mark.parametrize(("server", "visit"), ENDS, indirect=["server"])
def test_no_end_of_a_connection_leaves_garbage(server, visit):
    kinds = GuardedConnection, Transport
    leave(server)  # the first one imports modules
    until(lambda: not server.clients)
    gc.collect()
    gc.disable()
    try:
        gc.set_debug(gc.DEBUG_SAVEALL)
        visit(server)
        until(lambda: not server.clients and not server._listener._open)
        gc.collect()
        kept = [type(found) for found in gc.garbage if issubclass(type(found), kinds)]
    finally:
        gc.set_debug(0)
        gc.garbage.clear()
        gc.enable()
    assert not kept


def test_a_client_that_reads_nothing_is_ended(server, monkeypatch):
    monkeypatch.setattr(first_message, "_MAX_BLOCKED_S", 0.2)
    with stop_reading(server):
        until(lambda: not server.clients)


def test_a_client_that_reads_slowly_stays(server):
    with stop_reading(server):
        (connection,) = server._clients
        unsent, ended = connection.transport.get_write_buffer_size(), []

        def check():
            before = connection._progress_check
            connection._check_progress(unsent + 1)
            ended.append(connection.transport.is_closing() or connection._progress_check is before)
            connection._check_progress(unsent)
            ended.append(connection.transport.is_closing())

        connection.loop.call_soon_threadsafe(check)
        until(lambda: len(ended) == 2)
        assert ended == [False, True]
        until(lambda: not server.clients)


def test_memory_is_returned_when_the_last_has_left(server, monkeypatch):
    """Less than what is returned at once while others are there."""
    returned = []
    monkeypatch.setattr(unfinished, "return_free_memory", lambda: returned.append(server.clients))
    monkeypatch.setattr(unfinished, "_RETURNED_BYTES", 1 << 60)
    monkeypatch.setattr(SHARED, "_freed", 0)
    with connect(f"ws://127.0.0.1:{server.port}") as client:
        part = {"op": "fragment", "id": "f", "data": "x" * (2 * MB), "num": 0, "total": 3}
        client.send(json.dumps(part))
        until(lambda: SHARED.num_bytes > 2 * MB)
    until(lambda: returned)
    assert returned == [0]
    visit(server)  # leaves with little
    until(lambda: not server.clients)
    assert len(returned) == 1


@pytest.mark.parametrize("settle", [lambda r: r.answer(1), lambda r: r.fail(None)])
def test_a_settled_reply_refers_to_nothing(settle):
    class Held:
        """Something to which callbacks refer."""

    held, calls = Held(), []
    gc.disable()
    try:
        reply = ServiceReply(*[lambda _, held=held: calls.append(held is not None)] * 2)
        reply.when_done(lambda held=held: calls.append(held is not None))
        gone = weakref.ref(held)
        del held
        settle(reply)
        settle(reply)
        assert calls == [True, True]
        assert gone() is None
    finally:
        gc.enable()
