"""Tests that connections reach their server with their first request."""

import asyncio
import contextlib
import gc
import itertools
import socket

import pytest

from volery.core import listener
from volery.core.connection_limits import ConnectionLimits
from volery.core.listener import Opening, open_listener
from volery.core.pending_connections import (
    LOOK_BYTES,
    PendingConnections,
    look_at_binary,
    look_at_http,
)

REQUEST = b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"
HANG_S = 600.0


class Server:
    """Counts the connections that it gets and echoes what they send."""

    def __init__(self, opening, max_unproven=None):
        self.limits = ConnectionLimits(64)
        self.listener = open_listener(
            "127.0.0.1", 0, "test", limits=self.limits, max_unproven=max_unproven, opening=opening
        )
        self.port = self.listener.getsockname()[1]
        self.num_connections = 0

    async def __aenter__(self):
        self._server = await asyncio.start_server(self._serve, sock=self.listener)
        return self

    async def __aexit__(self, *_):
        self._server.close()
        await self._server.wait_closed()

    async def _serve(self, reader, writer):
        self.num_connections += 1
        with contextlib.suppress(ConnectionError):
            while data := await reader.read(65536):
                writer.write(data)
                await writer.drain()
        writer.close()

    async def until(self, condition):
        async with asyncio.timeout(HANG_S):
            while not condition():
                await asyncio.sleep(0.005)


@contextlib.asynccontextmanager
async def client(server):
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    yield reader, writer
    writer.close()
    with contextlib.suppress(ConnectionError):
        await writer.wait_closed()


def played(scene):
    asyncio.run(asyncio.wait_for(scene(), HANG_S))


HTTP = Opening(look_at_http)


@pytest.mark.parametrize("has_epoll", [True, False])
def test_a_request_in_pieces_is_served_whole(monkeypatch, has_epoll):
    monkeypatch.setattr(
        PendingConnections, "is_available", has_epoll and PendingConnections.is_available
    )

    async def scene():
        async with Server(HTTP) as server, client(server) as (reader, writer):
            for byte in REQUEST:
                writer.write(bytes((byte,)))
                await asyncio.sleep(0)
            assert await reader.readexactly(len(REQUEST)) == REQUEST
            assert server.num_connections == 1

    played(scene)


@pytest.mark.parametrize("words", [b"", b"GET / HTTP/1.1\r\nHost: x\r\n"])
def test_half_a_request_opens_no_connection_of_the_server(words):
    async def scene():
        async with Server(HTTP) as server:
            async with contextlib.AsyncExitStack() as stack:
                for _ in range(20):
                    _, writer = await stack.enter_async_context(client(server))
                    writer.write(words)
                await server.until(lambda: server.limits.num_connections == 20)
                async with client(server) as (reader, writer):  # others are served meanwhile
                    writer.write(REQUEST)
                    assert await reader.readexactly(len(REQUEST)) == REQUEST
                assert server.num_connections == 1
            await server.until(lambda: server.limits.num_connections == 0)

    played(scene)


def test_the_oldest_gives_way():
    async def scene():
        async with Server(HTTP, max_unproven=2) as server, contextlib.AsyncExitStack() as stack:
            clients = [await stack.enter_async_context(client(server)) for _ in range(3)]
            assert await clients[0][0].read() == b""
            for reader, writer in clients[1:]:
                writer.write(REQUEST)
                assert await reader.readexactly(len(REQUEST)) == REQUEST

    played(scene)


def test_new_connections_come_a_few_at_a_turn():
    async def scene():
        async with Server(HTTP) as server:
            socks = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(20)]
            for sock in socks:
                sock.sendall(REQUEST)
            counts = [server.num_connections]
            while counts[-1] < 20:
                await asyncio.sleep(0)
                counts.append(server.num_connections)
            assert max(b - a for a, b in itertools.pairwise(counts)) <= 4
            for sock in socks:
                sock.close()

    played(scene)


def test_young_objects_are_collected_as_connections_come(monkeypatch):
    collections = []
    monkeypatch.setattr(listener, "collect_young", lambda: collections.append(0))

    async def scene():
        async with Server(HTTP) as server:
            num = 2 * listener._ADMISSIONS_A_COLLECTION + 1
            for k in range(num):
                with socket.create_connection(("127.0.0.1", server.port)) as sock:
                    sock.sendall(REQUEST)
                    await server.until(lambda k=k: server.num_connections == k + 1)

    played(scene)
    assert len(collections) == 2


def test_the_timeout_ends_a_connection():
    async def scene():
        async with Server(Opening(look_at_http, timeout_s=0.05)) as server:
            async with client(server) as (early, _), client(server) as (late, _):
                assert await early.read() == b""
                assert await late.read() == b""
            await server.until(lambda: server.limits.num_connections == 0)
            assert server.num_connections == 0

    played(scene)


def test_a_long_head_is_left_to_the_server():
    words = b"GET /" + b"x" * LOOK_BYTES

    async def scene():
        async with Server(HTTP) as server, client(server) as (reader, writer):
            writer.write(words)
            assert await reader.readexactly(len(words)) == words

    played(scene)


def test_a_greeting_comes_first_and_a_browser_is_sent_away():
    opening = Opening(look_at_binary, greeting=b"hello")

    async def scene():
        async with Server(opening) as server:
            async with client(server) as (reader, writer):
                assert await reader.readexactly(5) == b"hello"
                writer.write(b"PO")
                await asyncio.sleep(0.01)
                assert server.num_connections == 0
                writer.write(b"ST / HTTP/1.1\r\n\r\n")
                with contextlib.suppress(ConnectionResetError):
                    assert await reader.read() == b""
            assert server.num_connections == 0
            async with client(server) as (reader, writer):
                writer.write(b"PING")
                assert await reader.readexactly(9) == b"helloPING"
            assert server.listener.refusals.counts

    played(scene)


def test_what_waited_leaves_no_cycles():
    """Cycles stay in memory until the garbage collector stops everything to find them."""

    async def scene():
        async with Server(HTTP) as server:

            async def visit():
                with socket.create_connection(("127.0.0.1", server.port)) as sock:
                    sock.send(b"GET / HTTP/1.1\r\n")
                    await server.until(lambda: server.limits.num_connections == 1)
                await server.until(lambda: server.limits.num_connections == 0)

            await visit()
            gc.collect()
            gc.disable()
            try:
                await visit()
                gc.set_debug(gc.DEBUG_SAVEALL)
                gc.collect()
                kept = [found for found in gc.garbage if isinstance(found, socket.socket)]
            finally:
                gc.set_debug(0)
                gc.garbage.clear()
                gc.enable()
            assert kept == []

    played(scene)
