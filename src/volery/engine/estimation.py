"""Passes sensor measurements to the UAVs' estimators as they arrive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from volery.control.estimator.errors import estimation_error
from volery.control.estimator.estimator import Estimator
from volery.control.estimator.initial_estimate import drawn_start
from volery.control.estimator.settings import StartSigmas
from volery.control.fleet import Fleet
from volery.core import atmosphere
from volery.core.arrays import Array
from volery.core.rows import Rows, in_one_piece
from volery.sensors.samples import (
    GnssSamples,
    ImuSamples,
    MagneticSamples,
    PressureSamples,
    RangeSamples,
    Samples,
    SensorId,
)

T = TypeVar("T", bound=np.generic)


@dataclass(frozen=True)
class EstimationSetup:
    """Inputs of the estimators: row e of each array belongs to estimator e."""

    uavs: Rows
    """(E,) rows of the fleet."""
    used_for_control: NDArray[np.bool_]
    """(E,) whether the UAV's controllers use the estimate."""
    listens: Mapping[tuple[int, str], int]
    """Estimator that uses a sensor, by row of the UAV and name of the sensor."""
    gyro_variance: Array
    """(E,) rad^2/s^2 of one gyroscope measurement."""
    gnss_drift_variance: Array
    """(E, 3) m^2 of a receiver's stated noise that the filter estimates as an offset instead."""
    origin_altitude_m: float
    """Altitude of the map's z = 0 above sea level."""
    ground_height_m: float | None
    """Height of level ground, m; None if the ground is not level, so that ranges are unusable."""
    start: StartSigmas
    """Standard deviations of the initial estimates."""


@dataclass(frozen=True)
class PoseMeasurement:
    """Pose of a body in the map at `stamp_ns`, as measured by a node."""

    stamp_ns: int
    position_map: Array
    """(3,) m."""
    attitude: Array
    """(4,) x y z w."""
    sigma_m: float
    sigma_rad: float


