"""Ends processes that a benchmark has started."""

from __future__ import annotations

import subprocess
from typing import Any

_ENDING_S = 20.0


def end(process: subprocess.Popen[Any]) -> None:
    """Ends a process by SIGTERM, or by SIGKILL if it does not end in time."""
    process.terminate()
    try:
        process.wait(_ENDING_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait(_ENDING_S)
