"""Interface of sensor banks, and code that banks share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.core.arrays import Array
from volery.core.clock import Schedule
from volery.core.compiled import brief_kernel
from volery.sensors.mount import Mount
from volery.sensors.noise import NoiseStreams
from volery.sensors.samples import Samples, SensorId


class SensorGroup(NamedTuple):
    """S sensors of one kind, model, rate and phase, which a bank samples together."""

    schedule: Schedule
    sensors: tuple[SensorId, ...]
    mounts: tuple[Mount, ...]
    """Their mounts on the UAVs."""
    keys: NDArray[np.uint64] | None = None
    """(S,) noise streams; None for sensors without noise."""

    @property
    def position_body(self) -> Array:
        """Positions of the sensor frames in the body frame (FLU), (S, 3) m."""
        return np.array([mount.position_body for mount in self.mounts])

    @property
    def attitude_body(self) -> Array:
        """Attitudes of the sensor frames in the body frame, (S, 4)."""
        return np.array([mount.attitude_body for mount in self.mounts])


class Bank(Protocol):
    """Samples all sensors of one kind, model, rate and phase together.

    Measurements are numbered from k = 0 at the schedule's phase. The result depends on k, the time
    and the fleet alone: it does not change with the slicing of a run or with other UAVs.
    """

    @property
    def name(self) -> str:
        """Kind of the sensors, such as `imu`."""

    @property
    def schedule(self) -> Schedule:
        """Rate and phase of the measurements."""

    @property
    def lag_ns(self) -> int:
        """Delay until a measurement is available, ns: a LIDAR's sweep, a GNSS's delay."""

    @property
    def sensors(self) -> tuple[SensorId, ...]:
        """Sensors of the bank; row i of every sample array belongs to `sensors[i]`."""

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> Samples:
        """Returns measurement number `k` of all S sensors of the bank.

        `time_ns` is the time of the measurement (of the first beam or image row, for sweeps), ns on
        the simulation's clock; the call follows `lag_ns` later. `fleet` holds the present state and
        the pose history. The arrays of the result have one row per sensor, in the order of
        `sensors`, are new and read-only; units and frames are those of the classes in `samples`. A
        bank with noise that drifts expects increasing `k`.
        """

    def get_state(self) -> dict[str, Any]:
        """Returns all variable state as plain data: dictionaries of copied arrays."""

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a state of `get_state`; the same measurements follow."""

    def reset(
        self,
        uavs: NDArray[np.int64] | None,
        keys: NDArray[np.uint64] | None,
        time_ns: int,
        k: int,
    ) -> None:
        """Resets the sensors of some UAVs, after the fleet has been reset.

        `uavs` (U,) are rows of the fleet; None means all. `keys` hold one noise stream for each
        reset sensor, in the order of `sensors`; None leaves the streams unchanged, and a bank
        without noise ignores them. From `time_ns` on, with measurement number `k` as their first,
        the sensors measure like those of a new bank. Quantities that depend on the clock alone,
        such as the angle of a nodding mount, continue.
        """


class Memoryless:
    """A bank whose measurements depend on the fleet's state alone: without state of its own."""

    def __init__(self, group: SensorGroup) -> None:
        self.schedule = group.schedule
        self.sensors = group.sensors
        self._rows = uav_rows(group.sensors)

    def get_state(self) -> dict[str, Any]:
        """Returns an empty state."""
        return {}

    def set_state(self, state: dict[str, Any]) -> None:
        """Does nothing: the bank has no state."""

    def reset(
        self,
        uavs: NDArray[np.int64] | None,
        keys: NDArray[np.uint64] | None,
        time_ns: int,
        k: int,
    ) -> None:
        """Does nothing: the bank has no state."""


class NoisyBank:
    """A bank whose sensors have noise streams, and may have state between measurements.

    `NoiseStreams` explains `at_start` and `per_measurement`. State is held in arrays (S, ...),
    attributes that a subclass names in `_SAVED` and resets in `_switch_on`; saving, restoring and
    resetting follow from these.
    """

    _SAVED: ClassVar[tuple[str, ...]] = ()

    def __init__(self, group: SensorGroup, *, at_start: int = 0, per_measurement: int = 0) -> None:
        self.schedule = group.schedule
        self.sensors = group.sensors
        self._rows = uav_rows(group.sensors)
        self._noise = NoiseStreams(
            group.keys, len(group.sensors), at_start=at_start, per_measurement=per_measurement
        )

    def _switch_on(self, rows: NDArray[np.int64], time_ns: int) -> None:
        """Resets the state of the sensors `rows` (R,) to that at their start, `time_ns`."""

    def get_state(self) -> dict[str, Any]:
        """Returns the noise streams and copies of the sensors' state."""
        kept = {name.lstrip("_"): getattr(self, name).copy() for name in self._SAVED}
        return {"noise": self._noise.get_state(), **kept}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a state of `get_state`."""
        self._noise.set_state(state["noise"])
        for name in self._SAVED:
            setattr(self, name, np.array(state[name.lstrip("_")]))

    def reset(
        self,
        uavs: NDArray[np.int64] | None,
        keys: NDArray[np.uint64] | None,
        time_ns: int,
        k: int,
    ) -> None:
        """Resets noise and state of the sensors of some UAVs; see `Bank.reset`."""
        rows = rows_of(self._rows, uavs)
        self._noise.restart(rows, keys, k)
        self._switch_on(rows, time_ns)


@brief_kernel
def saturate(readings: Array, full_scale: Array) -> None:
    """Cuts `readings` (S, M) in place at the full scale (M,), inf without one, of each column."""
    for i in range(readings.shape[0]):
        for j in range(readings.shape[1]):
            if readings[i, j] > full_scale[j]:
                readings[i, j] = full_scale[j]
            elif readings[i, j] < -full_scale[j]:
                readings[i, j] = -full_scale[j]


def uav_rows(sensors: Sequence[SensorId]) -> NDArray[np.int64]:
    """Returns the UAV of each sensor, (S,) rows of the fleet."""
    return np.array([sensor.uav for sensor in sensors], dtype=np.int64)


def rows_of(uav_of_row: NDArray[np.int64], uavs: NDArray[np.int64] | None) -> NDArray[np.int64]:
    """Returns the rows of a bank that belong to `uavs`, in order; all rows for None."""
    if uavs is None:
        return np.arange(len(uav_of_row))
    return np.flatnonzero(np.isin(uav_of_row, uavs))
