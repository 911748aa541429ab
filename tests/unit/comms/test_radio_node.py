"""A UAV's radio over the real communication server: the same topics as inside a run."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from volery.comms.server.settings import RouterSettings
from volery.comms.server.tcp import CommsServer
from volery.comms.station.radio_node import RadioNode
from volery.core.errors import GraphError
from volery.graph.graph import Graph
from volery.graph.messages import Published, String
from volery.graph.nodes.node import Context

TOPIC = "hello std_msgs/msg/String"


@pytest.fixture(name="port")
def _port() -> Iterator[int]:
    """A server in a thread of its own."""
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()

    async def start() -> CommsServer:
        server = CommsServer(RouterSettings(), port=0)
        await server.start()
        return server

    server = asyncio.run_coroutine_threadsafe(start(), loop).result(60.0)
    yield server.port
    asyncio.run_coroutine_threadsafe(server.stop(), loop).result(60.0)
    loop.call_soon_threadsafe(loop.stop)
    thread.join()
    loop.close()


class Aboard:
    """A graph of one UAV's own with its radio; `spin` is what its process would do all the time."""

    def __init__(self, name: str, port: int, **parameters: Any) -> None:
        self.graph = Graph(time.monotonic_ns)
        self.rings: list[Callable[[], None]] = []
        self.received: list[str] = []
        context = Context(self.graph, self, time.monotonic_ns)
        overrides = {"topics": [TOPIC], "server": f"127.0.0.1:{port}", **parameters}
        self.radio = RadioNode(context=context, namespace=f"/{name}", parameter_overrides=overrides)
        self.graph.subscribe(f"/{name}/radio/hello", self._receive)
        self._says = self.graph.advertise(f"/{name}/hello", String)

    def every(self, _period_s: float, callback: Callable[[], None], **_options: Any) -> None:
        self.rings.append(callback)

    def forget(self, callback: Callable[[], None]) -> None:
        self.rings.remove(callback)

    def at(self, _time_ns: int, _action: Callable[[], Any]) -> None:
        raise AssertionError

    def _receive(self, published: Published) -> None:
        self.received.append(published.message.data)

    def say(self, text: str) -> None:
        self._says.publish(String(text))
        self.spin()

    def spin(self) -> None:
        for ring in self.rings:
            ring()
        self.graph.deliver()


def until(true: Callable[[], bool], *spinning: Aboard) -> None:
    end = time.monotonic() + 60.0
    while not true():
        assert time.monotonic() < end
        for each in spinning:
            each.spin()
        time.sleep(0.005)


def test_topics_cross_the_server(port: int) -> None:
    one, two = Aboard("uav1", port), Aboard("uav2", port)
    until(lambda: one.radio.joined and two.radio.joined)
    for k in range(20):
        one.say(f"one {k}")
        two.say(f"two {k}")
    until(lambda: len(one.received) == len(two.received) == 20, one, two)
    assert two.received == [f"one {k}" for k in range(20)]
    assert one.received == [f"two {k}" for k in range(20)]
    two.radio.destroy_node()
    one.say("no subscriber")
    one.radio.destroy_node()


def test_messages_from_before_there_is_a_server_are_received_later(port: int) -> None:
    """No server answers at the first port; the station waits, and queues its messages."""
    early = Aboard("uav1", 1)
    early.say("early")
    assert not early.radio.joined
    early.radio.destroy_node()
    late = Aboard("uav3", port, station_id=2)
    until(lambda: late.radio.joined)
    late.radio.destroy_node()


def test_parameters_that_make_no_sense() -> None:
    with pytest.raises(GraphError, match="server must be HOST:PORT"):
        Aboard("uav1", 0, server="here")
    with pytest.raises(GraphError, match="not 'hello'"):
        Aboard("uav1", 0, topics=["hello"])
    with pytest.raises(GraphError, match="not 'hello no/msg/Type'"):
        Aboard("uav1", 0, topics=["hello no/msg/Type"])
