"""Measures studies of many runs, on one machine and on two."""

from __future__ import annotations

from volery_benchmarks.cluster import studies, two_machines
from volery_benchmarks.registry import Measured


def measure(*, quick: bool = False) -> Measured:
    """Returns the figures of the bench; those of two machines only where they can be had."""
    figures, failures = studies.measure(quick=quick), {}
    missing = two_machines.what_is_missing()
    if missing:
        failures["two machines"] = missing
    else:
        figures |= two_machines.measure(quick=quick)
    return Measured(figures, failures)
