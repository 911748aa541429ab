"""The segments of all active trajectories, in one array for the fused step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.control.flight_modes import FlightMode
from volery.control.trajectory_kernels import SEGMENT_COLUMNS
from volery.core.arrays import Array

_MIN_ROWS = 64


class SegmentStore:
    """Stores trajectories as blocks of rows.

    control_states (N,) of `setpoints.CONTROL_STATE` refer to their blocks. A block is free as soon
    as its control_state leaves the trajectory. Compaction makes space; the array doubles when
    blocks fill more than half of it.
    """

    def __init__(self, control_states: NDArray[np.void]) -> None:
        self._control_states = control_states
        self._used = 0
        self.rows: Array = np.zeros((_MIN_ROWS, SEGMENT_COLUMNS))

    def put(self, i: int, segments: Array) -> None:
        """Stores the trajectory `segments` (S, SEGMENT_COLUMNS) of control_state `i`."""
        control_state: Any = self._control_states[i]
        control_state["path_last"] = -1
        if self._used + len(segments) > len(self.rows):
            self._make_room(len(segments))
        first = self._used
        self._used = first + len(segments)
        self.rows[first : self._used] = segments
        control_state["path_first"] = control_state["path_row"] = first
        control_state["path_last"] = self._used - 1

    def continue_from(self, other: SegmentStore, pairs: Sequence[tuple[int, int]]) -> None:
        """Copies active trajectories of another store: own row and the other's for each pair.

        The control_states' records have been copied already.
        """
        for own, _ in pairs:
            self._control_states["path_last"][own] = -1
        for own, row in pairs:
            control_state: Any = other._control_states[row]
            if control_state["mode"] == FlightMode.TRAJECTORY and control_state["path_last"] >= 0:
                self.put(
                    own, other.rows[control_state["path_first"] : control_state["path_last"] + 1]
                )
                self._control_states["path_row"][own] += (
                    control_state["path_row"] - control_state["path_first"]
                )

    def get_state(self) -> Array:
        """Returns a copy of the used rows."""
        return self.rows[: self._used].copy()

    def set_state(self, state: Array) -> None:
        """Restores a `get_state`; the caller restores the control_states."""
        self._used = len(state)
        self.rows = np.zeros((max(_MIN_ROWS, len(state)), SEGMENT_COLUMNS))
        self.rows[: self._used] = state

    def _make_room(self, wanted: int) -> None:
        control_states = self._control_states
        live = np.flatnonzero(
            (control_states["mode"] == FlightMode.TRAJECTORY) & (control_states["path_last"] >= 0)
        )
        blocks = [
            self.rows[control_states["path_first"][i] : control_states["path_last"][i] + 1]
            for i in live
        ]
        used = sum(len(block) for block in blocks)
        rows = np.zeros((max(_MIN_ROWS, 2 * (used + wanted)), SEGMENT_COLUMNS))
        self._used = 0
        for i, block in zip(live, blocks, strict=True):
            shift = self._used - control_states["path_first"][i]
            rows[self._used : self._used + len(block)] = block
            self._used += len(block)
            for name in ("path_first", "path_row", "path_last"):
                control_states[name][i] += shift
        self.rows = rows
