"""Measures one-way latency to a rospy subscriber: from the simulation and from rospy, in turns."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import socket
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros1.bridge import Ros1Bridge
from volery.bridges.ros1.environment import rospy_is_installed
from volery.core.errors import VoleryError
from volery.graph.messages import Header, message_type, time_from_ns
from volery.runtime import Simulation

_SIZES = (0, 100_000, 1_000_000)
_COUNT = 100
_PERIOD_S = 0.01
_IMAGE = "sensor_msgs/msg/Image"
_SYSTEM_PYTHON = "/usr/bin/python3"
_PEER = Path(__file__).with_name("plain_rospy.py")
_START_TIMEOUT_S = 20.0


def one_way_figures(simulation: Simulation, bridges: BridgeHost) -> dict[str, float]:
    """Returns median ms by size and path, and the geometric mean of their ratios.

    `simulation` must be running. Raises `VoleryError` if ROS 1 is not installed.
    """
    if shutil.which("rosmaster") is None or not rospy_is_installed():
        raise VoleryError("ROS 1 is not installed; .ci/install_ros1 does it on Debian")
    with ros1_master(), _Program("subscribe") as subscriber, _Program("publish") as plain:
        bridges.open(Ros1Bridge(topics=("/one_way/*",)))
        _exchange(simulation, plain)
        taken = subscriber.ask()
    return _summarize(taken)


def _exchange(simulation: Simulation, plain: _Program) -> None:
    """Publishes images on both paths, in turns."""
    graph, image = simulation.graph, message_type(_IMAGE)
    topic = simulation.post(lambda: graph.advertise("/one_way/graph", _IMAGE)).result()

    def publish(data: Any) -> None:
        stamp = Header(time_from_ns(time.time_ns()), "")
        topic.publish(image(stamp, 1, len(data), "mono8", 0, len(data), data))

    _wait_until(lambda: any(t.name == topic.topic and t.subscribers for t in graph.topics()))
    time.sleep(1.0)
    for size in _SIZES:
        data = np.zeros(size, np.uint8)
        data.flags.writeable = False
        for _ in range(_COUNT):
            plain.send_line(str(size))
            time.sleep(_PERIOD_S)
            simulation.post(lambda data=data: publish(data))  # type: ignore[misc]
            time.sleep(_PERIOD_S)
    time.sleep(0.5)


def _summarize(taken: list[tuple[str, int, float]]) -> dict[str, float]:
    figures: dict[str, float] = {}
    ratios = []
    for size in _SIZES:
        plain, ours = (
            statistics.median(ms for path, s, ms in taken if path == name and s == size)
            for name in ("plain", "graph")
        )
        figures[f"rospy_ms_{size // 1000}_kb"], figures[f"ros1_ms_{size // 1000}_kb"] = plain, ours
        ratios.append(ours / plain)
    return {**figures, "ros1_one_way_ratio": statistics.geometric_mean(ratios)}


@contextlib.contextmanager
def ros1_master() -> Iterator[None]:
    """Runs a rosmaster on a free loopback port and sets the environment to it."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with tempfile.TemporaryDirectory() as folder:
        os.environ.update(
            ROS_MASTER_URI=f"http://127.0.0.1:{port}",
            ROS_IP="127.0.0.1",
            ROS_HOSTNAME="127.0.0.1",
            ROS_HOME=folder,
            ROS_LOG_DIR=folder,
        )
        command = ["rosmaster", "--core", "-p", str(port)]
        quiet = subprocess.DEVNULL
        process = subprocess.Popen(command, stdout=quiet, stderr=quiet)
        try:
            _wait_until(lambda: _answers(port))
            yield
        finally:
            process.terminate()
            process.wait(10.0)


class _Program:
    """Runs a plain rospy program; use it as a context manager."""

    def __init__(self, what: str) -> None:
        command = [_SYSTEM_PYTHON, str(_PEER), what]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)

    def send_line(self, line: str) -> None:
        """Sends a line."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()

    def ask(self) -> Any:
        """Requests and returns its report."""
        self.send_line("report")
        return self._next()

    def _next(self) -> Any:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with contextlib.suppress(ValueError):
                return json.loads(line)
        raise VoleryError("a plain rospy program ended early")

    def __enter__(self) -> _Program:
        self._next()
        return self

    def __exit__(self, *_exception: object) -> None:
        self._process.kill()  # rospy takes seconds to shut down cleanly
        self._process.communicate()


def _answers(port: int) -> bool:
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port)):
        return True
    return False


def _wait_until(condition: Any) -> None:
    end = time.monotonic() + _START_TIMEOUT_S
    while not condition():
        if time.monotonic() > end:
            raise VoleryError(f"ROS 1 is not ready within {_START_TIMEOUT_S:.0f} s")
        time.sleep(0.02)
