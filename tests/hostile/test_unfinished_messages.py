"""Unfinished messages of all clients together have one account, in equal parts when it is full."""

from __future__ import annotations

import asyncio
import json
import socket
import struct
import sys
import time
import weakref
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest
from live_graph import HandGraph, LiveGraph
from patient_websockets import connect
from websockets.frames import Opcode

from volery.bridges import unfinished
from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros_tcp.endpoint import RosTcpEndpoint
from volery.bridges.rosbridge.fair_queue import ROUND_S, FairQueue
from volery.bridges.rosbridge.fragments import Assembly
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.bridges.rosbridge.websocket_session import Bell, converse
from volery.bridges.unfinished import SHARED, UnfinishedMessages
from volery.core.errors import BridgeError
from volery.graph.read_budget import BYTE_S
from volery.runtime.idle_server import IdleServer

sys.path.append(str(Path(__file__).parents[1] / "unit" / "server"))
from page_bench import serving

MB = 1 << 20
PIECE = 1 << 18
"""What a connection may have read beyond its part before it is paused."""
LONGEST_S = 120.0


class Reservation:
    """A share that records its callbacks."""

    def __init__(self, account):
        self.calls = []
        self.share = account.open(
            lambda: self.calls.append("evict"), lambda: self.calls.append("resume")
        )

    def hold(self, megabytes, *, may_wait=True):
        return self.share.hold(round(megabytes * MB), may_wait=may_wait)


@pytest.fixture
def account():
    return UnfinishedMessages(10 * MB)


def test_a_lone_client_has_all(account):
    alone = Reservation(account)
    assert alone.hold(10)
    assert not alone.hold(10.1)
    alone.share.close()
    assert account.num_bytes == 0


def test_a_client_below_its_part_gets_room_of_the_oldest_above_its_part(account):
    old, new, small = Reservation(account), Reservation(account), Reservation(account)
    assert old.hold(5)
    assert new.hold(5)
    assert small.hold(1)
    assert (old.calls, new.calls) == (["evict"], [])
    assert account.num_bytes == 6 * MB


def test_a_client_above_its_part_waits_for_room(account):
    greedy = [Reservation(account) for _ in range(5)]
    for reservation in greedy:
        assert reservation.hold(2)
    assert not greedy[0].hold(2.1)
    assert not greedy[1].hold(2.1)
    assert [reservation.calls for reservation in greedy] == [[]] * 5
    greedy[4].share.close()
    assert [reservation.calls for reservation in greedy] == [["resume"], ["resume"], [], [], []]


@pytest.mark.parametrize("left", [0, 1])
def test_a_client_that_waits_below_its_part_is_read_again(account, left):
    """The others do not move: it would wait until it is ended, also if its client has left."""
    greedy = [Reservation(account) for _ in range(5)]
    for reservation in greedy:
        assert reservation.hold(2)
    for reservation in greedy:
        assert not reservation.hold(2.1)
    assert greedy[0].hold(left)  # the application has taken a message
    assert greedy[0].calls == ["resume"]
    assert greedy[0].hold(2)


def test_a_client_that_cannot_wait_is_refused_and_holds_what_it_had(account):
    one, other = Reservation(account), Reservation(account)
    assert one.hold(5)
    assert other.hold(5)
    assert not other.hold(6, may_wait=False)
    assert account.num_bytes == 10 * MB
    one.share.close()
    assert other.hold(6, may_wait=False)


def test_short_messages_count_as_none(account):
    one = Reservation(account)
    assert one.share.hold(100)
    assert account.num_bytes == 0


def fragment(name, data, number=0):
    return {"op": "fragment", "id": name, "data": data, "num": number, "total": 3}


def test_fragments_count_with_what_their_texts_need(account):
    """Four bytes a character, as Python stores them."""
    assembly = Assembly(16 * MB, account=account)
    assembly.add(fragment("a", "\N{ROCKET}" * MB), 0.0)
    assert account.num_bytes > 4 * MB
    assembly.add(fragment("a", "\N{ROCKET}" * MB, 1), 0.0)
    with pytest.raises(BridgeError, match="no room"):
        assembly.add(fragment("b", "\N{ROCKET}" * MB), 0.0)
    assert assembly.due_s() == unfinished.MAX_UNFINISHED_S
    assembly.drop_old(assembly.due_s() + 0.1)
    assert account.num_bytes == 0
    assert assembly.due_s() is None


