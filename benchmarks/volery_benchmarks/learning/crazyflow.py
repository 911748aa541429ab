"""Measures Crazyflow beside the figure of states: 1,024 worlds of one drone on the CPU.

A decision is 20 ms of its physics and controllers at 500 Hz, in calls of 50 decisions, without
observations, rewards and resets, which it would have to add.
"""

from __future__ import annotations

import statistics
import tempfile
from pathlib import Path

from volery.core.errors import VoleryError
from volery_benchmarks.peers.catalogue import PEERS, RATE_HZ
from volery_benchmarks.peers.environments import environment
from volery_benchmarks.peers.failure import PeerError
from volery_benchmarks.peers.peer_process import PeerProcess
from volery_benchmarks.registry import Measured

_ENVS = 1_024
_DECISIONS = 50
_DECISION_HZ = 50
_ROUNDS = 5
_SCRIPTS = Path(__file__).parents[1] / "peers"


def measure_crazyflow() -> Measured:
    """Returns the figure. Raises `VoleryError` if pip cannot install it, or it fails."""
    (peer,) = (each for each in PEERS if each.name == "crazyflow")
    request = {
        "worlds": _ENVS,
        "drones": 1,
        "places": [[0.0, 0.0, 10.0]],
        "steps": _DECISIONS * RATE_HZ // _DECISION_HZ,
        "rate_hz": RATE_HZ,
        "packages": peer.packages,
    }
    try:
        python = environment(peer)
        with (
            tempfile.TemporaryDirectory() as folder,
            PeerProcess(python, _SCRIPTS / peer.script, request, Path(folder)) as process,
        ):
            process.round()
            times = [process.round() for _ in range(_ROUNDS)]
            versions = ", ".join(f"{k} {v}" for k, v in process.versions().items())
    except PeerError as error:
        raise VoleryError(f"crazyflow: {error}") from None
    rate = _ENVS * _DECISIONS / statistics.median(times)
    return Measured({"crazyflow_env_steps_per_s": rate}, {}, {"crazyflow": versions})
