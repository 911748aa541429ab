"""Graphs that stand in for a simulation's: one with a thread, one worked off by hand."""

from __future__ import annotations

import queue
import threading
import time
from concurrent.futures import Future

from volery.graph.graph import Graph
from volery.graph.session import Gateway

NOW_NS = 5


class LiveGraph:
    """Does what is posted in a thread of its own, and delivers, as a running simulation does.

    While `held` is set, that thread stands still.
    """

    scenario = geometry = operators = None
    waits_at_end = False

    def __init__(self, now_ns=lambda: NOW_NS):
        self.graph = Graph(now_ns, self.post)
        self.gateway = Gateway(self.graph, self.post)
        self.held = threading.Event()
        self._posted = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def post(self, action):
        future = Future()
        self._posted.put((action, future))
        return future

    def do(self, action):
        """Have something done, and what it publishes delivered; its result."""
        return self.post(action).result(180.0)

    def waiting(self):
        """How much has been posted and not been begun."""
        return self._posted.qsize()

    def close(self):
        self.held.clear()
        self._posted.put(None)
        self._thread.join()

    def _run(self):
        while (job := self._posted.get()) is not None:
            while self.held.is_set():
                time.sleep(0.001)
            action, future = job
            try:
                result = action()
                self.graph.deliver()
            except Exception as error:
                future.set_exception(error)
            else:
                future.set_result(result)


class HandGraph:
    """Does what is posted when `work_off` says so."""

    def __init__(self):
        self.graph = Graph(lambda: NOW_NS)
        self.gateway = Gateway(self.graph, self._post)
        self._posted = []

    def _post(self, action):
        future = Future()
        self._posted.append((action, future))
        return future

    def work_off(self):
        while self._posted:
            action, future = self._posted.pop(0)
            try:
                future.set_result(action())
            except Exception as error:
                future.set_exception(error)
        self.graph.deliver()
