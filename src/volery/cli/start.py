"""Entry point of the command `volery`: handles Ctrl-C even while modules load."""

from __future__ import annotations

import sys

_INTERRUPTED = 130
"""128 + SIGINT, as in `volery.cli.interrupt`, which is not loaded yet."""


def main() -> None:
    """Loads the command line and runs it."""
    try:
        from volery.cli.app import main as run
    except KeyboardInterrupt:
        sys.stderr.write("stopped\n")
        sys.exit(_INTERRUPTED)
    run()
