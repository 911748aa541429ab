"""Runs TensorBoard as a child process that ends with its parent: `python -m` with its options."""

from __future__ import annotations

import os
import runpy
import threading

_NICENESS = 5
"""A run on all cores goes before the curves."""


def main() -> None:
    """Runs TensorBoard until the standard input ends."""
    os.nice(_NICENESS)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    runpy.run_module("tensorboard.main", run_name="__main__", alter_sys=True)


def _end_with_parent() -> None:
    """Waits for the end of the standard input, which the parent holds open and never writes."""
    while os.read(0, 1):
        pass
    os._exit(0)


if __name__ == "__main__":
    main()
