"""Server and stations over loopback: broken peers, slow readers, a server that is killed."""

from __future__ import annotations

import asyncio
import socket

import pytest

from volery.comms.addresses import ALL, Identity
from volery.comms.control_payloads import Hello, Reason, encode_hello
from volery.comms.protocol import StationFrameKind, encode_frame
from volery.comms.server.settings import RouterSettings
from volery.comms.server.tcp import CommsServer
from volery.comms.station.tcp import Station
from volery.core.errors import BridgeError, CommsError
from volery.core.framing import Flaw
from volery_benchmarks.comms import Traffic, served


async def until(true) -> None:
    async def wait() -> None:
        while not true():
            await asyncio.sleep(0.005)

    await asyncio.wait_for(wait(), 60.0)


def with_server(test, settings=None):
    """Run `test(server)` beside a server on a free port."""

    async def run() -> None:
        server = CommsServer(settings, port=0)
        await server.start()
        try:
            await test(server)
        finally:
            await server.stop()

    asyncio.run(run())


async def joined(server, address, got=None, **options) -> Station:
    def take(frame):
        if got is not None:
            got.append(frame.payload)

    station = Station(Identity.of(address), take, port=server.port, **options)
    await station.start()
    return station


def test_messages_of_both_kinds_come_in_order() -> None:
    async def test(server) -> None:
        got: list[bytes] = []
        one, two = await joined(server, 0), await joined(server, 5, got)
        for k in range(300):
            kind = StationFrameKind.COMMAND if k % 3 else StationFrameKind.SENSING
            one.send(kind, ALL if k % 2 else 5, str(k).encode())
        await asyncio.wait_for(one.until_settled(), 60.0)
        assert got == [str(k).encode() for k in range(300)]
        assert server.statistics.delivered == 300
        await two.stop()
        await until(lambda: server.statistics.present == 1)
        assert server.statistics.away == 1
        await one.stop()

    with_server(test, RouterSettings(grace_s=0.0))


def test_a_station_that_does_not_read_delays_no_other() -> None:
    async def test(server) -> None:
        got: list[bytes] = []
        one, reader = await joined(server, 0), await joined(server, 1, got)
        with socket.socket() as stuck:
            stuck.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            stuck.connect(("127.0.0.1", server.port))
            hello = encode_hello(Hello(0, 2, 4, "stuck", ""))
            stuck.sendall(encode_frame(StationFrameKind.HELLO, 2, 0, payload=hello))
            await until(lambda: server.statistics.present == 3)
            for _ in range(100):
                one.send(StationFrameKind.SENSING, 2, bytes(10_000))
                one.send(StationFrameKind.SENSING, 1, b"x")
            await until(lambda: len(got) == 100)
            assert server.statistics.waiting >= 100
        for station in (one, reader):
            await station.stop()

    with_server(test)


def test_wrong_tokens_and_full_groups_are_refused() -> None:
    async def test(server) -> None:
        with pytest.raises(CommsError, match="token"):
            await joined(server, 0, token="wrong")
        with pytest.raises(CommsError, match="4 planes"):
            await joined(server, 0, token="open", group_size=3)
        station = await joined(server, 0, token="open")
        assert server.statistics.refused == {Reason.TOKEN: 1, Reason.BATCH_SIZE: 1}
        await station.stop()

    with_server(test, RouterSettings(token="open"))


def test_noise_and_half_frames_do_no_harm() -> None:
    async def test(server) -> None:
        got: list[bytes] = []
        one, two = await joined(server, 0), await joined(server, 1, got)
        hello = encode_frame(
            StationFrameKind.HELLO, 2, 0, payload=encode_hello(Hello(0, 2, 4, "", ""))
        )
        for data in (b"no frame at all\r\n\r\n" * 10, hello[:-3], hello[:-1] + b"?" + hello):
            with socket.create_connection(("127.0.0.1", server.port)) as noisy:
                noisy.sendall(data)
        await until(lambda: server.statistics.noise_bytes > 180)
        await until(lambda: server.statistics.connections == 2)
        assert server.statistics.corrupt.keys() <= {Flaw.BODY, Flaw.CUT}
        one.send(StationFrameKind.COMMAND, 1, b"still here")
        await until(lambda: got == [b"still here"])
        await one.stop()
        await two.stop()

    with_server(test)


def test_the_newest_of_two_stays_and_the_old_one_does_not_come_again() -> None:
    async def test(server) -> None:
        old = await joined(server, 0)
        new = await joined(server, 0)
        await until(lambda: old.core.fatal is not None)
        await until(old._task.done)  # which connects again as long as it runs
        assert new.joined
        assert not old.joined
        assert server.statistics.replaced == 1
        await old.stop()
        await new.stop()

    with_server(test)


def test_addresses_beyond_loopback_need_consent_and_token() -> None:
    async def start(server) -> None:
        await server.start()

    with pytest.raises(BridgeError, match="--allow-remote"):
        asyncio.run(start(CommsServer(host="0.0.0.0")))
    with pytest.raises(BridgeError, match="--token"):
        asyncio.run(start(CommsServer(host="0.0.0.0", anywhere=True)))


def test_ports_that_are_taken_and_servers_that_are_not_there() -> None:
    async def test(server) -> None:
        with pytest.raises(CommsError, match="taken"):
            await CommsServer(port=server.port).start()
        lost = Station(Identity(0, 0), port=1)
        with pytest.raises(CommsError, match="volery comms"):
            await lost.start(0.3)

    with_server(test)


def test_a_killed_server_is_joined_again_and_nothing_is_lost_or_reordered() -> None:
    async def some(traffic) -> None:
        for _ in range(90):
            traffic._send_one()
            await asyncio.sleep(0.002)

    async def test() -> None:
        with served() as (first, port):
            traffic = Traffic(port, 6)
            await traffic.start()
            await some(traffic)
            first.kill()
            await some(traffic)
            await until(lambda: not traffic.joined)
            await some(traffic)
            with served(port):
                await until(lambda: traffic.joined)
                await some(traffic)
                await traffic.until_quiet(60.0)
            await traffic.stop()
        assert traffic.came == traffic.sent == 4 * 90
        assert traffic.reordered == 0

    asyncio.run(test())
