"""Tests that nodes measure the CPU time of their callbacks."""

from __future__ import annotations

import time
from typing import Any

from volery.graph.graph import Graph
from volery.graph.messages import String
from volery.graph.nodes.node import Context, Node


class _NoTimers:
    def every(self, *_arguments: Any, **_options: Any) -> None:
        """Never ring."""

    def forget(self, *_arguments: Any) -> None:
        """Nothing rings."""

    def at(self, *_arguments: Any) -> None:
        """Never act."""


class Busy(Node):
    """Computes for as much CPU time as a message says, then sleeps as long."""

    def __init__(self, **options: Any) -> None:
        super().__init__("busy", **options)
        self.spent_s = 0.0
        self.create_subscription(String, "work", self._work)

    def _work(self, message: String) -> None:
        seconds = float(message.data)
        begun_s = time.thread_time()
        while time.thread_time() < begun_s + seconds:
            pass
        time.sleep(seconds)
        self.spent_s += time.thread_time() - begun_s


def test_work_counts_and_sleep_does_not() -> None:
    graph = Graph(lambda: 0)
    busy, idle = (
        Busy(context=Context(graph, _NoTimers(), lambda: 0), namespace=f"/{n}") for n in "ab"
    )
    delivered_s = 0.0
    for _ in range(3):
        graph.advertise("/a/work", String).publish(String("0.02"))
        before_s = time.thread_time()
        graph.deliver()
        delivered_s += time.thread_time() - before_s
    assert 0.06 <= busy.spent_s <= busy.busy_s <= delivered_s
    assert idle.busy_s == 0.0
    assert not busy.has_worker
