"""Measures the ROS 2 bridge over DDS, with a subscriber in its own process."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from typing import Any

import numpy as np

from volery.bridges.ros2.bridge import Ros2Bridge
from volery.bridges.ros2.environment import Ros2Environment
from volery.core.errors import VoleryError
from volery.runtime import Simulation
from volery.scenario.load import load_scenario
from volery_benchmarks.bridge.latency_figures import fit_line
from volery_benchmarks.bridge.measuring import (
    IMAGE_TOPIC,
    IMAGES_A_SIZE,
    advertise_images,
    in_real_time,
    publish_images,
    stream_ages,
    stream_scenario,
)

_DOMAIN = 20 + os.getpid() % 80
_SIZES = (0, 10_000, 100_000, 250_000, 500_000, 1_000_000)
_STREAM_S = 10.0
_STOPPED_S = 5.0
_TIMEOUT_S = 20.0
_SETTLED_S = 1.0


def measure() -> dict[str, float]:
    """Returns the figures of the bench."""
    with in_real_time(load_scenario("hover")) as (simulation, bridges):
        bridges.open(_bridge())
        images, lost = _images(simulation)
    alpha, beta = fit_line(images)
    figures = {"alpha_s_per_mb": alpha, "beta_s": beta, "images_lost": float(lost)}
    for size in (0, 100_000, 1_000_000):
        took = [latency for length, latency in images if length == size]
        figures[f"one_way_ms_{size // 1000}_kb"] = 1e3 * float(np.median(took))
    return {**figures, **_streams()}


def _bridge() -> Ros2Bridge:
    return Ros2Bridge(Ros2Environment(domain_id=_DOMAIN))


class _Peer:
    """Runs a subscriber in its own process; it reports its messages at the end."""

    def __init__(self, kind: str, topics: list[str]) -> None:
        command = [
            sys.executable,
            "-P",
            "-m",
            "volery_benchmarks.ros2_peer",
            str(_DOMAIN),
            kind,
            *topics,
        ]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)

    def signal(self, number: int) -> None:
        """Stops or continues the process."""
        os.kill(self._process.pid, number)

    def finish(self) -> list[tuple[str, int, int, int]]:
        """Returns topic, size, stamp and arrival time (ns) of all received messages."""
        out, _ = self._process.communicate("\n", timeout=_TIMEOUT_S)
        return [(str(t), int(size), int(stamp), int(at)) for t, size, stamp, at in json.loads(out)]


def _images(simulation: Simulation) -> tuple[list[tuple[int, float]], int]:
    """Returns (bytes, s) of images from the simulation's thread, and how many were lost."""
    publisher = advertise_images(simulation)
    peer = _Peer("image", [IMAGE_TOPIC])
    _wait_for_subscribers(simulation, [IMAGE_TOPIC])
    publish_images(simulation, publisher, _SIZES)
    time.sleep(_SETTLED_S)
    came = [(size, 1e-9 * (at - stamp)) for _, size, stamp, at in peer.finish()]
    return came, IMAGES_A_SIZE * len(_SIZES) - len(came)


def _streams() -> dict[str, float]:
    """Streams scans of ten UAVs to one subscriber; then to another one that is stopped."""
    with in_real_time(stream_scenario()) as (simulation, bridges):
        bridges.open(_bridge())
        topics = [
            f"/{uav}/laser/{name}/scan"
            for uav in simulation.vehicles.names
            for name in ("horizontal", "nodding")
        ]
        published: dict[tuple[str, int], int] = {}

        def note(message: Any) -> None:
            stamp = message.message.header.stamp
            published[message.topic, stamp.sec * 10**9 + stamp.nanosec] = time.monotonic_ns()

        for topic in topics:
            simulation.post(lambda t=topic: simulation.graph.subscribe(t, note)).result()  # type: ignore[misc]
        peer = _Peer("scan", topics)
        _wait_for_subscribers(simulation, topics, min_count=2)
        factor = _real_time_factor(simulation, _STREAM_S)
        got = [(topic, stamp, at) for topic, _, stamp, at in peer.finish()]
        figures = {**stream_ages([got], dict(published)), "stream_real_time_factor": factor}
        stopped = _Peer("scan", topics)
        _wait_for_subscribers(simulation, topics, min_count=2)
        stopped.signal(signal.SIGSTOP)
        figures["stopped_real_time_factor"] = _real_time_factor(simulation, _STOPPED_S)
        stopped.signal(signal.SIGCONT)
        stopped.finish()
    return figures


def _real_time_factor(simulation: Simulation, wall_s: float) -> float:
    before_s, began_s = simulation.time_s, time.perf_counter()
    time.sleep(wall_s)
    return (simulation.time_s - before_s) / (time.perf_counter() - began_s)


def _wait_for_subscribers(simulation: Simulation, topics: list[str], min_count: int = 1) -> None:
    """Waits until each topic has `min_count` subscribers, and then for DDS to match both sides."""
    end = time.monotonic() + _TIMEOUT_S
    wanted = set(topics)
    while wanted - {t.name for t in simulation.graph.topics() if t.subscribers >= min_count}:
        if time.monotonic() > end:
            raise VoleryError(f"no subscriber within {_TIMEOUT_S:.0f} s")
        time.sleep(0.02)
    time.sleep(_SETTLED_S)
