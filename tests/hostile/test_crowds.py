"""A crowd of clients delays others by short rounds, not by all of its frames."""

from __future__ import annotations

import asyncio
import json

import pytest
from live_graph import HandGraph, LiveGraph
from patient_websockets import connect

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.frame_limits import PausedTransport
from volery.bridges.rosbridge import fair_queue
from volery.bridges.rosbridge.fair_queue import CROWD, MESSAGES, REQUESTS, ROUND_S, FairQueue
from volery.bridges.rosbridge.protocol import RosbridgePeer, ServerContext
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.bridges.rosbridge.websocket_session import Bell, converse, post_to
from volery.graph import messages as m
from volery.graph.graph import Graph

CROWDED = 120
ROUNDS = 10_000
"""More rounds of a loop than anything here needs."""


class Crowd:
    """Clients of one queue that always have frames of one cost; counts their turns."""

    def __init__(self, count, weight=MESSAGES, cost_s=ROUND_S / 8):
        self.queue = FairQueue()
        self.turns = [0] * count
        self.tasks = [
            asyncio.create_task(self._work(number, weight, cost_s)) for number in range(count)
        ]

    async def _work(self, number, weight, cost_s):
        flow = self.queue.flow(weight)
        while True:
            await flow.begin()
            self.turns[number] += 1
            assert self.turns[number] < ROUNDS
            await flow.spend(cost_s)

    @property
    def total(self):
        return sum(self.turns)

    async def end(self):
        for task in self.tasks:
            task.cancel()
        await asyncio.gather(*self.tasks, return_exceptions=True)
        for _ in range(3):
            await asyncio.sleep(0)
        assert not self.queue.must_wait(REQUESTS)  # what was cancelled blocks no client


def in_loop(scene):
    async def run():
        crowds = []

        def crowd(*args, **options):
            crowds.append(Crowd(*args, **options))
            return crowds[-1]

        try:
            await scene(crowd)
        finally:
            for each in crowds:
                await each.end()

    asyncio.run(run())


async def rounds_until(condition):
    for _ in range(ROUNDS):
        if condition():
            return
        await asyncio.sleep(0)
    raise AssertionError("the condition does not hold")


@pytest.mark.parametrize("weight", [MESSAGES, REQUESTS])
def test_a_round_is_short_however_many_have_their_first_frame(weight, monkeypatch):
    monkeypatch.setattr(fair_queue, "BUSY_S", 1e9)

    async def scene(crowd):
        many, rounds = crowd(CROWDED, weight), []
        while min(many.turns) < 3 and len(rounds) < ROUNDS:
            before = many.total
            await asyncio.sleep(0)
            rounds.append(many.total - before)
        assert max(rounds) <= 9  # eight fill it; the ninth was before it was full
        assert (
            max(many.turns[1:]) - min(many.turns[1:]) <= 2
        )  # the first was alone in the first round

    in_loop(scene)


def test_a_request_goes_before_the_messages_of_a_crowd(monkeypatch):
    monkeypatch.setattr(fair_queue, "BUSY_S", 1e9)

    async def scene(crowd):
        many = crowd(CROWDED)
        await rounds_until(lambda: min(many.turns) > 3)
        client = many.queue.flow(REQUESTS)
        for _ in range(50):
            before = many.total
            await client.begin()
            await client.spend(ROUND_S / 8)
            assert many.total - before <= 3 * 9  # a few rounds, not a turn of each
            await rounds_until(lambda before=before: many.total > before + CROWDED)

    in_loop(scene)


def test_a_short_request_goes_before_the_large_ones_of_a_crowd():
    async def scene(crowd):
        queue, done = crowd(1, REQUESTS).queue, []

        async def send(name, cost_s):
            flow = queue.flow(REQUESTS)
            await flow.begin(cost_s)
            done.append(name)
            await flow.spend(cost_s)

        await rounds_until(lambda: queue.must_wait(REQUESTS))
        tasks = [asyncio.create_task(send("large", 2 * ROUND_S)) for _ in range(CROWDED)]
        await asyncio.sleep(0)
        tasks.append(asyncio.create_task(send("short", ROUND_S / 100)))
        await asyncio.gather(*tasks)
        assert done.index("short") <= 3
        assert len(done) == CROWDED + 1

    in_loop(scene)


def test_clients_with_equal_traffic_have_equal_shares_and_none_starves(monkeypatch):
    monkeypatch.setattr(fair_queue, "BUSY_S", 1e9)

    async def scene(crowd):
        many = crowd(CROWDED)
        many.tasks[7].cancel()  # while it waits
        await rounds_until(lambda: max(many.turns) > 40)
        others = [count for number, count in enumerate(many.turns) if number != 7]
        assert min(others) > 30
        assert many.turns[7] <= 1

    in_loop(scene)


