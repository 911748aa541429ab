"""GNSS receivers: delayed fixes with noise and drift, lost where signals are denied.

White noise and a Gauss-Markov drift of the position, white noise of the velocity: the model of
PX4's Gazebo classic. The drift continues while a fix is lost. Beyond its limits of altitude and
speed a receiver has no fix; an acceleration beyond its limit ends the tracking of the satellites,
so that the signals must be acquired again.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat, PositiveFloat

from volery.control.fleet import Fleet
from volery.core import rotations
from volery.core.arrays import Array, read_only
from volery.core.clock import NS_PER_S, ns_from_s
from volery.core.errors import CommandError, DataFileError
from volery.core.geodesy import LocalFrame
from volery.sensors.bank import NoisyBank, SensorGroup, rows_of
from volery.sensors.gnss_denial import NOWHERE, GnssDenial
from volery.sensors.model import SensorModel
from volery.sensors.noise import gauss_markov_of_sigma
from volery.sensors.samples import GnssSamples
from volery.vehicle.pose_history import KEPT_NS, PoseHistory, pose_at

FOREVER_NS = np.iinfo(np.int64).max
_LONGEST_DELAY_NS = KEPT_NS - 6_000_000
"""A fix reads poses as old as the delay plus up to two physics steps, one of them for the velocity.
"""


class GnssModel(SensorModel):
    """Delay, noise and drift; see the data files in `models/`."""

    sensor_kind: ClassVar = "GNSS"

    name: str
    delay_s: NonNegativeFloat
    horizontal_noise_m: NonNegativeFloat
    vertical_noise_m: NonNegativeFloat
    horizontal_drift_m: NonNegativeFloat
    """Long-run standard deviation of the drift on each horizontal axis, m."""
    vertical_drift_m: NonNegativeFloat
    drift_correlation_s: PositiveFloat
    horizontal_velocity_noise_m_s: NonNegativeFloat
    vertical_velocity_noise_m_s: NonNegativeFloat
    reacquisition_s: NonNegativeFloat
    """Time from the return of the signals to the next fix."""
    altitude_max_m: PositiveFloat | None = None
    """Altitude above sea level up to which there is a fix; None: unlimited."""
    speed_max_m_s: PositiveFloat | None = None
    """Speed up to which there is a fix; None: unlimited."""
    acceleration_max_m_s2: PositiveFloat | None = None
    """Acceleration, mean from fix to fix, that tracking withstands; None: unlimited."""


class GnssBank(NoisyBank):
    """All receivers of one model, rate and phase.

    A fix is sampled `lag_ns` after its time, from the fleet's pose history, and carries that time.

    Raises `DataFileError` if the model's delay exceeds the pose history.
    """

    name = "gnss"
    _SAVED = (
        "_drift",
        "_fix_from_ns",
        "_denied_from_ns",
        "_denied_until_ns",
        "_velocity_before",
    )

    def __init__(
        self,
        model: GnssModel,
        group: SensorGroup,
        frame: LocalFrame,
        denial: GnssDenial = NOWHERE,
    ) -> None:
        super().__init__(group, at_start=3, per_measurement=9)
        self.lag_ns = ns_from_s(model.delay_s)
        if self.lag_ns > _LONGEST_DELAY_NS:
            raise DataFileError(
                f"GNSS model '{model.name}': delay_s may be {_LONGEST_DELAY_NS / NS_PER_S} s at "
                f"most, not {model.delay_s}"
            )
        self._frame = frame
        self._denial = denial
        self._lever_body = group.position_body
        self._reacquisition_ns = ns_from_s(model.reacquisition_s)
        self._white = _east_north_up(model.horizontal_noise_m, model.vertical_noise_m)
        self._velocity_noise = _east_north_up(
            model.horizontal_velocity_noise_m_s, model.vertical_velocity_noise_m_s
        )
        self._wander = gauss_markov_of_sigma(
            _east_north_up(model.horizontal_drift_m, model.vertical_drift_m),
            model.drift_correlation_s,
            group.schedule.period_ns / NS_PER_S,
        )
        self._highest_m = (model.altitude_max_m or math.inf) - frame.altitude_m
        self._fastest_m_s = model.speed_max_m_s or math.inf
        period_s = group.schedule.period_ns / NS_PER_S
        self._largest_change_m_s = (model.acceleration_max_m_s2 or math.inf) * period_s
        self._velocity_before = np.full((len(group.sensors), 3), np.nan)
        self._drift = self._wander.sigma * self._noise.start()
        self._fix_from_ns = np.zeros(len(group.sensors), np.int64)
        self._denied_from_ns = np.full(len(group.sensors), FOREVER_NS)
        self._denied_until_ns = np.full(len(group.sensors), FOREVER_NS)

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> GnssSamples:
        """Returns fix number `k` of all receivers, in the map frame; see `Bank`."""
        position, velocity = _antennas(fleet.history, self._rows, self._lever_body, time_ns)
        has_fix = self._acquire(time_ns, position, velocity)
        noise = self._noise.measurement(k)
        position += self._drift + self._white * noise[:, :3]
        velocity += self._velocity_noise * noise[:, 3:6]
        self._drift = self._wander.decay * self._drift + self._wander.step * noise[:, 6:]
        position[~has_fix] = np.nan
        velocity[~has_fix] = np.nan
        known = 1.0 if self._noise.enabled else 0.0
        shape = position.shape
        return GnssSamples(
            self.sensors,
            time_ns,
            self._frame,
            read_only(has_fix),
            read_only(position),
            read_only(velocity),
            read_only(np.full(shape, known * (self._wander.sigma**2 + self._white**2))),
            read_only(np.full(shape, known * self._velocity_noise**2)),
        )

    def deny(self, uav: int, since_ns: int, until_ns: int = FOREVER_NS) -> None:
        """Denies signals to a UAV (a row of the fleet) for fixes of since_ns <= t < until_ns.

        Fixes return the reacquisition time after the last denied instant. A second call replaces
        the first. Raises `CommandError` if the UAV has no receiver in this bank or the interval is
        empty.
        """
        rows = rows_of(self._rows, np.array([uav]))
        if not len(rows):
            raise CommandError(f"UAV row {uav} has no GNSS receiver in this bank")
        if not since_ns < until_ns:
            raise CommandError(f"a denial must end after it begins, not {since_ns}..{until_ns} ns")
        self._denied_from_ns[rows] = since_ns
        self._denied_until_ns[rows] = until_ns

    def allow(self, uav: int, time_ns: int) -> None:
        """Restores the signals of UAV row `uav`; a denial that begins later is unchanged."""
        rows = rows_of(self._rows, np.array([uav]))
        begun = rows[self._denied_from_ns[rows] <= time_ns]
        self._denied_until_ns[begun] = np.minimum(self._denied_until_ns[begun], time_ns)

    def _switch_on(self, rows: NDArray[np.int64], time_ns: int) -> None:  # noqa: ARG002
        """Draws a new drift and provides a fix at once."""
        self._drift[rows] = (self._wander.sigma * self._noise.start())[rows]
        self._fix_from_ns[rows] = 0
        self._velocity_before[rows] = np.nan
        self._denied_from_ns[rows] = FOREVER_NS
        self._denied_until_ns[rows] = FOREVER_NS

    def _acquire(self, time_ns: int, position: Array, velocity: Array) -> NDArray[np.bool_]:
        """Returns (S,) whether a receiver has a fix at `time_ns`; records lost fixes.

        `position` (S, 3) m and `velocity` (S, 3) m/s are those of the antennas in the map frame.
        """
        lost = self._denial.covers(position)
        lost |= (self._denied_from_ns <= time_ns) & (time_ns < self._denied_until_ns)
        lost |= _norms(velocity - self._velocity_before) > self._largest_change_m_s
        self._velocity_before = velocity.copy()
        self._fix_from_ns[lost] = time_ns + self._reacquisition_ns
        is_within = (position[:, 2] <= self._highest_m) & (_norms(velocity) <= self._fastest_m_s)
        return np.asarray(~lost & is_within & (time_ns >= self._fix_from_ns))


def _antennas(
    history: PoseHistory, rows: NDArray[np.int64], lever_body: Array, time_ns: int
) -> tuple[Array, Array]:
    """Returns antenna positions (S, 3) m and velocities (S, 3) m/s, mean over a physics step."""
    before_ns = max(time_ns - history.dt_ns, 0)
    now = _antenna_positions(history, rows, lever_body, time_ns)
    before = _antenna_positions(history, rows, lever_body, before_ns)
    elapsed_s = max(time_ns - before_ns, 1) / NS_PER_S
    return now, (now - before) / elapsed_s


def _antenna_positions(
    history: PoseHistory, rows: NDArray[np.int64], lever_body: Array, time_ns: int
) -> Array:
    poses = np.array([pose_at(history, row, time_ns) for row in rows])
    return poses[:, :3] + rotations.rotate(poses[:, 3:], lever_body)


def _east_north_up(horizontal: float, vertical: float) -> Array:
    return np.array([horizontal, horizontal, vertical])


def _norms(vectors: Array) -> Array:
    """Returns the lengths (S,) of `vectors` (S, 3)."""
    return np.asarray(np.sqrt((vectors * vectors).sum(axis=1)))
