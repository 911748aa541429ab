"""Reads untrusted files in a separate process, with bounds on its memory and time.

The child calls `bound_this_process` first and prints one JSON object; the server starts it with
`run_bounded` and survives its failure.
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
"""With this, a run at full speed on all cores retains three quarters of them."""


@dataclass(frozen=True)
class ProcessBounds:
    """Resource limits of a child."""

    memory_bytes: int
    """Address space; libraries reserve more than they use."""
    cpu_s: int
    wall_s: float
    """Longer than `cpu_s`, for a busy machine."""


class BoundedError(VoleryError):
    """Raised if a file cannot be read within the bounds, or its reader fails."""


def bound_this_process(bounds: ProcessBounds) -> None:
    """Lowers the priority, and limits memory and processor time."""
    os.nice(_NICENESS)
    resource.setrlimit(resource.RLIMIT_AS, (bounds.memory_bytes, bounds.memory_bytes))
    resource.setrlimit(resource.RLIMIT_CPU, (bounds.cpu_s, 2 * bounds.cpu_s))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def run_bounded(module: str, words: Sequence[str], bounds: ProcessBounds) -> Any:
    """Returns the JSON that `python -m MODULE WORDS` prints.

    Raises BoundedError if it takes too long, or prints nothing because it ran out of memory.
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
        raise BoundedError("the file takes too long to read") from None
    try:
        return json.loads(ran.stdout)
    except ValueError:
        if ran.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
            raise BoundedError("the file takes too long to read") from None
        raise BoundedError("the file cannot be read: its reader failed") from None
