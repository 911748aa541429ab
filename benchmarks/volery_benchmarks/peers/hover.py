"""Measures hovering beside a peer: UAVs that hold positions 2 m apart, 10 m above ground.

Volery runs one physics step at the peer's rate, including rotor lag, drag, wind and ground contact;
rates are controlled at every step, attitude and position at half and a quarter of that rate. UAVs
of a `Fleet` do not touch or disturb each other, so a row is also a world of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from volery.control.fleet import Fleet
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.vehicle.airframe import load_airframe
from volery.world.terrain import Terrain
from volery_benchmarks.peers.catalogue import RATE_HZ, HoverContest
from volery_benchmarks.peers.failure import PeerError
from volery_benchmarks.peers.task import Task

MAX_DISTANCE_M = 0.5
"""Max position error of a hover, m; beyond it speeds are not compared. Modelling choice."""
_APART_M, _ALTITUDE_M = 2.0, 10.0
_STEPS = 500


def hover_task(contest: HoverContest) -> Task:
    """Prepares the contest."""
    positions = _positions(contest.vehicles)
    fleet = _fleet(positions)
    terrain = Terrain.flat(4000.0, 0.0, (-2000.0, -2000.0)).grid

    def advance() -> None:
        fleet.advance(_STEPS, terrain)

    def check(facts: Mapping[str, Any] | None) -> dict[str, float]:
        ours = float(np.linalg.norm(fleet.state.position_map - positions, axis=1).max())
        if not ours <= MAX_DISTANCE_M:
            raise AssertionError(f"a UAV of ours is {ours:.3g} m from its position")
        if facts is not None:
            check_hover(facts)
        return {}

    return Task(
        advance,
        contest.vehicles * _STEPS,
        contest.vehicles * contest.steps,
        {
            "worlds": contest.worlds,
            "drones": contest.drones,
            "places": _positions(contest.drones).tolist(),
            "steps": contest.steps,
            "rate_hz": RATE_HZ,
        },
        check,
        lambda: None,
        contest.vehicles * RATE_HZ,
    )


def check_hover(facts: Mapping[str, Any]) -> None:
    """Raises `PeerError` unless the peer's drones are at their positions."""
    error = facts.get("position_error_m")
    if not isinstance(error, int | float):
        raise PeerError("does not report position_error_m")
    if not error <= MAX_DISTANCE_M:
        raise PeerError(
            f"a drone is {error:.3g} m from its position; up to {MAX_DISTANCE_M:g} m is hovering"
        )


def _positions(count: int) -> Array:
    """Returns positions (count, 3), m."""
    across = int(np.ceil(np.sqrt(count)))
    row, column = np.divmod(np.arange(count), across)
    altitude = np.full(count, _ALTITUDE_M)
    return np.column_stack([_APART_M * column, _APART_M * row, altitude])


def _fleet(positions: Array) -> Fleet:
    count = len(positions)
    attitude = rotations.from_rpy(np.zeros(count), 0.0, np.zeros(count))
    airframes = [load_airframe("f450")] * count
    fleet = Fleet(airframes, positions, attitude, dt_ns=NS_PER_S // RATE_HZ)
    for i in range(count):
        fleet.command_position(i, positions[i], yaw=0.0)
    return fleet
