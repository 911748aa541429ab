"""Measures other simulators beside Volery; see docs/peers.md.

Each peer has its own virtual environment (`environments`) and is driven through a pipe
(`conversation`, `host`), because several of them need other versions of numpy than Volery. The
files `*_rays.py` and `*_hover.py` run with a peer's interpreter and never import volery.
"""

from __future__ import annotations

from volery_benchmarks.registry import Measured


def measure() -> Measured:
    """Returns the figures of the bench `peers`."""
    from volery_benchmarks.peers.contests import measure_peers

    return measure_peers()
