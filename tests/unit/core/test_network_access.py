"""Tests writing to connections that break, and to peers that do not read."""

import asyncio
import socket
import struct
from contextlib import suppress
from types import SimpleNamespace

from volery.bridges.unsent import MAX_UNSENT_BYTES, bound_unsent
from volery.comms.server.tcp import CommsServer
from volery.core.network_access import write_while_open
from volery.mavlink.links.tcp_bridge import _TcpClient


async def _write_after_reset(write):
    """Writes ten times in one turn of the loop to a client that has reset its connection."""
    made = asyncio.get_running_loop().create_future()

    class Server(asyncio.Protocol):
        def connection_made(self, transport):
            made.set_result(transport)

        def connection_lost(self, error):
            lost.set_result(error)

    lost = asyncio.get_running_loop().create_future()
    server = await asyncio.get_running_loop().create_server(Server, "127.0.0.1", 0)
    client = socket.create_connection(server.sockets[0].getsockname())
    transport = await made
    transport.pause_reading()  # so that a write is the first to meet the reset
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    client.close()
    for _ in range(10):
        write(transport, b"x" * 1000)
    await lost
    server.close()
    await server.wait_closed()


def test_a_broken_connection_is_written_to_without_warnings(caplog):
    asyncio.run(_write_after_reset(write_while_open))
    assert caplog.text == ""


def test_mavlink_clients_over_tcp_are_written_to_so(caplog):
    def write(transport, data):
        client = _TcpClient(None)
        client.transport, client.connection = transport, SimpleNamespace(sign=lambda given: given)
        client.send(data)

    asyncio.run(_write_after_reset(write))
    assert caplog.text == ""


def test_stations_of_the_radio_network_are_written_to_so(caplog):
    def write(transport, data):
        taken = iter([data])
        server = CommsServer(port=0)
        server.router = SimpleNamespace(
            take=lambda *_: next(taken, None), closing=lambda _number: False
        )
        server._send(SimpleNamespace(transport=transport, paused=False, number=1))

    asyncio.run(_write_after_reset(write))
    assert caplog.text == ""


def test_asyncio_warns_of_such_writes(caplog):
    """Or `write_while_open` is not needed any more."""
    asyncio.run(_write_after_reset(lambda transport, data: transport.write(data)))
    assert "socket.send() raised exception" in caplog.text


def test_a_peer_that_does_not_read_takes_little():
    with socket.create_server(("127.0.0.1", 0)) as server, socket.socket() as peer:
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        peer.connect(server.getsockname())
        sock, _ = server.accept()
        with sock:
            bound_unsent(sock)
            sock.setblocking(False)
            sent = 0
            with suppress(BlockingIOError):
                while sent < 100 * MAX_UNSENT_BYTES:
                    sent += sock.send(bytes(10_000))
    assert 10_000 < sent < 2 * MAX_UNSENT_BYTES
