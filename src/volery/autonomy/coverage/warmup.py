"""Compiles the kernels of coverage plans; see `volery.autonomy.perception.warmup`."""

from __future__ import annotations

import numpy as np

from volery.autonomy.coverage.plan import plan_coverage


def coverage_plans() -> None:
    """Compiles all kernels: two UAVs divide a small map."""
    plan_coverage(np.ones((4, 4), np.bool_), [[0, 0], [3, 3]])
