"""A simulation with its page in a process of its own, and a client that reads its state."""

from __future__ import annotations

import json
import threading
import urllib.request
from contextlib import contextmanager

import roslibpy

from volery_benchmarks.page.serving import PageProcess

RESPONSE_TIMEOUT_S = 600.0


class Served(PageProcess):
    """`volery serve SCENARIO`, for as long as the test lasts; `ros` sees its graph.

    token: the operators', where one is demanded.
    """

    def __init__(self, scenario="hover", *options, port=0, token=None):
        shown = () if token is None else ("--token", token)
        super().__init__(scenario, "--seconds", "36000", *options, *shown, port=port)
        self._query = "" if token is None else f"?token={token}"
        self._ros = None

    @property
    def rosbridge(self):
        """A client of the graph, as an operator."""
        return super().rosbridge + self._query

    def fetch(self, path, query=None):
        """The response of an address below `./api/` to an operator, or to a client with `query`."""
        url = f"{self.url}api/{path}{self._query if query is None else query}"
        with urllib.request.urlopen(url, timeout=RESPONSE_TIMEOUT_S) as response:
            return response.read()

    def status(self):
        """What `./api/status` says."""
        return json.loads(self.fetch("status"))

    @property
    def ros(self):
        """An ordinary roslibpy client beside the page."""
        if self._ros is None or not self._ros.is_connected:
            self._ros = roslibpy.Ros(self.rosbridge)
            self._ros.run(timeout=RESPONSE_TIMEOUT_S)
        return self._ros

    def call(self, service, srvtype, request=None):
        """Answer of a service, as a dict."""
        client = roslibpy.Service(self.ros, service, srvtype)
        return dict(client.call(roslibpy.ServiceRequest(request or {}), timeout=RESPONSE_TIMEOUT_S))

    def once(self, topic, msgtype, fits=lambda _: True, timeout_s=RESPONSE_TIMEOUT_S):
        """The first message of a topic that fits."""
        arrived, fitting = threading.Event(), []

        def take(message):
            if not arrived.is_set() and fits(message):
                fitting.append(message)
                arrived.set()

        subscriber = roslibpy.Topic(self.ros, topic, msgtype)
        subscriber.subscribe(take)
        try:
            assert arrived.wait(timeout_s), f"nothing that fits came on {topic}"
        finally:
            subscriber.unsubscribe()
        return fitting[0]

    @contextmanager
    def collect(self, topic, msgtype):
        """List of the messages of a topic from before the block on: none is too late for it."""
        messages, began = [], threading.Event()

        def take(message):
            messages.append(message)
            began.set()

        subscriber = roslibpy.Topic(self.ros, topic, msgtype)
        subscriber.subscribe(take)
        try:
            assert began.wait(RESPONSE_TIMEOUT_S), f"nothing came on {topic}"
            yield messages
        finally:
            subscriber.unsubscribe()

    def stop(self):
        if self._ros is not None:
            self._ros.close()
            self._ros = None
        super().stop()
