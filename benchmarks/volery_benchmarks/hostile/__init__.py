"""Measures how clients that overload a simulation affect other clients."""

from __future__ import annotations

from volery_benchmarks.registry import Measured


def measure(*, quick: bool = False) -> Measured:
    """Returns the figures of the bench `hostile`."""
    from volery_benchmarks.hostile.measuring import measure as measure_all

    return measure_all(quick=quick)
