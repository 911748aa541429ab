"""Servers of the web under floods: frames that are no messages, and requests without an end.

A flood ends where the server reads no more of it, which is seen by a socket that takes no more.
"""

from __future__ import annotations

import base64
import os
import select
import socket
import struct
import sys
from contextlib import ExitStack, closing, suppress
from pathlib import Path

import pytest
from patient_websockets import connect
from websockets.exceptions import ConnectionClosed
from websockets.frames import Opcode

from volery.bridges import frame_limits
from volery.bridges.bridge_host import BridgeHost
from volery.bridges.frame_limits import (
    FRAMES_PER_S,
    MAX_FRAGMENTS,
    MAX_FRAMES_AHEAD,
    FrameLimits,
    PausedTransport,
)
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.core.listener import MAX_UNPROVEN
from volery.runtime.idle_server import IdleServer
from volery.server.http_protocol import READ_BYTES

sys.path.append(str(Path(__file__).parents[1] / "unit" / "server"))
from live_graph import LiveGraph
from page_bench import fetch, serving

STALL_S = 1.0
"""A socket that takes nothing for so long takes no more."""
FLOOD_BYTES = 32 << 20
BUFFERS_BYTES = 16 << 20
"""What the system may take of a flood that is not read, with much room."""
KEY = base64.b64encode(bytes(16)).decode()
UPGRADE = (
    "GET /rosbridge HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
    f"Connection: Upgrade\r\nSec-WebSocket-Key: {KEY}\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


@pytest.fixture(scope="module")
def server():
    with serving(IdleServer(lambda _: None)) as server:
        yield server


@pytest.fixture(scope="module")
def rosbridge():
    live = LiveGraph()
    with BridgeHost(live.gateway) as bridges:
        server = RosbridgeServer(port=0)
        bridges.open(server)
        yield server
    live.close()


@pytest.fixture(params=["page", "rosbridge"])
def either(request, server, rosbridge):
    """A server of WebSockets."""
    return {"page": server, "rosbridge": rosbridge}[request.param]


def serves(server):
    """Whether another client is answered."""
    with connect(f"ws://127.0.0.1:{server.port}/rosbridge") as client:
        client.send('{"op": "call_service", "service": "/nobody", "id": "1"}')
        return "nobody" in client.recv(60.0)


def frame(opcode, payload=b"", *, fin=True):
    """A frame of a client with a mask of zeros."""
    head = bytes([(0x80 if fin else 0) | opcode])
    size = len(payload)
    length = bytes([0x80 | size]) if size < 126 else b"\xfe" + struct.pack(">H", size)
    return head + length + bytes(4) + payload


def plain(server):
    return socket.create_connection(("127.0.0.1", server.port), 60.0)


def upgraded(server):
    """A WebSocket connection of which nothing is read by itself."""
    client = plain(server)
    client.sendall(UPGRADE.format(port=server.port).encode())
    response = b""
    while b"\r\n\r\n" not in response:
        response += client.recv(4096)
    assert response.startswith(b"HTTP/1.1 101")
    return client


def flood(client, piece, *, reads):
    """Bytes that the server, and the system, take of a flood; FLOOD_BYTES if all of them."""
    client.setblocking(False)
    data, sent = piece * (1 + (1 << 16) // len(piece)), 0
    while sent < FLOOD_BYTES:
        readable, writable, _ = select.select([client] if reads else [], [client], [], STALL_S)
        if readable:
            client.recv(1 << 20)
        elif not writable:
            break
        if writable:
            try:
                sent += client.send(data)
            except ConnectionError:  # the server has ended the connection
                break
    return sent


FLOODS = {
    "pings": frame(Opcode.PING, bytes(125)),
    "pongs": frame(Opcode.PONG, bytes(125)),
    "fragments": frame(Opcode.CONT, b"", fin=False),
}


@pytest.mark.parametrize("reads", [True, False])
@pytest.mark.parametrize("kind", FLOODS)
def test_floods_of_frames_are_not_read(either, monkeypatch, kind, reads):
    monkeypatch.setattr(frame_limits, "FRAMES_PER_S", 10.0)  # a hold takes seconds
    with upgraded(either) as client:
        client.sendall(frame(Opcode.TEXT, fin=False))
        assert flood(client, FLOODS[kind], reads=reads) < BUFFERS_BYTES
        assert serves(either)
    assert serves(either)


def test_a_message_of_too_many_fragments_ends_the_connection(either):
    with connect(f"ws://127.0.0.1:{either.port}/rosbridge") as client:
        with suppress(ConnectionClosed):
            client.send("x" for _ in range(MAX_FRAGMENTS + 2))
        with pytest.raises(ConnectionClosed, match="fragments"):
            client.recv(60.0)


def test_honest_clients_ping_and_send_fragments(either):
    with connect(f"ws://127.0.0.1:{either.port}/rosbridge") as client:
        for answered in [client.ping() for _ in range(200)]:
            assert answered.wait(60.0)
        text = '{"op": "call_service", "service": "/nobody", "id": "1"}'
        client.send(iter(text))
        assert "nobody" in client.recv(60.0)


def test_frames_are_counted_over_time():
    """At the rate that clients may keep up, and a little above it, on a clock of the test's own."""

    class Loop:
        now_s = 0.0

        def time(self):
            return self.now_s

        def call_later(self, wait_s, call, *arguments):
            self.due = (self.now_s + wait_s, call, arguments)
            return closing_handle

    class Transport:
        reads = True

        def pause_reading(self):
            self.reads = False

        def resume_reading(self):
            self.reads = True

    class Handle:
        def cancel(self):
            pass

    closing_handle, loop, transport = Handle(), Loop(), Transport()
    held = PausedTransport(transport)
    limits = FrameLimits(held, loop, lambda _reason: None)
    for _ in range(5 * MAX_FRAMES_AHEAD):
        loop.now_s += 1.0 / FRAMES_PER_S
        limits.control_frame()
        assert transport.reads
    for _ in range(MAX_FRAMES_AHEAD + 10):
        limits.control_frame()
    assert not transport.reads
    held.pause_reading()
    due_s, call, arguments = loop.due
    assert due_s - loop.now_s == pytest.approx(11.0 / FRAMES_PER_S, rel=0.2)
    call(*arguments)
    assert not transport.reads  # the server has not taken the last message
    held.resume_reading()
    assert transport.reads


@pytest.mark.parametrize(
    "request_bytes",
    [
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: " + b"x" * (1 << 20),
        b"GET /" + b"x" * (1 << 20) + b" HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + b"".join(b"X%d: x\r\n" % k for k in range(50_000)) + b"\r\n",
        b"x" * (1 << 20),
    ],
)
def test_heads_of_requests_are_bounded(server, request_bytes):
    with plain(server) as client:
        try:
            client.sendall(request_bytes)
            response = client.recv(64)
        except (ConnectionResetError, BrokenPipeError):
            response = b""
        assert not response or response.split()[1].startswith(b"4")
    assert fetch(server, "/api/status").status == 200


def test_requests_behind_another_are_kept_in_small_numbers(server):
    """The responses are not read, so the requests behind them have to wait in the system."""
    request = f"GET /api/status HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n".encode()
    with plain(server) as client:
        assert flood(client, request, reads=False) < BUFFERS_BYTES
        assert fetch(server, "/api/status").status == 200
    assert READ_BYTES < 1 << 17


def test_silent_and_halting_requests_keep_no_client_out(server):
    heads = (b"", b"G", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n", b"POST /api/upload HTTP/1.1\r\n")
    with ExitStack() as clients:
        for number in range(4 * MAX_UNPROVEN):
            client = clients.enter_context(closing(plain(server)))
            client.sendall(heads[number % len(heads)])
        assert fetch(server, "/api/status").status == 200


def test_a_huge_frame_is_refused_by_its_length(server):
    with upgraded(server) as client:
        client.sendall(b"\x82\xff" + struct.pack(">Q", 1 << 40) + bytes(4))
        assert b"\x03\xf1" in client.recv(4096)  # 1009


def test_text_that_is_no_utf_8_ends_the_connection_quietly(server, caplog):
    for _ in range(3):
        with upgraded(server) as client:
            client.sendall(frame(Opcode.TEXT, b"\xff\xfe" + os.urandom(8)))
            assert client.recv(4096)
    assert "Traceback" not in caplog.text
