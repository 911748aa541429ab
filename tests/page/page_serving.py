"""A simulation with its page in a process of its own, and a client that asks it what is true."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import threading
import time
import urllib.request
from collections import deque
from contextlib import suppress

import roslibpy

STARTING_S = 240.0
"""The first start compiles."""
ANSWER_S = 30.0
_URL = re.compile(r"http://127\.0\.0\.1:(\d+)/")


class Served:
    """`volery serve SCENARIO`; use as a context manager."""

    def __init__(self, scenario="hover", *options, port=0):
        self.scenario, self.options, self.port = scenario, options, port
        self.process = None
        self._ros = None
        self._tail = deque(maxlen=50)

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}/"

    @property
    def rosbridge(self):
        return f"ws://127.0.0.1:{self.port}/rosbridge"

    def start(self):
        command = [sys.executable, "-m", "volery.cli", "serve", self.scenario]
        self.process = subprocess.Popen(
            [*command, "--port", str(self.port), *self.options],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            text=True,
        )
        found = threading.Event()
        self._reader = threading.Thread(target=self._read, args=(found,), daemon=True)
        self._reader.start()
        if not found.wait(STARTING_S) or self.process.poll() is not None:
            raise AssertionError(f"the server did not start:\n{''.join(self._tail)}")
        self.wait_until_flying()

    def _read(self, found):
        for line in self.process.stdout:
            self._tail.append(line)
            address = _URL.search(line)
            if address and not found.is_set():
                self.port = int(address[1])
                found.set()
        found.set()

    def status(self):
        """What `./api/status` says."""

        with urllib.request.urlopen(f"{self.url}api/status", timeout=5.0) as answer:
            return json.load(answer)

    def wait_until_flying(self, timeout_s=STARTING_S):
        ends = time.monotonic() + timeout_s
        while time.monotonic() < ends:
            with suppress(OSError):
                told = self.status()
                if told["state"] == "flying":
                    return told
            time.sleep(0.05)
        raise AssertionError(f"no simulation is flying:\n{''.join(self._tail)}")

    @property
    def ros(self):
        """An ordinary roslibpy client beside the page."""
        if self._ros is None or not self._ros.is_connected:
            self._ros = roslibpy.Ros(self.rosbridge)
            self._ros.run(timeout=ANSWER_S)
        return self._ros

    def call(self, service, srvtype, request=None):
        """Answer of a service, as a dict."""
        client = roslibpy.Service(self.ros, service, srvtype)
        return dict(client.call(roslibpy.ServiceRequest(request or {}), timeout=ANSWER_S))

    def once(self, topic, msgtype, fits=lambda _: True, timeout_s=ANSWER_S):
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

    def stop(self):
        if self._ros is not None:
            self._ros.close()
            self._ros = None
        if self.process is None:
            return
        self.process.terminate()
        try:
            self.process.wait(20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait(20)
        self._reader.join(10)
        self.process.stdout.close()
        self.process = None

    def restart(self):
        """End the process and start it anew at the same port."""
        self.stop()
        self.start()

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.stop()
