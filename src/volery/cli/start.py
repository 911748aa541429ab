"""Entry point of the command `volery`: handles Ctrl-C even while modules load."""

from __future__ import annotations

import gc
import sys

_THRESHOLDS = (20_000, 10, 100)
"""Loading modules leaves little garbage; with Python's defaults, collections take a tenth of it."""
_INTERRUPTED = 130
"""128 + SIGINT, as in `volery.cli.interrupt`, which is not loaded yet."""


def main() -> None:
    """Loads the command line and runs it."""
    gc.set_threshold(*_THRESHOLDS)
    try:
        from volery.cli.app import main as run
    except KeyboardInterrupt:
        sys.stderr.write("stopped\n")
        sys.exit(_INTERRUPTED)
    run()