def test_a_client_with_costly_frames_waits_until_others_had_as_much(monkeypatch):
    monkeypatch.setattr(fair_queue, "BUSY_S", 1e9)

    async def scene(crowd):
        many = crowd(CROWD)
        greedy, turns = many.queue.flow(MESSAGES), 0
        await rounds_until(lambda: min(many.turns) > 3)
        before = many.total
        for _ in range(4):
            await greedy.begin()
            turns += 1
            await greedy.spend(10 * ROUND_S)
        assert many.total - before > 3 * CROWD * 80 / 2
        assert turns == 4

    in_loop(scene)


def test_the_messages_of_a_crowd_pause_and_requests_do_not(monkeypatch):
    monkeypatch.setattr(fair_queue, "BUSY_S", 0.0)
    monkeypatch.setattr(fair_queue, "PAUSE_S", 1e9)

    async def scene(crowd):
        few = crowd(CROWD)
        await rounds_until(lambda: min(few.turns) > 10)  # not a crowd
        many = crowd(CROWD + 20)
        await rounds_until(lambda: many.queue._is_paused)
        stood = many.total
        for _ in range(100):
            await asyncio.sleep(0)
        assert many.total - stood <= 9  # those that had been granted
        stood = many.total
        client = many.queue.flow(REQUESTS)
        for _ in range(100):
            await client.begin()
            await client.spend(ROUND_S / 8)
        assert many.total == stood
        many.queue._end_pause()
        await rounds_until(lambda: many.total > stood)

    in_loop(scene)


# ------------------------------------------------------------------------------ less work


class Channel:
    """A WebSocket that notes what is sent together."""

    def __init__(self):
        self.sent = []

    async def recv(self):
        await asyncio.Event().wait()

    async def send_all(self, messages):
        self.sent.append([json.loads(message)["topic"] for message in messages])

    async def close(self, code=1000, reason=""):
        """Has nothing to close."""


def test_the_frames_that_wait_for_a_client_are_sent_together():
    topics = ["/a", "/b", "/c", "/d"]

    async def run():
        graph, channel, loop = HandGraph(), Channel(), asyncio.get_running_loop()
        bell = Bell(loop)
        peer = RosbridgePeer(
            graph.gateway.open("viewer"), ServerContext(), wake=bell.ring, post=post_to(loop)
        )
        publishers = [graph.graph.advertise(topic, "std_msgs/msg/String") for topic in topics]
        for topic in topics:
            peer.receive(json.dumps({"op": "subscribe", "topic": topic}), 0.0)
        task = asyncio.create_task(converse(channel, bell, peer, FairQueue()))
        await rounds_until(lambda: bell.received.is_set() is False)
        for publisher in publishers:
            publisher.publish(m.String("text"))
        graph.graph.deliver()
        await rounds_until(lambda: sum(map(len, channel.sent)) == len(topics))
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        assert channel.sent == [topics]

    asyncio.run(run())


def test_a_server_sends_them_with_one_call_of_the_system(monkeypatch):
    writes = []

    def write(transport, data):
        writes.append(data)
        transport._transport.write(data)

    monkeypatch.setattr(PausedTransport, "write", write, raising=False)
    live = LiveGraph()
    with BridgeHost(live.gateway) as bridges:
        server = RosbridgeServer(port=0)
        bridges.open(server)
        publisher = live.do(lambda: live.graph.advertise("/a", "std_msgs/msg/String", latched=True))
        live.do(lambda: publisher.publish(m.String("first")))
        with connect(f"ws://127.0.0.1:{server.port}") as client:
            client.send(json.dumps({"op": "subscribe", "topic": "/a", "queue_length": 10}))
            assert "first" in client.recv(60.0)
            writes.clear()

            def publish():
                for number in range(4):
                    publisher.publish(m.String(f"{number}"))

            live.do(publish)
            found = [json.loads(client.recv(60.0))["msg"]["data"] for _ in range(4)]
    live.close()
    assert found == ["0", "1", "2", "3"]
    frames = [data for data in writes if b'"/a"' in data]
    assert sum(data.count(b'"/a"') for data in frames) == 4
    assert len(frames) < 4


def test_a_call_does_not_list_all_services(monkeypatch):
    graph = HandGraph()
    graph.graph.create_service("/empty", "std_srvs/srv/Empty", lambda request: request)
    monkeypatch.setattr(Graph, "services", lambda _graph: pytest.fail("all are listed"))

    async def run():
        loop = asyncio.get_running_loop()
        bell = Bell(loop)
        session = graph.gateway.open("caller")
        peer = RosbridgePeer(session, ServerContext(), wake=bell.ring, post=post_to(loop))
        peer.receive(json.dumps({"op": "call_service", "service": "/empty", "args": {}}), 0.0)
        assert session.waiting == 1
        peer.receive(json.dumps({"op": "call_service", "service": "/none", "id": "1"}), 0.0)
        (response,) = peer.frames(0.0)
        assert "has no server" in response

    asyncio.run(run())
