"""Transfers state to a fleet with more or fewer UAVs."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from volery.sensors.bank import Bank

Pairs = Sequence[tuple[int, int]]
"""New row and old row of everything that continues."""


def common_rows(names: Sequence[str], before: Sequence[str], going_on: Collection[str]) -> Pairs:
    """Returns the rows in `names` and `before` of all common names in `going_on`."""
    rows = {name: row for row, name in enumerate(before) if name in going_on}
    return [(row, rows[name]) for row, name in enumerate(names) if name in rows]


def continue_bank(bank: Bank, others: Sequence[Bank], going_on: Collection[str]) -> None:
    """Copies the states of sensors in `others` that belong to the UAVs `going_on`."""
    paths = [sensor.path for sensor in bank.sensors]
    sensors = {sensor.path for sensor in bank.sensors if sensor.uav_name in going_on}
    for other in others:
        pairs = common_rows(paths, [sensor.path for sensor in other.sensors], sensors)
        if pairs and other.name == bank.name:
            sizes = len(paths), len(other.sensors)
            bank.set_state(_mixed(bank.get_state(), other.get_state(), pairs, sizes))


def _mixed(fresh: Any, past: Any, pairs: Pairs, sizes: tuple[int, int]) -> Any:
    """Returns state `fresh` with the rows `pairs` of every array from `past`; rows are sensors."""
    if isinstance(past, Mapping):
        fresh = fresh or {}
        return {key: _mixed(fresh.get(key), past[key], pairs, sizes) for key in past}
    if not isinstance(past, np.ndarray):
        return past
    mixed = np.zeros((sizes[0], *past.shape[1:]), past.dtype) if fresh is None else fresh.copy()
    for own, theirs in pairs:
        mixed[own] = past[theirs]
    return mixed
