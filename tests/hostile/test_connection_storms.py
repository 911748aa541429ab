"""Connections that are opened and left alone, by the hundred: others are still served.

Servers run in a process of its own with few file descriptors, so that a storm is small.
"""

import contextlib
import json
import os
import socket
import subprocess
import sys
import textwrap
import time
import urllib.request
from pathlib import Path

import pytest

from volery.server.page_server import PageServer
from volery.server.settings import PageSettings

DESCRIPTORS = 256
"""Of the servers' process: soft limit, and hard limit."""
STORM = 400
TIMEOUT_S = 600.0
SERVERS = """
    import asyncio, json, os, resource, sys, threading
    resource.setrlimit(resource.RLIMIT_NOFILE, ({descriptors}, {descriptors}))
    from live_graph import LiveGraph
    from volery.bridges.bridge_host import BridgeHost
    from volery.bridges.ros_tcp.endpoint import RosTcpEndpoint
    from volery.bridges.rosbridge.server import RosbridgeServer
    from volery.bridges.sensor_link.server import SensorLink
    from volery.comms.server.tcp import CommsServer
    from volery.core.connection_limits import SHARED
    from volery.mavlink.links.tcp_bridge import MavlinkTcp
    from volery.server.page_server import PageServer
    from volery.server.settings import PageSettings

    live = LiveGraph()
    bridges = BridgeHost(live.gateway)
    made = {{
        "rosbridge": RosbridgeServer(port=0),
        "ros_tcp": RosTcpEndpoint(port=0),
        "sensor_link": SensorLink(port=0, image_port=0),
        "mavlink_tcp": MavlinkTcp(port=0),
    }}
    for bridge in made.values():
        bridges.open(bridge)
    comms = CommsServer(port=0)
    bridges.call(comms.start())
    with PageServer(PageSettings(port=0)) as page:
        page.building("hover", "A world that takes long to build.")
        ports = {{name: bridge.port for name, bridge in made.items()}}
        print(json.dumps(ports | {{"page": page.port, "comms": comms.port}}), flush=True)
        for line in sys.stdin:
            files = [open(os.devnull) for _ in range(32)]  # as a world that is built, a log
            for file in files:
                file.close()
            print(json.dumps({{"connections": SHARED.num_connections}}), flush=True)
    bridges.call(comms.stop())
    bridges.close()
    live.close()
"""


class Servers:
    """All servers in a process of their own."""

    def __init__(self, folder):
        self.errors = folder / "stderr.txt"
        program = textwrap.dedent(SERVERS).format(descriptors=DESCRIPTORS)
        tests = str(Path(__file__).resolve().parents[1])
        with self.errors.open("w") as errors:
            self._process = subprocess.Popen(
                [sys.executable, "-c", program],
                env=os.environ | {"PYTHONPATH": tests},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
            )
        self.ports = json.loads(self._process.stdout.readline())

    def look(self):
        """Have files opened there; how many connections it has."""
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())["connections"]

    def close(self):
        self._process.stdin.close()
        self._process.wait(TIMEOUT_S)
        self._process.stdout.close()

    @property
    def code(self):
        return self._process.returncode


@pytest.fixture
def servers(tmp_path):
    made = Servers(tmp_path)
    yield made
    made.close()
    assert made.code == 0


def status(port):
    with urllib.request.urlopen(
        f"http://127.0.0.1:{port}/api/status", timeout=TIMEOUT_S
    ) as response:
        return json.load(response)["state"]


def connect(port):
    return socket.create_connection(("127.0.0.1", port), TIMEOUT_S)


@contextlib.contextmanager
def storm(port, words=b""):
    """Many connections that say so much and no more."""
    idle = []
    try:
        for _ in range(STORM):
            idle.append(connect(port))
            with contextlib.suppress(OSError):
                idle[-1].sendall(words)
        yield idle
    finally:
        for sock in idle:
            sock.close()


NAMES = ("page", "rosbridge", "ros_tcp", "sensor_link", "mavlink_tcp", "comms")