def test_fragments_make_room(account):
    dropped = []
    greedy = Assembly(16 * MB, lambda: dropped.append(greedy.drop_all()), account)
    greedy.add(fragment("a", "x" * (9 * MB)), 0.0)
    modest = Assembly(16 * MB, account=account)
    modest.add(fragment("a", "x" * (2 * MB)), 0.0)
    assert dropped == [True]
    assert greedy.waiting == 0
    assert account.num_bytes < 3 * MB


# ------------------------------------------------------------------------------------ sockets


@pytest.fixture
def small_account(monkeypatch):
    monkeypatch.setattr(SHARED, "_max_bytes", 8 * MB)
    yield SHARED
    until(lambda: SHARED.num_bytes == 0)


@pytest.fixture(params=["page", "rosbridge", "ros-tcp"])
def server(request):
    if request.param == "page":
        with serving(IdleServer(lambda _: None)) as page:
            yield page
        return
    live = LiveGraph()
    server = RosTcpEndpoint(port=0) if request.param == "ros-tcp" else RosbridgeServer(port=0)
    with BridgeHost(live.gateway) as bridges:
        bridges.open(server)
        yield server
    live.close()


def until(condition):
    ends = time.monotonic() + LONGEST_S
    while not condition():
        assert time.monotonic() < ends
        time.sleep(0.01)


def begin(server, size):
    """A connection that has announced a message of so many bytes."""
    client = socket.create_connection(("127.0.0.1", server.port), 60.0)
    if isinstance(server, RosTcpEndpoint):
        client.sendall(struct.pack("<I", 2) + b"/x" + struct.pack("<I", size))
        return client
    client.sendall(
        f"GET /rosbridge HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
        "Sec-WebSocket-Version: 13\r\n\r\n".encode()
    )
    response = b""
    while b"\r\n\r\n" not in response:
        response += client.recv(1)
    client.sendall(bytes([0x80 | Opcode.TEXT, 0xFF]) + struct.pack(">Q", size) + bytes(4))
    return client


def push(client, size):
    """Sends as much as the server takes within a moment."""
    client.settimeout(0.2)
    rest = memoryview(bytes(size))
    with suppress(OSError):
        while rest:
            rest = rest[client.send(rest) :]


def serves(server):
    if isinstance(server, RosTcpEndpoint):
        with socket.create_connection(("127.0.0.1", server.port), 60.0) as client:
            body = json.dumps({}).encode()
            name = b"__topic_list"
            lengths = struct.pack("<I", len(name)), struct.pack("<I", len(body))
            client.sendall(b"".join((lengths[0], name, lengths[1], body)))
            return bool(client.recv(1))
    with connect(f"ws://127.0.0.1:{server.port}/rosbridge") as client:
        client.send('{"op": "call_service", "service": "/nobody", "id": "1"}')
        return "nobody" in client.recv(60.0)


def test_many_clients_share_one_account(server, small_account):
    with ExitStack() as clients:
        for _ in range(12):
            client = clients.enter_context(begin(server, 9 * MB))
            push(client, 3 * MB)
            assert small_account.num_bytes < 8 * MB + 12 * PIECE
        until(lambda: small_account.num_bytes > 4 * MB)
        assert serves(server)
    until(lambda: small_account.num_bytes == 0)


@pytest.mark.parametrize("event", ["room", "end"])
def test_a_crowd_that_may_go_on_at_once_is_read_in_turns(event):
    """A few clients in each round of the loop, also those that were ended."""
    account = UnfinishedMessages(100 * MB)
    num = 3 * unfinished._FEW

    async def scene():
        loop, read = asyncio.get_running_loop(), []
        crowd = [Reservation(account) for _ in range(num)]
        for reservation in crowd:
            reservation.hold(1)
        arriving = [
            unfinished.ArrivingMessages(
                loop, lambda _: None, lambda: None, lambda k=k: read.append(k), account
            )
            for k in range(num)
        ]
        for each in arriving:
            if event == "room":
                each._room()
            else:
                each._end_once("no room")
                each.note(0)
        assert not read
        rounds = 0
        while len(read) < num:
            before = len(read)
            await asyncio.sleep(0)
            assert len(read) - before <= unfinished._READS_A_ROUND
            rounds += 1
        assert read == list(range(num))
        assert rounds >= num // unfinished._READS_A_ROUND

    asyncio.run(asyncio.wait_for(scene(), LONGEST_S))


