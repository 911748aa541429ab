"""Measures environments for learning, trainings and shipped policies; see docs/training.md.

Each part is a function that returns figures; `measure(only=...)` runs some of them.
"""

from __future__ import annotations

import importlib
import logging
from collections.abc import Sequence

from volery.core.errors import VoleryError
from volery_benchmarks.registry import Measured, chosen_parts

PARTS = {
    "state": "throughput",
    "rotor": "throughput",
    "lidar": "throughput",
    "depth": "throughput",
    "reset": "throughput",
    "hover": "trainings",
    "homing": "trainings",
    "success": "shipped_policies",
    "transfer": "shipped_policies",
    "crazyflow": "crazyflow",
}
"""Modules of the parts, whose functions `measure_PART` return figures."""
_LOG = logging.getLogger(__name__)


def measure(*, only: Sequence[str] = ()) -> Measured:
    """Returns the figures of the parts named in `only`, by default of all.

    Parts that cannot be measured are in `failures`. Raises `VoleryError` for an unknown part.
    """
    figures: dict[str, float] = {}
    failures: dict[str, str] = {}
    versions: dict[str, str] = {}
    for name in chosen_parts("learning", PARTS, only):
        _LOG.info("%s", name)
        module = importlib.import_module(f"volery_benchmarks.learning.{PARTS[name]}")
        try:
            found: Measured = getattr(module, f"measure_{name}")()
        except VoleryError as error:
            failures[name] = str(error)
            continue
        figures.update(found.figures)
        failures.update(found.failures)
        versions.update(found.versions)
    return Measured(figures, failures, versions)