@pytest.mark.parametrize("words", [b"", b"GET /api/status HTTP/1.1\r\nHost: 127"])
def test_half_open_connections_to_every_port_close_none_of_them(servers, words):
    with contextlib.ExitStack() as storms:
        for name in NAMES:
            storms.enter_context(storm(servers.ports[name], words))
        assert servers.look() < DESCRIPTORS  # it opens files meanwhile
        assert status(servers.ports["page"]) == "building"
        with connect(servers.ports["rosbridge"]) as client:
            client.sendall(
                b"GET / HTTP/1.1\r\nHost: localhost\r\n"
                b"Connection: Upgrade\r\nUpgrade: websocket\r\n"
                b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
            )
            assert client.recv(12) == b"HTTP/1.1 101"
        with connect(servers.ports["ros_tcp"]) as client:
            assert client.recv(4)  # the handshake
    end = time.monotonic() + TIMEOUT_S
    while servers.look() > 0 and time.monotonic() < end:
        time.sleep(0.05)
    assert servers.look() == 0
    lines = servers.errors.read_text().splitlines()
    assert not any("Traceback" in line for line in lines)
    assert 1 <= len(lines) < 50  # one for each port and reason
    assert any("connections" in line for line in lines)


def test_established_connections_are_limited_in_all(servers):
    request = b"GET /api/status HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 9\r\n\r\n"
    with storm(servers.ports["page"], request):
        assert servers.look() < DESCRIPTORS
    end = time.monotonic() + TIMEOUT_S
    while status(servers.ports["page"]) != "building" and time.monotonic() < end:
        time.sleep(0.05)
    assert "Traceback" not in servers.errors.read_text()


# -------------------------------------------------------------------- requests that do not end


@pytest.fixture
def page(tmp_path, monkeypatch):
    monkeypatch.setattr("volery.server.http_protocol.HEAD_TIMEOUT_S", 0.3)
    monkeypatch.setattr("volery.server.request_bodies.LONGEST_PAUSE_S", 0.3)
    with PageServer(PageSettings(port=0, uploads=tmp_path)) as server:
        yield server


def drip(sock, words=b"X-More: of it\r\n"):
    """Sends a little now and then until the server ends the connection; what it has sent."""
    sock.settimeout(0.02)
    received, end = b"", time.monotonic() + TIMEOUT_S
    with contextlib.suppress(ConnectionError):
        while time.monotonic() < end:
            sock.sendall(words)
            try:
                piece = sock.recv(4096)
            except TimeoutError:
                continue
            if not piece:
                return received
            received += piece
    assert time.monotonic() < end
    return received


HEAD = b"GET /api/status HTTP/1.1\r\nHost: localhost\r\n"


@pytest.mark.parametrize(
    ("words", "more", "responses"),
    [
        (HEAD, b"X-More: of it\r\n", 0),
        (HEAD + b"\r\n" + HEAD, b"X-More: of it\r\n", 1),  # the second of a connection
        (HEAD + b"Content-Length: 999999\r\n\r\n", b".", 1),  # a body that the server does not read
    ],
)
def test_a_request_that_does_not_come_whole_ends_the_connection(page, words, more, responses):
    with connect(page.port) as sock:
        sock.sendall(words)
        assert drip(sock, more).count(b"HTTP/1.1 200") == responses


def test_an_upload_that_stops_is_refused_and_leaves_nothing(page, tmp_path):
    with connect(page.port) as sock:
        sock.sendall(
            b"POST /api/uploads?kind=grid_map&name=map.csv HTTP/1.1\r\nHost: localhost\r\n"
            b"Content-Length: 1000000\r\n\r\n1,2,3\n"
        )
        assert b" 408 " in sock.recv(4096).splitlines()[0]
    assert list(tmp_path.iterdir()) == []


def test_an_upload_that_drips_is_refused(page):
    with connect(page.port) as sock:
        sock.sendall(
            b"POST /api/uploads?kind=grid_map&name=map.csv HTTP/1.1\r\nHost: localhost\r\n"
            b"Content-Length: 1000000\r\n\r\n1,2,3\n"
        )
        assert b" 408 " in drip(sock, b"1").splitlines()[0]
