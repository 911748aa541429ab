"""Clients that exceed their CPU budget are not read until it has recovered."""

from __future__ import annotations

import asyncio
import json
import socket

import pytest
from live_graph import HandGraph
from ros_tcp_client import frame

from volery.bridges.ros_tcp.connection import RosTcpConnection
from volery.bridges.ros_tcp.wire import RosTcpFrameParser
from volery.bridges.rosbridge.fair_queue import FairQueue
from volery.bridges.rosbridge.protocol import RosbridgePeer, ServerContext
from volery.bridges.rosbridge.websocket_session import Bell, converse, post_to
from volery.core.errors import GraphError
from volery.engine.pacing import Pacer
from volery.graph import read_budget
from volery.graph import session as graph_session
from volery.graph.messages import header, message_type
from volery.graph.read_budget import (
    BUSY_FRACTION,
    CREDIT_S,
    MAX_DEBT_S,
    MAX_FRACTION,
    MAX_WAITING,
    ReadBudgets,
    ReadScope,
)

PUBLISH = json.dumps({"op": "publish", "topic": "/cmd", "msg": {}})


class Shares:
    """Budgets on a clock that tests turn."""

    def __init__(self):
        self.now_s = 0.0
        self.busy = False
        self.budgets = ReadBudgets(lambda: self.busy, lambda: self.now_s)

    def taken(self, seconds, clients, cost_s=0.001):
        """CPU time that greedy clients got in so many seconds."""
        spent = dict.fromkeys(clients, 0.0)
        for _ in range(round(seconds / 0.001)):
            self.now_s += 0.001
            for client in clients:
                if not client.pause_s():
                    client.charge(cost_s)
                    spent[client] += cost_s
        return list(spent.values())


@pytest.mark.parametrize("busy", [False, True])
def test_a_greedy_client_gets_a_fraction(busy):
    shares = Shares()
    shares.busy = busy
    (spent,) = shares.taken(20.0, [shares.budgets.open()])
    fraction = BUSY_FRACTION if busy else MAX_FRACTION
    assert spent == pytest.approx(20.0 * fraction + CREDIT_S, abs=0.01)


def test_greedy_clients_share_and_modest_ones_never_wait():
    shares = Shares()
    shares.busy = True
    greedy = [shares.budgets.open() for _ in range(4)]
    modest = shares.budgets.open()
    shares.taken(1.0, greedy)
    for _ in range(100):
        modest.charge(0.0001)
        shares.taken(0.02, greedy)
        assert modest.pause_s() == 0.0
    spent = shares.taken(20.0, greedy)
    assert sum(spent) < 20.0 * BUSY_FRACTION + 4 * CREDIT_S
    assert max(spent) < 2.0 * min(spent)
    for client in greedy[1:]:
        client.close()
    (alone,) = shares.taken(20.0, greedy[:1])
    assert alone > 3.0 * max(spent)


def test_one_costly_message_is_paid_for_within_seconds():
    shares = Shares()
    shares.busy = True
    client = shares.budgets.open()
    client.charge(60.0)
    waited_s = 0.0
    while pause_s := client.pause_s():
        waited_s += pause_s
        shares.now_s += pause_s
    assert waited_s == pytest.approx(MAX_DEBT_S / BUSY_FRACTION)


def test_a_run_is_behind_when_it_is_late():
    pacer = Pacer()
    pacer.begin(1.0, 0)
    assert not pacer.is_behind
    pacer.jumped(0)
    pacer._wall_start -= 1.0
    assert pacer.is_behind
    pacer.pause()
    assert not pacer.is_behind
    pacer.resume()
    pacer.set_speed(None)
    assert pacer.is_behind


class Flood:
    """A channel whose client sends without a pause; `read` counts what was read of it."""

    def __init__(self, max_reads):
        self.read = 0
        self._max_reads = max_reads

    async def recv(self):
        await asyncio.sleep(0)
        if self.read >= self._max_reads:
            raise ConnectionResetError
        self.read += 1
        return PUBLISH

    async def send_all(self, messages):
        pass

    async def close(self, code=1000, reason=""):
        pass


def advertised():
    """A graph that no loop processes, with a topic."""
    graph = HandGraph()
    graph.graph.advertise("/cmd", "geometry_msgs/msg/Twist")
    return graph


