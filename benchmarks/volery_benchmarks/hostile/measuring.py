"""Measures a simulation in real time while clients attack its bridges.

The victim is `volery run hover --speed 1` with rosbridge and ROS-TCP. Each attacker is a process
pinned to the last core of the machine, so that the figures exclude the attackers' own load. An
ordinary client in a third process measures the service that other clients get.
"""

from __future__ import annotations

import json
import logging
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from volery.core.errors import VoleryError
from volery.mavlink.codec import dialect
from volery.mavlink.links import ports
from volery_benchmarks.ending import end
from volery_benchmarks.hostile.attackers import (
    ATTACKS,
    MAVLINK_ATTACKS,
    SETTLE_S,
    WITNESSED_FROM_START,
)
from volery_benchmarks.hostile.witness import PERIOD_S
from volery_benchmarks.registry import Measured

_log = logging.getLogger(__name__)

ATTACK_S = 8.0
_QUICK_ATTACK_S = 1.5
_LEAD_S = 1.0
"""Lead of an attack before the witness measures, s."""
_SETTLE_S = 1.0
_START_S = 120.0
_NOT_ANSWERED_S = 10.0
"""Delay that counts for calls without a response, s."""


def measure(*, quick: bool = False) -> Measured:
    """Returns the figures of the bench `hostile`. Raises `BridgeError` without pymavlink."""
    dialect()
    figures: dict[str, float] = {}
    seconds = _QUICK_ATTACK_S if quick else ATTACK_S
    for name in ("none", *ATTACKS):
        _log.info("hostile: %s", name)
        with _victim(with_mavlink=name in MAVLINK_ATTACKS) as (pid, rosbridge, attacked):
            _wait_until_answered(rosbridge)
            figures |= _attack(name, pid, rosbridge, attacked, seconds)
    return Measured(figures | worst_figures(figures))


def worst_figures(figures: dict[str, float]) -> dict[str, float]:
    """Returns the worst figures of all attacks, and the bounds of the two crowds of clients."""

    def of_attacks(figure: str) -> list[float]:
        return [figures[f"{attack}_{figure}"] for attack in ATTACKS]

    of_crowds = {
        "memory_growth_1000_viewers_mb": "viewers_1000_peak_mb",
        "rtf_120_stopped_subscribers": "subscribers_120_stopped_rtf",
    }
    worst = {name: figures[figure] for name, figure in of_crowds.items() if figure in figures}
    return worst | {
        "rtf_under_attack": min(of_attacks("rtf")),
        "other_client_delay_p99_ms": max(of_attacks("delay_p99_ms")),
        "memory_growth_mb": max(of_attacks("memory_mb")),
    }


def call_figures(answers: list[tuple[float, float, float]], asked: int) -> dict[str, float]:
    """Returns real-time factor and delay from the witness's responses."""
    if len(answers) < 2:
        return {"rtf": 0.0, "delay_p99_ms": 1e3 * _NOT_ANSWERED_S}
    due, came, sim = np.array(answers).T
    delays = np.full(max(asked, len(answers)), _NOT_ANSWERED_S)
    delays[: len(answers)] = came - due
    first, last = int(came.argmin()), int(came.argmax())
    return {
        "rtf": float((sim[last] - sim[first]) / (came[last] - came[first])),
        "delay_p99_ms": 1e3 * float(np.percentile(delays, 99)),
    }


def _attack(
    name: str, pid: int, rosbridge: int, attacked: tuple[int, int], seconds: float
) -> dict[str, float]:
    """Returns the figures of one attack, named after it; `none` means no attack."""
    before = _resident_mb(pid)
    _reset_peak(pid)
    attacker = None
    if name in ATTACKS:
        attacker = _start("attackers", name, *attacked, seconds + 2 * _LEAD_S)
        time.sleep(0.0 if name in WITNESSED_FROM_START else _LEAD_S)
    witness = _start("witness", rosbridge, seconds)
    found = call_figures(_result(witness, seconds), round(seconds / PERIOD_S))
    if attacker is not None:
        found["sent"] = float(_result(attacker, seconds)["sent"])
    found["peak_mb"] = _resident_mb(pid, "VmHWM") - before
    time.sleep(SETTLE_S.get(name, _SETTLE_S))
    found["memory_mb"] = _resident_mb(pid) - before
    return {f"{name}_{figure}": value for figure, value in found.items()}


def _start(module: str, *words: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-P", "-m", f"volery_benchmarks.hostile.{module}", *map(str, words)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def _result(process: subprocess.Popen[str], seconds: float) -> Any:
    try:
        out, _ = process.communicate(timeout=seconds + _START_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise VoleryError("hostile: a client did not end") from None
    if process.returncode:
        raise VoleryError(f"hostile: a client ended with status {process.returncode}")
    return json.loads(out)


@contextmanager
def _victim(*, with_mavlink: bool) -> Iterator[tuple[int, int, tuple[int, int]]]:
    """Runs a victim in real time; yields process id, rosbridge port and attacked ports.

    The attacked ports are rosbridge's and ROS-TCP's, or those of MAVLink by TCP and UDP.
    """
    rosbridge, ros_tcp = _free_port(), _free_port()
    attacked = (_free_port(), _free_mavlink_port()) if with_mavlink else (rosbridge, ros_tcp)
    command = [sys.executable, "-P", "-m", "volery.cli.app", "run", "hover", "--speed", "1"]
    command += ["--seconds", "100000"]
    command += ["--bridge", f"rosbridge={rosbridge}", "--bridge", f"ros-tcp={ros_tcp}"]
    if with_mavlink:
        command += ["--bridge", f"mavlink-tcp={attacked[0]}", "--bridge", f"mavlink={attacked[1]}"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        _wait_until_open(process, rosbridge)
        yield process.pid, rosbridge, attacked
    finally:
        end(process)


def _wait_until_open(process: subprocess.Popen[bytes], port: int) -> None:
    ends = time.monotonic() + _START_S
    while time.monotonic() < ends and process.poll() is None:
        try:
            socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
        except OSError:
            time.sleep(0.1)
        else:
            return
    raise VoleryError("hostile: the simulation under attack did not start")


def _wait_until_answered(port: int) -> None:
    """Waits until a witness gets its responses: kernels are compiled, setup is over."""
    ends = time.monotonic() + _START_S
    while time.monotonic() < ends:
        if len(_result(_start("witness", port, _LEAD_S), _LEAD_S)) * PERIOD_S > 0.9 * _LEAD_S:
            return
    raise VoleryError("hostile: the simulation under attack does not respond")


def _free_port() -> int:
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        return int(sock.getsockname()[1])


def _free_mavlink_port() -> int:
    """Returns a PORT for the bridge `mavlink=PORT` with both ports of its first vehicle free."""
    for port in range(ports.ONBOARD_TO + 5000, ports.ONBOARD_TO + 40_000, 97):
        with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as onboard:
            shift = port - ports.ONBOARD_TO
            onboard.bind(("127.0.0.1", ports.ONBOARD_FROM + shift))
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ground:
                ground.bind(("127.0.0.1", ports.GROUND_FROM + shift))
                return port
    raise VoleryError("hostile: no free UDP ports for MAVLink")


def _reset_peak(pid: int) -> None:
    """Resets the peak of the resident memory (proc(5), clear_refs)."""
    Path(f"/proc/{pid}/clear_refs").write_text("5")


def _resident_mb(pid: int, which: str = "VmRSS") -> float:
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith(f"{which}:"):
            return float(line.split()[1]) / 1024.0
    raise VoleryError("hostile: the simulation under attack has ended")
