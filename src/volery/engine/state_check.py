"""Ends a run whose state is not physical: not finite, too fast, too far away.

Results after that have no meaning, and NaN breaks their readers. The check is cheap: every 20 ms of
simulated time one dot product over the newest row of the pose history, which NaN, infinity and far
positions make large; the whole state once a second, when the product is large, and before events
are published.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.control.setpoints import MAX_COORDINATE
from volery.control.stability import terms_of
from volery.core.errors import DivergenceError

MAX_SPEED_M_S = 1e4
"""Maximum speed of any UAV."""
_MAX_RATE_RAD_S = 1e5
_GLANCE_S, _LOOK_S = 0.02, 1.0
_LARGE = MAX_COORDINATE**2
_NOTABLE = 0.1
"""Fraction of the motion from which a term is named as the likely cause."""


class StateCheck:
    """Checks the state of `fleet` as it advances."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        position = fleet.history.position
        self._rows: NDArray[np.float64] = position.reshape(len(position), -1)
        dt = fleet.dt_ns * 1e-9
        self._period, self._long = round(_GLANCE_S / dt), round(_LOOK_S / dt)
        self._glanced = self._looked = fleet.step

    def advanced(self) -> None:
        """Checks the state if due; raises `DivergenceError` if it is not physical."""
        if not 0 <= self._fleet.step - self._glanced < self._period:
            self.glance()

    def glance(self) -> None:
        """Checks the positions now, and the whole state if they are large or the check is due."""
        self._glanced = step = self._fleet.step
        row = self._rows[step % len(self._rows)]
        if not row.dot(row) < _LARGE or not 0 <= step - self._looked < self._long:
            self.look()

    def look(self) -> None:
        """Checks the whole state now; raises `DivergenceError` with UAV, time and likely cause."""
        fleet = self._fleet
        self._looked = fleet.step
        state = fleet.state
        well = (
            _within(state.position_map, MAX_COORDINATE)
            & _within(state.velocity_map, MAX_SPEED_M_S)
            & _within(state.attitude, 1.5)
            & _within(state.omega_body, _MAX_RATE_RAD_S)
        )
        if not well.all():
            raise self._error(int(np.argmin(well)))

    def _error(self, row: int) -> DivergenceError:
        fleet, state = self._fleet, self._fleet.state
        name, time_s = fleet.names[row], fleet.time_ns * 1e-9
        speed = float(np.linalg.norm(state.velocity_map[row]))
        position = state.position_map[row]
        if np.isfinite(position).all() and math.isfinite(speed):
            what = (
                f"position ({', '.join(f'{x:.3g}' for x in position)}) m, speed {speed:.3g} m/s, "
                f"angular rate {np.linalg.norm(state.omega_body[row]):.3g} rad/s"
            )
        else:
            what = "its position or velocity is not finite"
        cause = self._cause(row)
        return DivergenceError(
            name, time_s, f"the state of {name} is not physical at {time_s:.3f} s: {what}; {cause}"
        )

    def _cause(self, row: int) -> str:
        """Describes the largest term of the motion at the UAV's recent maximum speed."""
        fleet = self._fleet
        dt = fleet.dt_ns * 1e-9
        speed = max(self._fastest(row), fleet.airframes[row].limits.speed_m_s)
        terms = terms_of(fleet.airframes[row], fleet.plants[row], dt, speed)
        if terms and terms[0].fraction > _NOTABLE:
            worst = terms[0]
            return (
                f"the likely cause is {worst.key} of {worst.owner}, which takes "
                f"{worst.fraction:.3g} of its motion in each step of {1e3 * dt:g} ms at "
                f"{speed:.3g} m/s; less than 1 is stable"
            )
        return (
            "no term of its model is too stiff for the physics step; check its commands, faults, "
            "wind and data files"
        )

    def _fastest(self, row: int) -> float:
        """Returns the maximum plausible speed between two rows of the pose history, m/s."""
        history, step = self._fleet.history.position, self._fleet.step
        newest = step % len(history)
        path = np.roll(history[:, row], -newest - 1, axis=0)
        with np.errstate(all="ignore"):
            distances = np.linalg.norm(np.diff(path, axis=0), axis=1)
        speed = distances / (self._fleet.dt_ns * 1e-9)
        return float(speed[speed <= MAX_SPEED_M_S].max(initial=0.0))


def _within(values: NDArray[np.float64], limit: float) -> NDArray[np.bool_]:
    """Returns the rows whose numbers are all within +-limit; NaN never is."""
    return np.asarray((np.abs(values) <= limit).all(axis=1))
