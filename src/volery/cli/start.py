"""The command `volery` from its very first moment: Ctrl-C ends it in a line also while it loads."""

from __future__ import annotations

import sys

_INTERRUPTED = 130
"""128 + SIGINT; as `volery.cli.interrupt` has it, which is not loaded yet."""


def main() -> None:
    """Load the command line and run it."""
    try:
        from volery.cli.app import main as run
    except KeyboardInterrupt:
        sys.stderr.write("stopped\n")
        sys.exit(_INTERRUPTED)
    run()
