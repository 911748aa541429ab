"""Drives DARP and spanning-tree coverage of github.com/alice-st/DARP, with its interpreter.

The folder with its modules is the user's; see `host` and `volery_benchmarks.coverage`.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Callable
from typing import Any

import numpy as np


def prepare(request: dict[str, Any]) -> tuple[Callable[[], Any], Callable[[], dict[str, Any]]]:
    """Returns functions: a round that plans one case; the number of sub-cells of each tour."""
    sys.path.insert(0, request["folder"])
    from multiRobotPathPlanner import MultiRobotPathPlanner

    found: list[Any] = []
    starts = list(request["starts"])

    def plan() -> None:
        random.seed(1)
        np.random.seed(1)  # noqa: NPY002, the generator that it draws from
        side, equal = request["side"], [1.0 / len(starts)] * len(starts)
        blocked = list(request["blocked"])
        found[:] = [MultiRobotPathPlanner(side, side, False, starts, equal, blocked, False)]

    def facts() -> dict[str, Any]:
        return {"sub_cells": [len(path) for path in found[0].best_case.paths]}

    return plan, facts