def test_many_clients_are_read_in_turns(server, small_account):
    """Each of them gets what it sends to the server, and others are answered meanwhile."""
    with ExitStack() as clients:
        crowd = [clients.enter_context(begin(server, MB // 4)) for _ in range(24)]
        for client in crowd:
            push(client, MB // 4 - 10)
        until(lambda: small_account.num_bytes > 5 * MB)
        assert small_account.is_crowded
        assert serves(server)
        for client in crowd:
            client.settimeout(60.0)
            client.sendall(bytes(10))
        until(lambda: small_account.num_bytes == 0)
        assert serves(server)


def test_a_lone_client_sends_its_large_message(server, small_account):
    with begin(server, 7 * MB) as alone:
        push(alone, 7 * MB - 10)
        until(lambda: small_account.num_bytes > 6 * MB)
        alone.settimeout(60.0)
        alone.sendall(bytes(10))
        until(lambda: small_account.num_bytes == 0)
        assert serves(server)


def test_messages_that_do_not_end_are_ended(server, monkeypatch, small_account):
    monkeypatch.setattr(unfinished, "MAX_UNFINISHED_S", 0.3)
    with begin(server, MB) as slow:
        push(slow, MB // 2)
        slow.settimeout(LONGEST_S)
        with suppress(ConnectionError):
            while slow.recv(4096):
                pass
        until(lambda: small_account.num_bytes == 0)
    assert serves(server)


# ------------------------------------------------------------------------- whole messages


class Text(str):
    """A text to which weak references are possible."""

    __slots__ = ("__weakref__",)


class Channel:
    """A WebSocket of which messages are taken one by one."""

    def __init__(self):
        self.messages = asyncio.Queue()
        self.taken = 0

    async def recv(self):
        message = await self.messages.get()
        self.taken += 1
        return message

    async def send_all(self, messages):
        """Sends nothing."""

    async def close(self, code=1000, reason=""):
        """Ends nothing."""


class Peer:
    """Counts what it receives in each round of the loop."""

    authorized, congested, refused, has_answers = True, False, None, False

    def __init__(self, gateway):
        session = gateway.open("peer")
        self.reading, self.writing = session.reading, session.writing
        self.close = session.close
        self.received = 0

    def receive(self, frame, now_s):
        self.received += 1

    def frames(self, now_s):
        return iter(())

    def due_s(self, now_s):
        return None


def serve_each(scene, count):
    """Run `scene(channels, peers)` while the channels are served in one loop."""

    async def run():
        gateway = HandGraph().gateway
        channels = [Channel() for _ in range(count)]
        peers = [Peer(gateway) for _ in range(count)]
        loop, queue = asyncio.get_running_loop(), FairQueue()
        tasks = [
            asyncio.create_task(converse(channel, Bell(loop), peer, queue))
            for channel, peer in zip(channels, peers, strict=True)
        ]
        await scene(channels, peers)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    asyncio.run(run())


async def rounds_until(condition):
    for _ in range(100_000):
        if condition():
            return
        await asyncio.sleep(0)
    raise AssertionError("the condition does not hold")


def test_a_processed_message_is_freed_while_the_next_does_not_come():
    async def scene(channels, peers):
        message = Text("x" * MB)
        alive = weakref.ref(message)
        channels[0].messages.put_nowait(message)
        del message
        await rounds_until(lambda: peers[0].received == 1)
        await rounds_until(lambda: alive() is None)

    serve_each(scene, 1)


def test_large_messages_of_many_are_processed_one_in_each_round():
    large = "x" * round(1.5 * ROUND_S / BYTE_S)

    async def scene(channels, peers):
        await asyncio.sleep(0)
        for channel in channels:
            channel.messages.put_nowait(large)
        await rounds_until(lambda: all(channel.taken for channel in channels))
        steps = []
        while sum(peer.received for peer in peers) < len(peers):
            before = sum(peer.received for peer in peers)
            await asyncio.sleep(0)
            steps.append(sum(peer.received for peer in peers) - before)
        assert max(steps) == 1

    serve_each(scene, 20)