class Estimation:
    """Holds the estimators of all UAVs that have one."""

    def __init__(self, estimator: Estimator, setup: EstimationSetup, fleet: Fleet) -> None:
        self.estimator = estimator
        self.setup = setup
        self._fleet = fleet
        self._known: dict[int, tuple[tuple[SensorId, ...], Rows | slice, Rows]] = {}
        flying = np.flatnonzero(setup.used_for_control)
        self._is_used_for_control = len(flying) > 0
        self._flying = in_one_piece(flying), in_one_piece(setup.uavs[flying])
        self._pose_ns = np.full(len(estimator), _NEVER_NS)

    @property
    def gyro_variance(self) -> Array:
        """(E,) rad^2/s^2 of one gyroscope measurement."""
        return self.setup.gyro_variance

    def rows_of(self, uavs: Rows) -> Rows:
        """Returns the estimators of UAVs, given by rows of the fleet; each must have one."""
        return np.array([int(np.flatnonzero(self.setup.uavs == uav)[0]) for uav in uavs])

    def register(self, sensors: tuple[SensorId, ...]) -> None:
        """Looks up once the estimators for a bank whose samples name `sensors`."""
        self._known[id(sensors)] = (sensors, *self._look_up(sensors))

    def take(self, samples: Samples) -> None:
        """Passes a bank's samples to the estimators that use them."""
        selection, rows = self._listeners(samples.sensors)
        if isinstance(samples, ImuSamples):
            if len(rows):
                self.estimator.predict(
                    rows,
                    samples.stamp_ns,
                    _selected(samples.angular_velocity, selection),
                    _selected(samples.specific_force, selection),
                )
            self._update_fleet()
        elif not len(rows):
            return
        elif isinstance(samples, GnssSamples):
            self._take_fixes(samples, selection, rows)
        elif isinstance(samples, PressureSamples):
            self._take_pressures(samples, selection, rows)
        elif isinstance(samples, MagneticSamples):
            self.estimator.fuse_magnetic(
                rows, samples.stamp_ns, _selected(samples.field, selection), samples.field_variance
            )
        elif isinstance(samples, RangeSamples) and self.setup.ground_height_m is not None:
            self.estimator.fuse_range(
                rows,
                samples.stamp_ns,
                _selected(samples.ranges, selection),
                samples.variance,
                self.setup.ground_height_m,
            )

    def take_pose(self, uav: int, pose: PoseMeasurement, *, gap_ns: int) -> None:
        """Passes a pose in the map, such as a SLAM's, to the estimator of fleet row `uav`.

        Ignores a pose that is not at least `gap_ns` newer than the last accepted one, or not
        finite.
        """
        rows = self.rows_of(np.array([uav]))
        if pose.stamp_ns - self._pose_ns[rows[0]] < gap_ns:
            return
        self._pose_ns[rows[0]] = pose.stamp_ns
        variances = np.repeat([pose.sigma_m**2, pose.sigma_rad**2], 3)
        self.estimator.fuse_pose(
            rows, pose.stamp_ns, pose.position_map[None], pose.attitude[None], variances
        )

    def pose_ns(self, uav: int) -> int:
        """Returns the stamp of a UAV's newest accepted pose, ns; far in the past without one."""
        return int(self._pose_ns[self.rows_of(np.array([uav]))[0]])

    def stand_still(self, uav: int, stamp_ns: int) -> None:
        """Passes zero velocity to the estimator of a UAV that is on the ground."""
        rows = self.rows_of(np.array([uav]))
        self.estimator.fuse_velocity(rows, stamp_ns, np.zeros((1, 3)), _STATIONARY_VARIANCE)

    def restart(self, keys: Mapping[int, np.uint64]) -> None:
        """Restarts the estimates of restarted UAVs; `keys`: random stream by fleet row."""
        rows = np.array([e for e, uav in enumerate(self.setup.uavs) if int(uav) in keys], np.int64)
        if not len(rows):
            return
        uavs = self.setup.uavs[rows]
        truth = self._fleet.state
        position, velocity, attitude = drawn_start(
            np.array([keys[int(uav)] for uav in uavs], np.uint64),
            truth.position_map[uavs],
            truth.velocity_map[uavs],
            truth.attitude[uavs],
            self.setup.start,
        )
        before_the_first_reading = self._fleet.time_ns - 1
        self.estimator.reset(
            rows,
            position=position,
            velocity=velocity,
            attitude=attitude,
            stamp_ns=before_the_first_reading,
        )
        self._pose_ns[rows] = _NEVER_NS
        self._update_fleet(rows)

    def continue_from(self, other: Estimation, pairs: Sequence[tuple[int, int]]) -> None:
        """Copies another's estimates; pairs of own row of the fleet and the other's."""
        theirs = {int(uav): e for e, uav in enumerate(other.setup.uavs)}
        was = dict(pairs)
        filters = [
            (e, theirs[was[int(uav)]])
            for e, uav in enumerate(self.setup.uavs)
            if was.get(int(uav)) in theirs
        ]
        self.estimator.continue_from(other.estimator, filters)
        for own, row in filters:
            self._pose_ns[own] = other._pose_ns[row]

    def get_state(self) -> dict[str, Any]:
        """Returns the state for a snapshot."""
        return {**self.estimator.get_state(), "pose_ns": self._pose_ns.copy()}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state; the fleet restores the estimation errors itself."""
        self.estimator.set_state(state)
        self._pose_ns[:] = state["pose_ns"]

    def _take_fixes(self, samples: GnssSamples, selection: Rows | slice, rows: Rows) -> None:
        drift = self.setup.gnss_drift_variance[rows]
        noise = np.maximum(_selected(samples.position_variance, selection) - drift, _MIN_VARIANCE)
        self.estimator.fuse_gnss(
            rows,
            samples.stamp_ns,
            _selected(samples.position_map, selection),
            _selected(samples.velocity_map, selection),
            np.hstack(
                [
                    noise,
                    np.maximum(_selected(samples.velocity_variance, selection), _MIN_VARIANCE),
                ]
            ),
            _selected(samples.has_fix, selection),
        )

    def _take_pressures(
        self, samples: PressureSamples, selection: Rows | slice, rows: Rows
    ) -> None:
        pressure = _selected(samples.pressure, selection)
        height = atmosphere.altitude(pressure) - self.setup.origin_altitude_m
        slope = atmosphere.altitude(pressure + 1.0) - atmosphere.altitude(pressure)
        variance = np.maximum(slope**2 * samples.pressure_variance, _MIN_VARIANCE)
        self.estimator.fuse_pressure_height(rows, samples.stamp_ns, height, variance)

    def _update_fleet(self, rows: Rows | None = None) -> None:
        """Sets the estimation errors that the fleet's controllers use; `rows` (E,), or all."""
        if not self._is_used_for_control:
            return
        flying, uavs = self._flying
        if rows is not None:
            flying = rows[self.setup.used_for_control[rows]]
            uavs = self.setup.uavs[flying]
        error = estimation_error(
            _rows_of(self.estimator.state, flying), _rows_of(self._fleet.state, uavs)
        )
        self._fleet.set_estimation_error(uavs, error)

    def _listeners(self, sensors: tuple[SensorId, ...]) -> tuple[Rows | slice, Rows]:
        found = self._known.get(id(sensors))
        if found is not None and found[0] is sensors:
            return found[1], found[2]
        return self._look_up(sensors)

    def _look_up(self, sensors: Sequence[SensorId]) -> tuple[Rows | slice, Rows]:
        """Returns the rows of a bank's arrays that are used, and the estimators that use them."""
        listens = self.setup.listens
        pairs = [
            (k, listens[s.uav, s.name]) for k, s in enumerate(sensors) if (s.uav, s.name) in listens
        ]
        table = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        return in_one_piece(table[:, 0]), table[:, 1]


_NEVER_NS = -(10**18)

_STATIONARY_VARIANCE = np.full(3, 0.02**2)
"""(m/s)^2, of a landed UAV in wind; modelling choice."""
_MIN_VARIANCE = 1e-4
"""m^2 and (m/s)^2: no measurement is treated as better than a centimetre."""


@dataclass(frozen=True)
class _Motions:
    position_map: Array
    velocity_map: Array
    attitude: Array
    omega_body: Array


def _selected(values: NDArray[T], selection: Rows | slice) -> NDArray[T]:
    """Returns the used rows, as a writable array: kernels are compiled for those."""
    return np.array(values[selection])


def _rows_of(states: Any, rows: Rows | slice) -> _Motions:
    return _Motions(
        states.position_map[rows],
        states.velocity_map[rows],
        states.attitude[rows],
        states.omega_body[rows],
    )
