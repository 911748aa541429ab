"""Measures the cost of pages and other clients for the simulation."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from typing import Any

from websockets.sync.client import connect

from volery_benchmarks.page.serving import PageProcess
from volery_benchmarks.page.streams import subscription

_STALL_S = 30.0
_CLIENTS = 9
_CLIENTS_S = 10.0
_STATUS = "/volery/status"


def stall_figures(server: PageProcess, topics: list[str]) -> dict[str, float]:
    """Returns real-time factor and memory while a client of `topics` has stopped reading."""
    free, before = real_time_factor(server, _STALL_S / 3)
    with connect(server.rosbridge, max_size=None, close_timeout=1.0) as stalled:
        for topic in topics:
            stalled.send(subscription(topic))
        stalled.recv()  # the last read: what follows fills the buffers
        held, after = real_time_factor(server, _STALL_S)
    return {
        "real_time_factor": free,
        "stalled_client_rtf_loss": max(0.0, 1.0 - held / free),
        "stalled_client_memory_mb": max(0.0, after - before),
    }


def clients_figures(server: PageProcess, topics: list[str]) -> dict[str, float]:
    """Returns the losses of nine clients that read all `topics`, and the real-time factor."""
    module = "volery_benchmarks.page.clients"
    words = [server.rosbridge, str(_CLIENTS), str(_CLIENTS_S), *topics]
    command = [sys.executable, "-P", "-m", module, *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as clients:
        assert clients.stdout is not None
        clients.stdout.readline()  # all clients are connected
        factor, _ = real_time_factor(server, _CLIENTS_S)
        out, _ = clients.communicate(timeout=10 * _CLIENTS_S)
    counts = json.loads(out)
    return {
        "nine_clients_lost": float(counts["lost"] + counts["silent"]),
        "nine_clients_messages": float(counts["messages"]),
        "nine_clients_real_time_factor": factor,
    }


def real_time_factor(server: PageProcess, seconds: float) -> tuple[float, float]:
    """Returns the real-time factor over `seconds`, and the memory at the end, MB."""
    with connect(server.rosbridge) as socket:
        socket.send(json.dumps({"op": "subscribe", "topic": _STATUS, "queue_length": 1}))
        first = last = _status(socket.recv())
        ends = time.monotonic() + seconds
        while time.monotonic() < ends:
            last = _status(socket.recv())
    simulated = _seconds(last["stamp"]) - _seconds(first["stamp"])
    return simulated / (_seconds(last["wall"]) - _seconds(first["wall"])), float(last["memory"])


def _status(text: str | bytes) -> dict[str, Any]:
    status: dict[str, Any] = json.loads(text)["msg"]
    return status


def _seconds(stamp: dict[str, int]) -> float:
    return stamp["sec"] + 1e-9 * stamp["nanosec"]
