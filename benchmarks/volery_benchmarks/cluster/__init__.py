"""Measures studies of many runs, on one machine and on two, and one run on two machines."""

from __future__ import annotations

from volery_benchmarks.cluster import divided, namespaces, studies, two_machines
from volery_benchmarks.registry import Measured


def measure(*, quick: bool = False) -> Measured:
    """Returns the figures of the bench; those of two machines only where they can be had."""
    figures, failures = studies.measure(quick=quick), {}
    missing = two_machines.what_is_missing()
    if missing:
        failures["two machines"] = missing
    else:
        figures |= two_machines.measure(quick=quick)
    missing = namespaces.what_is_missing()
    if missing:
        failures["divided runs"] = missing
    else:
        figures |= divided.measure(quick=quick)
    return Measured(figures, failures)