def test_rosbridge_reads_on_when_the_simulation_has_taken_enough(monkeypatch):
    monkeypatch.setattr(read_budget, "CREDIT_S", 1e9)
    graph, flood = advertised(), Flood(3 * MAX_WAITING)

    async def serve():
        loop = asyncio.get_running_loop()
        bell, session = Bell(loop), graph.gateway.open("flood")
        peer = RosbridgePeer(session, ServerContext(), wake=bell.ring, post=post_to(loop))
        talk = asyncio.create_task(converse(flood, bell, peer, FairQueue()))
        while flood.read <= MAX_WAITING - 2:
            await asyncio.sleep(0.001)
        for _ in range(50):
            await asyncio.sleep(0.001)
            assert session.waiting <= MAX_WAITING + 1
        assert flood.read <= MAX_WAITING + 1
        while not talk.done():
            graph.work_off()
            await asyncio.sleep(0.001)

    asyncio.run(asyncio.wait_for(serve(), 60.0))
    assert flood.read == 3 * MAX_WAITING


def test_rosbridge_reads_no_more_of_a_client_over_its_share(monkeypatch):
    monkeypatch.setattr(read_budget, "FRAME_S", 1.0)  # one message is far too much
    graph, flood = advertised(), Flood(100)

    async def serve():
        loop = asyncio.get_running_loop()
        bell = Bell(loop)
        peer = RosbridgePeer(
            graph.gateway.open("flood"), ServerContext(), wake=bell.ring, post=post_to(loop)
        )
        talk = asyncio.create_task(converse(flood, bell, peer, FairQueue()))
        for _ in range(50):
            await asyncio.sleep(0.001)
        talk.cancel()
        await asyncio.gather(talk, return_exceptions=True)

    asyncio.run(asyncio.wait_for(serve(), 60.0))
    assert flood.read < 5


class Outbox:
    crowded = False

    def gather(self):
        return []


def test_ros_tcp_reads_no_more_until_time_has_paid():
    shares = Shares()
    shares.busy = True
    budget = shares.budgets.open()
    reading = ReadScope(budget, lambda: 0)
    taken = []

    async def serve():
        listener = socket.create_server(("127.0.0.1", 0))
        theirs = socket.create_connection(listener.getsockname())
        ours, _ = listener.accept()
        listener.close()
        pipe = RosTcpConnection(
            ours,
            RosTcpFrameParser(),
            Outbox(),
            taken.append,
            taken.append,
            lambda _: None,
            throttle=reading,
        )
        budget.charge(1.0)
        theirs.setblocking(False)
        message, sent = frame("/a", bytes(1000)), 0
        for _ in range(100):
            try:
                sent += theirs.send(message)
            except BlockingIOError:
                break
            await asyncio.sleep(0.001)
        assert len(taken) <= 3  # what was read before it was found too much
        shares.now_s += 100.0
        while len(taken) < sent // len(message):
            shares.now_s += 1.0
            await asyncio.sleep(0.005)
        pipe.close("over")
        theirs.close()

    asyncio.run(asyncio.wait_for(serve(), 60.0))


def test_what_a_client_latches_is_bounded(monkeypatch):
    monkeypatch.setattr(graph_session, "MAX_LATCHED_BYTES", 4 * 2**20)
    graph = HandGraph()
    session = graph.gateway.open("client")
    text, several = (
        message_type("std_msgs/msg/String"),
        message_type("diagnostic_msgs/msg/DiagnosticArray"),
    )
    status = message_type("diagnostic_msgs/msg/DiagnosticStatus")
    for k in range(10):
        session.advertise(f"/kept{k}", "std_msgs/msg/String", latched=True)
    session.advertise("/nested", several.__msgtype__, latched=True)
    session.advertise("/passing", "std_msgs/msg/String")
    for k in range(3):
        for _ in range(3):  # the newest alone is kept
            session.publish(f"/kept{k}", text("A" * 2**20))
    session.publish("/passing", text("A" * 2**24))
    with pytest.raises(GraphError, match="latched messages of client would exceed 4 MiB"):
        session.publish("/kept4", text("A" * 2**20))
    hidden = status(b"0", "A" * 2**20, "", "", [])
    with pytest.raises(GraphError, match="unadvertise"):
        session.publish("/nested", several(header(0, ""), [hidden]))
    session.unadvertise("/kept0")
    session.publish("/kept4", text("A" * 2**20))
