"""Reads a stranger's file in a process of its own, with bounds on its memory and time.

The child calls `bound_this_process` first and prints one JSON object; the page's process starts it
with `run_bounded` and goes on whatever becomes of it.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from volery.core.errors import VoleryError

_NICENESS = 5
"""A run beside it, at full speed on all cores, keeps three quarters of them."""


@dataclass(frozen=True)
class ProcessBounds:
    """What a child may take."""

    memory_bytes: int
    """Of addresses; libraries reserve more than they use."""
    cpu_s: int
    wall_s: float
    """On a machine that has much else to do."""


class BoundedError(VoleryError):
    """A file cannot be read within the bounds, or its reader broke off."""


def bound_this_process(bounds: ProcessBounds) -> None:
    """Give up priority, and all memory and processor time beyond the bounds."""
    os.nice(_NICENESS)
    resource.setrlimit(resource.RLIMIT_AS, (bounds.memory_bytes, bounds.memory_bytes))
    resource.setrlimit(resource.RLIMIT_CPU, (bounds.cpu_s, 2 * bounds.cpu_s))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def run_bounded(module: str, words: Sequence[str], bounds: ProcessBounds) -> Any:
    """What `python -m MODULE WORDS` prints, from JSON.

    Raises `BoundedError` where it takes too long, or prints nothing: it ran out of memory.
    """
    command = [sys.executable, "-P", "-m", module, *words]
    few = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    try:
        ran = subprocess.run(
            command,
            capture_output=True,
            stdin=subprocess.DEVNULL,
            text=True,
            timeout=bounds.wall_s,
            check=False,
            env=few,
        )
    except subprocess.TimeoutExpired:
        raise BoundedError("it takes too long to read") from None
    try:
        return json.loads(ran.stdout)
    except ValueError:
        if ran.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
            raise BoundedError("it takes too long to read") from None
        raise BoundedError("the file cannot be read: its reader broke off") from None
