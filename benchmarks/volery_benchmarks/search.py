"""Measures the duration of a UAV's call to another UAV, over each transport.

The called node is that of a cooperative search, which continues meanwhile: images, odometry and
commands use the same transport. One way is from the call in the caller's process to its handler in
the other process, by the computer's monotonic clock, which both share.
"""

from __future__ import annotations

import contextlib
import json
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from volery.autonomy.search.calls import JOIN
from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros1.bridge import Ros1Bridge
from volery.bridges.ros1.environment import rospy_is_installed
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.core.errors import VoleryError
from volery.graph.nodes.node import Context
from volery.runtime import Simulation
from volery.scenario.load import parse_scenario
from volery_benchmarks.bridge.native_ros1 import ros1_master
from volery_benchmarks.registry import Measured
from volery_benchmarks.search_peer import CALLED, CALLING, Called, Calling

_CALLS = 200
_WARM_UP = 20
_START_S = 15.0
"""Time, s, after which the called UAV searches and processes its images."""
_TIMEOUT_S = 120.0


def measure() -> Measured:
    """Returns medians and 95th percentiles, ms; `lock_step`: one process, in wall time."""
    figures = _lock_step_figures()
    failures: dict[str, str] = {}
    bridge = RosbridgeServer(port=0)
    with flying() as bridges:
        bridges.open(bridge)
        figures.update(call_figures("rosbridge", exchange("rosbridge", bridge.port)))
    try:
        figures.update(_ros1_figures())
    except VoleryError as error:
        failures["ros1_one_way_ms"] = str(error)
    return Measured(figures, failures)


def _ros1_figures() -> dict[str, float]:
    """Returns the figures over a roscore. Raises `VoleryError` without ROS 1."""
    if shutil.which("rosmaster") is None or not rospy_is_installed():
        raise VoleryError("ROS 1 is not installed; .ci/install_ros1 does it on Debian")
    with ros1_master(), flying() as bridges:
        bridges.open(Ros1Bridge())
        return call_figures("ros1", exchange("ros1", 0))


def _lock_step_figures() -> dict[str, float]:
    with Simulation(_scenario()) as simulation:
        context = Context(simulation.graph, _NoTimers(), simulation.graph.now_ns)
        team = {"team": [CALLING, CALLED]}
        Called(context=context, namespace=f"/{CALLED}", parameter_overrides=team)
        node = Calling(context=context, namespace=f"/{CALLING}")
        for _ in range(_WARM_UP + _CALLS):
            node.call()
    return call_figures("lock_step", node.took)


class _NoTimers:
    """Provides no timers, for nodes that are only called."""

    def every(self, *_arguments: Any, **_keywords: Any) -> None:
        """Never fires."""

    def forget(self, callback: Callable[[], None]) -> None:
        """Does nothing."""

    def at(self, time_ns: int, action: Callable[[], Any]) -> None:
        """Never calls `action`."""


def call_figures(name: str, took: Sequence[Sequence[int]]) -> dict[str, float]:
    """Returns figures of (one way, round trip), ns, without the warm-up calls."""
    found: dict[str, float] = {}
    milliseconds = 1e-6 * np.array(took[_WARM_UP:])
    for what, values in zip(("one_way", "round_trip"), milliseconds.T, strict=True):
        found[f"{name}_{what}_ms"] = float(np.median(values))
        found[f"{name}_{what}_p95_ms"] = float(np.percentile(values, 95))
    return found


def _scenario() -> Any:
    """Returns two UAVs with the cameras of the scenario `cooperative_search`."""
    camera = {
        "kind": "camera",
        "name": "down",
        "model": "f450_down",
        "rpy_deg": [0.0, 90.0, 0.0],
        "rate_hz": 5.0,
        "width": 320,
        "height": 240,
        "compressed": "none",
    }
    return parse_scenario(
        {
            "name": "calls",
            "duration_s": 1e6,
            "types": {"searcher": {"sensors": [camera, {"kind": "odometry", "noise": False}]}},
            "uavs": [
                {
                    "type": "searcher",
                    "count": 2,
                    "position_m": [10.0, 10.0],
                    "last_position_m": [10.0, 20.0],
                }
            ],
        }
    )


@contextlib.contextmanager
def flying() -> Iterator[BridgeHost]:
    """Runs two UAVs in real time until the block ends; yields the simulation's bridges."""
    with Simulation(_scenario()) as simulation:
        simulation.step(1)
        with BridgeHost(simulation.gateway) as bridges:
            simulation.gateway.use_low_latency()
            over = threading.Event()

            def run() -> None:
                while not over.is_set():
                    simulation.run(0.5, speed=1.0)

            thread = threading.Thread(target=run)
            thread.start()
            try:
                yield bridges
            finally:
                over.set()
                thread.join()


def exchange(via: str, port: int) -> list[list[int]]:
    """Returns (one way, round trip), ns, of each call between two processes."""
    with _peer(via, port, "called") as called:
        if not called.stdout or "ready" not in called.stdout.readline():
            raise VoleryError(f"the called node ended early on {via}")
        time.sleep(_START_S)
        with _peer(via, port, "calling") as calling:
            out, _ = calling.communicate(timeout=_TIMEOUT_S)
    result = json.loads(out.splitlines()[-1]) if out else {"took": [], "problem": "it ended early"}
    if len(result["took"]) < _WARM_UP + _CALLS:
        raise VoleryError(f"the calls of {JOIN} on {via} failed: {result['problem']}")
    return [[int(ns) for ns in pair] for pair in result["took"]]


@contextlib.contextmanager
def _peer(via: str, port: int, what: str) -> Iterator[subprocess.Popen[str]]:
    words = [via, str(port), what, str(_WARM_UP + _CALLS)]
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "volery_benchmarks.search_peer", *words],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        if process.stdin is not None:
            process.stdin.close()
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(10.0)
        if process.stdout is not None:
            process.stdout.close()
