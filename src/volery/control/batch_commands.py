"""Commands to many UAVs at once, as arrays; `control.commands` commands single UAVs."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from volery.control.estimated_state import EstimatedState
from volery.control.flight_modes import FlightMode
from volery.control.setpoints import ControlLevel
from volery.core import rotations
from volery.core.arrays import Array

_DEAF = (FlightMode.LANDED, FlightMode.TAKE_OFF, FlightMode.CRASHED)


def command_velocities(
    bodies: NDArray[np.void],
    control_states: NDArray[np.void],
    step: int,
    velocity: Array,
    yaw_rate: Array,
) -> None:
    """Sets velocity setpoints of all flying UAVs, as `FleetCommands.command_velocity_body` does.

    bodies, control_states: (N,) rows of `BODY` and `CONTROL_STATE`. velocity: (N, 3) m/s in the
    level heading frame; yaw_rate: (N,) rad/s. UAVs that are on the ground, crashed or taking off
    are skipped.
    """
    accepts = ~np.isin(control_states["mode"], [int(mode) for mode in _DEAF])
    bodies["still_steps"][accepts] = 0
    bodies["ground_budget"][accepts] = 0.0
    bodies["downwash_budget"][accepts] = 0.0
    fresh = np.flatnonzero(accepts & (control_states["level"] != ControlLevel.GUIDED))
    if len(fresh):
        yaw = rotations.yaw_of(bodies["attitude"][fresh])
        heading = np.column_stack([np.cos(yaw), np.sin(yaw)])
        control_states["level"][fresh] = ControlLevel.GUIDED
        control_states["position"][fresh] = bodies["position_map"][fresh]
        control_states["velocity"][fresh] = bodies["velocity_map"][fresh]
        control_states["acceleration"][fresh] = 0.0
        control_states["velocity_integral"][fresh] = 0.0
        control_states["heading"][fresh] = control_states["heading_target"][fresh] = heading
    control_states["mode"][accepts] = FlightMode.VELOCITY
    control_states["calm_ticks"][accepts] = 0
    control_states["velocity_target"][accepts] = velocity[accepts]
    control_states["velocity_in_heading"][accepts] = True
    control_states["deadline_step"][accepts] = step + control_states["timeout_steps"][accepts]
    control_states["turning"][accepts] = True
    control_states["yaw_rate_target"][accepts] = yaw_rate[accepts]


def command_low_level(
    bodies: NDArray[np.void],
    control_states: NDArray[np.void],
    step: int,
    level: ControlLevel,
    setpoints: Mapping[str, Array | float],
) -> None:
    """Sets low-level setpoints by field, (N, ...) or one for all, of all UAVs not crashed.

    As the commands of single UAVs to rotors, rates and attitudes do.
    """
    rows = np.flatnonzero(control_states["mode"] != FlightMode.CRASHED)
    _wake(bodies, rows, step)
    control_states["mode"][rows] = FlightMode.LOW_LEVEL
    control_states["level"][rows] = level
    _set_fields(control_states, rows, setpoints)


def guided_rows(control_states: NDArray[np.void]) -> NDArray[np.int64]:
    """Returns the rows of UAVs that guided commands reach: not landed, taking off or crashed."""
    return np.flatnonzero(~np.isin(control_states["mode"], [int(mode) for mode in _DEAF]))


def enter_guided(
    bodies: NDArray[np.void],
    control_states: NDArray[np.void],
    step: int,
    mode: FlightMode,
    motion_of: Callable[[NDArray[np.int64]], EstimatedState],
) -> NDArray[np.int64]:
    """Sets a guided flight mode of all UAVs that guided commands reach; returns their rows.

    motion_of: returns the motion that the controllers of some rows use.
    """
    rows = guided_rows(control_states)
    _wake(bodies, rows, step)
    fresh = rows[control_states["level"][rows] != ControlLevel.GUIDED]
    if len(fresh):
        motion = motion_of(fresh)
        yaw = rotations.yaw_of(motion.attitude)
        heading = np.column_stack([np.cos(yaw), np.sin(yaw)])
        control_states["level"][fresh] = ControlLevel.GUIDED
        control_states["position"][fresh] = motion.position
        control_states["velocity"][fresh] = motion.velocity
        control_states["acceleration"][fresh] = 0.0
        control_states["velocity_integral"][fresh] = 0.0
        control_states["heading"][fresh] = control_states["heading_target"][fresh] = heading
    if mode is not FlightMode.VELOCITY:
        turning = rows[control_states["turning"][rows]]
        control_states["heading_target"][turning] = control_states["heading"][turning]
        control_states["turning"][turning] = False
    control_states["mode"][rows] = mode
    control_states["braking"][rows] = False
    control_states["calm_ticks"][rows] = 0
    return rows


def command_map_velocities(
    control_states: NDArray[np.void],
    rows: NDArray[np.int64],
    step: int,
    velocity: Array,
    yaw: Array | None,
    yaw_rate: Array,
) -> None:
    """Sets velocities (N, 3) m/s, map, of the guided `rows`, with yaws or yaw rates (N,)."""
    stops = ~velocity[rows].any(axis=1) & control_states["velocity_target"][rows].any(axis=1)
    control_states["hurried"][rows] |= stops
    control_states["velocity_target"][rows] = velocity[rows]
    control_states["velocity_in_heading"][rows] = False
    control_states["deadline_step"][rows] = step + control_states["timeout_steps"][rows]
    if yaw is None:
        control_states["turning"][rows] = True
        control_states["yaw_rate_target"][rows] = yaw_rate[rows]
    else:
        _face(control_states, rows, yaw)


def command_setpoints(
    control_states: NDArray[np.void],
    rows: NDArray[np.int64],
    step: int,
    setpoints: Mapping[str, Array],
    yaw: Array | None,
    yaw_rate: Array,
) -> None:
    """Sets trajectory points by field, (N, 3) each, of the guided `rows`."""
    control_states["path_last"][rows] = -1
    control_states["start_step"][rows] = step
    control_states["deadline_step"][rows] = step + control_states["timeout_steps"][rows]
    _set_fields(control_states, rows, setpoints)
    control_states["yaw_rate_target"][rows] = yaw_rate[rows]
    if yaw is None:
        control_states["turning"][rows[yaw_rate[rows] != 0.0]] = True
    else:
        _face(control_states, rows, yaw)


def _wake(bodies: NDArray[np.void], rows: NDArray[np.int64], step: int) -> None:
    rests = rows[bodies["on_ground"][rows] | bodies["asleep"][rows]]
    bodies["last_contact_step"][rests] = step
    bodies["asleep"][rows] = False
    bodies["still_steps"][rows] = 0
    bodies["ground_budget"][rows] = 0.0
    bodies["downwash_budget"][rows] = 0.0


def _face(control_states: NDArray[np.void], rows: NDArray[np.int64], yaw: Array) -> None:
    control_states["turning"][rows] = False
    control_states["heading_target"][rows, 0] = np.cos(yaw[rows])
    control_states["heading_target"][rows, 1] = np.sin(yaw[rows])


def _set_fields(
    control_states: NDArray[np.void],
    rows: NDArray[np.int64],
    setpoints: Mapping[str, Array | float],
) -> None:
    for name, values in setpoints.items():
        if not isinstance(values, np.ndarray):
            control_states[name][rows] = values
        elif values.ndim == 1:
            control_states[name][rows] = values[rows]
        else:
            control_states[name][rows, : values.shape[1]] = values[rows]
