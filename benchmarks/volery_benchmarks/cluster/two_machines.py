"""Measures studies on a Ray cluster of two machines: rate, and what becomes of losses.

Two network namespaces of this machine stand for two machines: each has an address of its own and
one core. The head of the cluster and the driver are in the first one, so they share its core with
a worker.
"""

from __future__ import annotations

import importlib.util
import json
import logging
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from volery.core.errors import VoleryError
from volery_benchmarks.cluster import namespaces

_LOG = logging.getLogger(__name__)
_PORT = 6379
_RUNS, _QUICK_RUNS = 3_000, 600
_START_S = 120.0
_STUDY = """name = "two"
scenario = "hover"
duration_s = 5.0
repetitions = {runs}
vectorized = false
metrics = ["success", "distance_m", "time_s"]
"""
_DRIVER = """
import json, sys, time
from volery.cluster import run_study

study, results, address, workers = sys.argv[1:5]
seen, first = {}, None

def note(progress):
    global first
    for worker in progress.workers:
        seen.setdefault(worker.name, time.time())
    if progress.done and first is None and len(seen) >= int(workers):
        first = time.time(), progress.done
        print("flying", flush=True)

table = run_study(study, results, workers=int(workers), ray=address, on_progress=note)
end = time.time()
rate = (len(table) - first[1]) / (end - first[0])
failed = sum(each != "done" for each in table["status"])
print(json.dumps({"rate": rate, "failed": failed, "seen": seen, "digests": table["digest"]}))
"""
"""Prints when workers appear; a worker is replaced when its loss is noticed."""


def what_is_missing() -> str:
    """Returns why a cluster of two machines cannot be had here; empty: it can."""
    if importlib.util.find_spec("ray") is None:
        return 'Ray: pip install "volery[cluster]"'
    return namespaces.what_is_missing()


def measure(*, quick: bool = False) -> dict[str, float]:
    """Returns the figures."""
    runs = _QUICK_RUNS if quick else _RUNS
    with tempfile.TemporaryDirectory() as folder, namespaces.namespaces():
        work = Path(folder)
        study = work / "study" / "study.toml"  # its folder is copied to the machines
        study.parent.mkdir()
        study.write_text(_STUDY.format(runs=runs), encoding="utf-8")
        with _cluster(work, nodes=1):
            alone = _fly(study, work / "alone", 1)
        with _cluster(work, nodes=2):
            both = _fly(study, work / "both", 2)
            killed = _fly(study, work / "killed", 2, _kill_worker)
            cut = _fly(study, work / "cut", 2, namespaces.cut_link)
    expected = alone["digests"]
    losses = {"worker": killed, "node": cut}
    return {
        "ray_runs_per_s_1_machine": alone["rate"],
        "ray_runs_per_s_2_machines": both["rate"],
        "ray_efficiency": both["rate"] / (2.0 * alone["rate"]),
        "ray_digests_equal": float(both["digests"] == expected),
        "loss_noticed_s": max(found["noticed_s"] for found in losses.values()),
        **{f"loss_of_a_{name}_noticed_s": found["noticed_s"] for name, found in losses.items()},
        "results_lost": float(
            sum(found["failed"] + (found["digests"] != expected) for found in losses.values())
        ),
    }


@contextmanager
def _cluster(work: Path, nodes: int) -> Iterator[None]:
    """Starts a Ray cluster with a node in each of the first namespaces."""
    token = work / "token"
    token.write_text(os.urandom(16).hex(), encoding="ascii")
    token.chmod(0o600)
    head = f"{namespaces.ADDRESSES[0]}:{_PORT}"
    os.environ.update(_environment(token))
    with ExitStack() as started:
        for k in range(nodes):
            own = ("--head", f"--port={_PORT}", "--include-dashboard=false")
            words = [
                *("start", "--block", *(own if k == 0 else (f"--address={head}",))),
                *(
                    f"--node-ip-address={namespaces.ADDRESSES[k]}",
                    "--num-cpus=1",
                    "--disable-usage-stats",
                ),
                f"--temp-dir={tempfile.mkdtemp(dir=work)}",
            ]
            started.enter_context(_node(k, words, work / f"node_{nodes}_{k}.log"))
        yield


def _environment(token: Path) -> Mapping[str, str]:
    return {
        "RAY_AUTH_MODE": "token",
        "RAY_AUTH_TOKEN_PATH": str(token),
        "RAY_USAGE_STATS_ENABLED": "0",
    }


@contextmanager
def _node(machine: int, words: Sequence[str], log: Path) -> Iterator[None]:
    command = namespaces.on(machine, [sys.executable, "-m", "ray.scripts.scripts", *words])
    with log.open("wb") as output:
        node = subprocess.Popen(command, stdout=output, stderr=output, start_new_session=True)
    try:
        until = time.monotonic() + _START_S
        while "Ray runtime started" not in log.read_text(encoding="utf-8", errors="replace"):
            if node.poll() is not None or time.monotonic() > until:
                raise VoleryError(f"Ray does not start: {log.read_text(errors='replace')[-400:]}")
            time.sleep(0.1)
        yield
    finally:
        for sign in (signal.SIGTERM, signal.SIGKILL):
            try:
                os.killpg(node.pid, sign)
                node.wait(10.0)
            except (ProcessLookupError, subprocess.TimeoutExpired):
                continue
        node.wait()


def _fly(
    study: Path, results: Path, workers: int, lose: Callable[[], None] | None = None
) -> dict[str, Any]:
    """Flies a study from the first machine; `lose` is called while it flies.

    Returns what the driver prints and, with `lose`, after how many seconds a worker was replaced.
    """
    words = [str(study), str(results), f"{namespaces.ADDRESSES[0]}:{_PORT}", str(workers)]
    command = namespaces.on(0, [sys.executable, "-P", "-c", _DRIVER, *words])
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as driver:
        output = driver.stdout
        assert output is not None
        output.readline()
        lost = time.time()
        if lose is not None:
            lose()
        lines = output.read().splitlines()
    if driver.returncode or not lines:
        raise VoleryError(f"the study in {results.name} ended with exit code {driver.returncode}")
    found: dict[str, Any] = json.loads(lines[-1])
    if lose is not None:
        later = [seen - lost for seen in found["seen"].values() if seen > lost]
        found["noticed_s"] = min(later, default=math.inf)
    _LOG.info("%s: %.2f runs/s", results.name, found["rate"])
    return found


def _kill_worker() -> None:
    """Kills a worker on the second machine."""
    listed = subprocess.run(
        ["ip", "netns", "pids", namespaces.NAMES[1]], capture_output=True, text=True, check=True
    )
    for pid in map(int, listed.stdout.split()):
        if Path(f"/proc/{pid}/cmdline").read_bytes().startswith(b"ray::RunActor"):
            os.kill(pid, signal.SIGKILL)
            return
    raise VoleryError("no worker flies on the second machine")
