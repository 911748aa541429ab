"""Estimators of a fleet: fuse sensor measurements into position, velocity and attitude."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.control.estimator.alignment import start_covariance
from volery.control.estimator.checks import checked_rows, each_of, shaped
from volery.control.estimator.estimate import Estimate, InnovationGate
from volery.control.estimator.filter_kernels import predict_rows
from volery.control.estimator.output_predictor import present_covariances
from volery.control.estimator.queue_kernels import enqueue_rows
from volery.control.estimator.records import (
    FILTER,
    GNSS,
    MAGNETIC,
    MEASUREMENT,
    POSE,
    PRESSURE,
    QUEUE,
    RANGE,
    READING,
    STATED_VELOCITY,
    STATES,
    TUNING,
    WORK,
    AidingSource,
    tuning_of,
)
from volery.control.estimator.settings import EstimatorSettings, Mounting, StartSigmas
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.errors import EstimatorError

Rows = NDArray[np.int64]
_AT_CENTRE = Mounting()
_IN_THE_AIR = StartSigmas()


class Estimator:
    """Error-state Kalman filters of `count` UAVs.

    settings, mounting, start: one for all, or one per UAV. position (N, 3) m, velocity (N, 3) m/s,
    map frame, attitude (N, 4) map from body: the estimated motion of the centre of mass at
    `stamp_ns`, with the standard deviations of `start`.

    Measurements are passed in the order of their arrival: `predict` in the order of stamps, at any
    rate; measurements of other sensors at any time. They are fused when the horizon
    (`EstimatorSettings.horizon_s` behind the newest IMU measurement) reaches their stamp. In all
    calls `rows` (S,) are distinct rows of UAVs and row i of each array belongs to `rows[i]`; rows
    with `valid` (S,) false or with non-finite numbers are skipped. Raises `EstimatorError` for rows
    out of range and arrays of a wrong shape.
    """

    def __init__(
        self,
        count: int,
        settings: EstimatorSettings | Sequence[EstimatorSettings],
        *,
        position: ArrayLike,
        velocity: ArrayLike,
        attitude: ArrayLike,
        stamp_ns: int = 0,
        mounting: Mounting | Sequence[Mounting] = _AT_CENTRE,
        start: StartSigmas | Sequence[StartSigmas] = _IN_THE_AIR,
    ) -> None:
        self._settings = each_of(settings, EstimatorSettings, count, "settings")
        mountings = each_of(mounting, Mounting, count, "mounting")
        self._start = each_of(start, StartSigmas, count, "start")
        longest = max(s.horizon_s * s.imu_rate_hz for s in self._settings)
        self._filters = np.zeros(count, FILTER)
        self._rings = np.zeros((count, math.ceil(longest) + 2), READING)
        self._queues = np.zeros((count, QUEUE), MEASUREMENT)
        self._work = np.zeros(1, WORK)
        self._tunings = np.zeros(count, TUNING)
        for i, (own, own_mounting) in enumerate(zip(self._settings, mountings, strict=True)):
            self._tunings[i] = tuning_of(own, own_mounting)[0]
        self.state: Estimate = Estimate(*(self._filters[name] for name in Estimate._fields))
        self.reset(
            np.arange(count),
            position=position,
            velocity=velocity,
            attitude=attitude,
            stamp_ns=stamp_ns,
        )

    def __len__(self) -> int:
        """Number of UAVs."""
        return len(self._filters)

    def reset(
        self,
        rows: ArrayLike,
        *,
        position: ArrayLike,
        velocity: ArrayLike,
        attitude: ArrayLike,
        stamp_ns: int,
        start: StartSigmas | None = None,
    ) -> None:
        """Resets filters to the state of a new estimator with the same arguments.

        position (S, 3) m, velocity (S, 3) m/s, attitude (S, 4) map from body; start: None uses the
        UAV's own. Raises `EstimatorError` if numbers are not finite or quaternions not of unit
        length.
        """
        rows = checked_rows(rows, len(self))
        position = shaped("position", position, (len(rows), 3))
        velocity = shaped("velocity", velocity, (len(rows), 3))
        quaternions = shaped("attitude", attitude, (len(rows), 4))
        lengths = np.linalg.norm(quaternions, axis=1)
        if not (np.isfinite(position).all() and np.isfinite(velocity).all()):
            raise EstimatorError("position and velocity of a start must be finite")
        if not (np.abs(lengths - 1.0) < 0.1).all():
            raise EstimatorError("attitudes of a start must be unit quaternions")
        quaternions = quaternions / lengths[:, None]
        self._filters[rows] = np.zeros(1, FILTER)
        self._rings[rows] = np.zeros(1, READING)
        self._queues[rows] = np.zeros(1, MEASUREMENT)
        for i, row in enumerate(rows):
            self._begin(row, position[i], velocity[i], quaternions[i], start or self._start[row])
        self._filters["newest_ns"][rows] = stamp_ns
        self._filters["reading"]["stamp_ns"][rows] = stamp_ns
        self._filters["rejected_since_ns"][rows] = -1

    def predict(
        self, rows: ArrayLike, stamp_ns: int, angular_velocity: ArrayLike, specific_force: ArrayLike
    ) -> None:
        """Integrates IMU measurements: (S, 3) rad/s and (S, 3) m/s^2 in the sensors' axes.

        Raises `EstimatorError` at a row whose last measurement is not earlier; the rows before it
        are already integrated.
        """
        rows = checked_rows(rows, len(self))
        gyro = shaped("angular_velocity", angular_velocity, (len(rows), 3))
        accel = shaped("specific_force", specific_force, (len(rows), 3))
        served = predict_rows(
            self._filters,
            self._tunings,
            self._rings,
            self._queues,
            rows,
            int(stamp_ns),
            gyro,
            accel,
            self._work,
        )
        if served < len(rows):
            newest = int(self._filters["newest_ns"][rows[served]])
            raise EstimatorError(
                f"IMU reading of row {rows[served]} at {stamp_ns} ns is not later than the last "
                f"one, at {newest} ns"
            )

    def fuse_gnss(
        self,
        rows: ArrayLike,
        stamp_ns: int,
        position_enu: ArrayLike,
        velocity_enu: ArrayLike,
        variances: ArrayLike,
        valid: ArrayLike | None = None,
    ) -> None:
        """Queues GNSS fixes: position (S, 3) m and velocity (S, 3) m/s of the antenna, map frame.

        variances: (6,) or (S, 6), position then velocity; inf marks a quantity without measurement.
        """
        rows = checked_rows(rows, len(self))
        values = np.zeros((len(rows), 7))
        values[:, :3] = shaped("position_enu", position_enu, (len(rows), 3))
        values[:, 3:6] = shaped("velocity_enu", velocity_enu, (len(rows), 3))
        self._enqueue(rows, stamp_ns, GNSS, values, variances, valid)

    def fuse_pressure_height(
        self,
        rows: ArrayLike,
        stamp_ns: int,
        height: ArrayLike,
        variance: ArrayLike,
        valid: ArrayLike | None = None,
    ) -> None:
        """Queues barometer heights (S,) m; their datum is estimated. variance: () or (S,) m^2."""
        self._fuse_columns(rows, stamp_ns, PRESSURE, [height], variance, valid)

    def fuse_magnetic(
        self,
        rows: ArrayLike,
        stamp_ns: int,
        magnetic_field: ArrayLike,
        variance: ArrayLike,
        valid: ArrayLike | None = None,
    ) -> None:
        """Queues fields (S, 3) in the magnetometers' axes, in the unit of `magnetic_field_map`.

        variance: () or (S,), of each component.
        """
        field = np.asarray(magnetic_field, dtype=np.float64)
        self._fuse_columns(rows, stamp_ns, MAGNETIC, list(field.T), variance, valid)

    def fuse_range(
        self,
        rows: ArrayLike,
        stamp_ns: int,
        ranges: ArrayLike,
        variance: ArrayLike,
        ground_height: ArrayLike,
        valid: ArrayLike | None = None,
    ) -> None:
        """Queues distances (S,) m to flat ground at `ground_height` () or (S,) m in the map.

        Infinite ranges (REP 117) are skipped; the gate rejects uneven ground and obstacles.
        variance: () or (S,) m^2.
        """
        self._fuse_columns(rows, stamp_ns, RANGE, [ranges, ground_height], variance, valid)

    def fuse_pose(
        self,
        rows: ArrayLike,
        stamp_ns: int,
        position: ArrayLike,
        attitude: ArrayLike,
        variances: ArrayLike,
        valid: ArrayLike | None = None,
    ) -> None:
        """Queues poses of the body in the map, such as SLAM's: (S, 3) m and (S, 4) map from body.

        variances: (6,) or (S, 6): x, y, z, m^2, and rotations about the map's axes, rad^2; inf in
        either half skips that half.
        """
        rows = checked_rows(rows, len(self))
        values = np.zeros((len(rows), 7))
        values[:, :3] = shaped("position", position, (len(rows), 3))
        values[:, 3:] = rotations.normalize(shaped("attitude", attitude, (len(rows), 4)))
        self._enqueue(rows, stamp_ns, POSE, values, variances, valid)

    def fuse_velocity(
        self,
        rows: ArrayLike,
        stamp_ns: int,
        velocity_map: ArrayLike,
        variances: ArrayLike,
        valid: ArrayLike | None = None,
    ) -> None:
        """Queues velocities (S, 3) m/s of the body, map frame: of visual odometry, or zero at rest.

        variances: (3,) or (S, 3) (m/s)^2.
        """
        rows = checked_rows(rows, len(self))
        values = np.zeros((len(rows), 7))
        values[:, 3:6] = shaped("velocity_map", velocity_map, (len(rows), 3))
        six = np.zeros((len(rows), 6))
        six[:, 3:] = variances
        self._enqueue(rows, stamp_ns, STATED_VELOCITY, values, six, valid)

    def covariance(self, rows: ArrayLike) -> Array:
        """Returns the covariances (S, STATES, STATES) of the present error states.

        They are ordered as in `records`. Position and velocity are errors in the map, attitude a
        rotation vector in the map (true = exp(error) * estimated).
        """
        rows = checked_rows(rows, len(self))
        out = np.empty((len(rows), STATES * STATES))
        present_covariances(self._filters, self._tunings, self._rings, rows, self._work, out)
        return out.reshape(-1, STATES, STATES)

    def gate(self, aid: AidingSource) -> InnovationGate:
        """Returns views of the gate statistics of an aiding source."""
        return InnovationGate(*(self._filters[name][:, aid] for name in InnovationGate._fields))

    @property
    def restarts(self) -> NDArray[np.int64]:
        """(N,) number of restarts of the position from a GNSS fix or a pose."""
        return np.asarray(self._filters["restarts"])

    @property
    def dropped(self) -> NDArray[np.int64]:
        """(N,) number of measurements dropped because they were late or the queue was full."""
        return np.asarray(self._filters["dropped"])

    def continue_from(self, other: Estimator, pairs: Sequence[tuple[int, int]]) -> None:
        """Copies filters of another estimator: (own row, other's row) for each pair."""
        for own, row in pairs:
            self._filters[own] = other._filters[row]
            self._queues[own] = other._queues[row]
            self._copy_readings(own, other._rings[row])

    def get_state(self) -> dict[str, Any]:
        """Returns copies of filters and queues."""
        return {
            "filters": self._filters.copy(),
            "rings": self._rings.copy(),
            "queues": self._queues.copy(),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a state of `get_state`."""
        self._filters[:] = state["filters"]
        self._rings[:] = state["rings"]
        self._queues[:] = state["queues"]

    def _copy_readings(self, row: int, ring: NDArray[np.void]) -> None:
        """Copies the queued IMU measurements of another ring, whose length may differ."""
        state: Any = self._filters[row]
        waiting = min(int(state["waiting_readings"]), self._rings.shape[1])
        slots = (int(state["first_reading"]) + np.arange(waiting)) % len(ring)
        self._rings[row, :waiting] = ring[slots]
        state["first_reading"], state["waiting_readings"] = 0, waiting

    def _begin(
        self, row: int, position: Array, velocity: Array, attitude: Array, start: StartSigmas
    ) -> None:
        """Initialises one row; the body's initial rates count as zero for the IMU's own motion."""
        own: NDArray[np.void] = self._filters[row]
        arm = rotations.rotate(attitude, self._tunings["imu_arm"][row])
        own["position_map"], own["velocity_map"], own["attitude"] = position, velocity, attitude
        own["position"], own["velocity"], own["rotation"] = position + arm, velocity, attitude
        own["covariance"] = start_covariance(self._settings[row], start, attitude).ravel()

    def _fuse_columns(
        self,
        rows: ArrayLike,
        stamp_ns: int,
        kind: int,
        columns: Sequence[ArrayLike],
        variance: ArrayLike,
        valid: ArrayLike | None,
    ) -> None:
        rows = checked_rows(rows, len(self))
        values, variances = np.zeros((len(rows), 7)), np.zeros((len(rows), 6))
        for k, column in enumerate(columns):
            values[:, k] = column
        variances[:, 0] = variance
        self._enqueue(rows, stamp_ns, kind, values, variances, valid)

    def _enqueue(
        self,
        rows: Rows,
        stamp_ns: int,
        kind: int,
        values: Array,
        variances: ArrayLike,
        valid: ArrayLike | None,
    ) -> None:
        variances = np.array(np.broadcast_to(variances, (len(rows), 6)), np.float64, order="C")
        finite = np.isfinite(values).all(axis=1)
        usable = np.atleast_1d(finite & (variances >= 0.0).all(axis=1))
        if valid is not None:
            usable = np.atleast_1d(usable & np.asarray(valid, dtype=np.bool_))
        enqueue_rows(
            self._filters,
            self._tunings,
            self._queues,
            rows,
            int(stamp_ns),
            kind,
            values,
            variances,
            usable,
        )
