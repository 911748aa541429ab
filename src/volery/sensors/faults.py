"""Sensor faults: one fault table per bank, applied to its samples.

A faulty sensor continues to measure internally, so that a fault does not change the noise of later
measurements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.control.fleet import Fleet
from volery.core.arrays import Array, read_only
from volery.core.clock import Schedule
from volery.core.errors import CommandError
from volery.core.rng import stream_key
from volery.sensors.bank import Bank, rows_of, uav_rows
from volery.sensors.noise import NoiseStreams
from volery.sensors.samples import Samples, SensorId

Arrays = dict[str, Any]
"""Quantities by name, each (S, ...): row i belongs to sensor i."""


class FaultKind(IntEnum):
    """Kinds of sensor faults."""

    NONE = 0
    DROPPED = 1
    """The sensor sends nothing."""
    STUCK = 2
    """The sensor repeats its last measurement, with new stamps."""
    BIASED = 3
    """A constant is added to the measurements."""
    NOISY = 4
    """Gaussian noise is added to the measurements, white from one to the next."""


_WITH_VALUE = {FaultKind.BIASED: "bias", FaultKind.NOISY: "sigma"}
"""Kinds that have a value, and its name."""


class FaultTable:
    """Faults of the S sensors of a bank, at most one each.

    `measured` names the quantities that a bias or noise is added to and the numbers that a bias of
    each has, such as `{"ranges": 1}`: see `MEASURED` of the samples. `keys` (S,) are the sensors'
    noise streams, which sensors without noise have as well: the noise of faults comes from streams
    of its own, named after them.
    """

    def __init__(
        self,
        sensors: tuple[SensorId, ...],
        measured: Mapping[str, int],
        keys: Sequence[np.uint64] | NDArray[np.uint64],
    ) -> None:
        self._sensors = sensors
        self._measured = dict(measured)
        self._keys = np.array(keys, np.uint64)
        self._kind = np.zeros(len(sensors), np.int64)
        self._value = np.zeros((len(sensors), sum(measured.values())))
        """(S, numbers) bias, or standard deviation of the noise."""
        self._known = np.zeros(len(sensors), np.bool_)
        """(S,) whether a sensor has measured since its start."""
        self._last: Arrays | Samples = {}
        """The last output of the table, or its arrays by name of the quantity; rows are sensors."""
        self._is_quiet = False
        """Whether no sensor fails and all have measured: the usual case."""

    def set(self, row: int, kind: FaultKind | str, value: ArrayLike | None = None) -> None:
        """Makes sensor `row` of the bank fail from its next measurement on.

        `kind` may be a name: none, dropped, stuck, biased, noisy. The last two need `value`, the
        bias or the standard deviation: one number for each measured component (an IMU: three rates
        in rad/s, three forces in m/s^2), or a single number for a sensor that measures one
        quantity. Raises `CommandError` for an unknown row or kind, a missing, superfluous or
        malformed value.
        """
        if not 0 <= row < len(self._sensors):
            raise CommandError(f"no sensor in row {row}: the bank has {len(self._sensors)}")
        fault = _kind_of(kind)
        if (fault in _WITH_VALUE) != (value is not None):
            only = "a value belongs to biased and noisy only"
            raise CommandError(f"fault {fault.name.lower()}: {only}")
        self._value[row] = 0.0 if value is None else self._checked(fault, value)
        self._kind[row] = fault
        self._is_quiet = False

    def clear(self, row: int) -> None:
        """Removes the fault of sensor `row`."""
        self.set(row, FaultKind.NONE)

    def kind(self, row: int) -> FaultKind:
        """Returns the present fault of sensor `row`."""
        return FaultKind(int(self._kind[row]))

    def apply(self, samples: Samples, k: int) -> Samples:
        """Returns measurement number `k` with the faults applied, without dropped sensors."""
        if self._is_quiet:
            self._last = samples
            return samples
        arrays = _arrays_of(samples)
        failing = bool(self._kind.any())
        if failing:
            changed = self._disturb(arrays, k)
            changed |= self._repeat({**arrays, **changed})
            arrays |= changed
            samples = replace(samples, **changed)
        self._last = arrays
        self._known[:] = True
        self._is_quiet = not failing
        dropped = self._kind == FaultKind.DROPPED
        return _without(samples, arrays, dropped) if dropped.any() else samples

    def get_state(self) -> dict[str, Any]:
        """Returns copies of the faults and of the last measurements."""
        return {
            "keys": self._keys.copy(),
            "kind": self._kind.copy(),
            "value": self._value.copy(),
            "known": self._known.copy(),
            "last": {name: array.copy() for name, array in _arrays_of(self._last).items()},
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""
        self._keys = np.array(state["keys"])
        self._kind = np.array(state["kind"])
        self._value = np.array(state["value"])
        self._known = np.array(state["known"])
        self._last = {name: read_only(np.array(array)) for name, array in state["last"].items()}
        self._is_quiet = False

    def reset(self, rows: NDArray[np.int64], keys: NDArray[np.uint64] | None = None) -> None:
        """Removes the faults and last measurements of the sensors `rows` (R,).

        `keys` (R,) are their new noise streams; None leaves the streams unchanged.
        """
        if keys is not None:
            self._keys[rows] = keys
        self._kind[rows] = FaultKind.NONE
        self._value[rows] = 0.0
        self._known[rows] = False
        self._is_quiet = False

    def _checked(self, fault: FaultKind, value: ArrayLike) -> Array:
        name = fault.name.lower()
        try:
            given = np.atleast_1d(np.asarray(value, dtype=np.float64))
        except (TypeError, ValueError):
            raise CommandError(f"fault {name}: value must be numbers, not {value!r}") from None
        numbers = self._value.shape[1]
        allowed = (1, numbers) if len(self._measured) == 1 else (numbers,)
        if given.ndim != 1 or len(given) not in allowed or not np.isfinite(given).all():
            wanted = " or ".join(str(n) for n in sorted(set(allowed)))
            what = ", ".join(f"{name} ({count})" for name, count in self._measured.items())
            raise CommandError(
                f"fault {name}: the {_WITH_VALUE[fault]} must be {wanted} finite numbers for "
                f"{what}, not {value!r}"
            )
        if fault is FaultKind.NOISY and (given < 0.0).any():
            raise CommandError(f"fault {name}: sigma must not be negative, as in {value!r}")
        return given

    def _disturb(self, arrays: Arrays, k: int) -> Arrays:
        """Returns the measured quantities with biases and noise; empty without such a sensor."""
        rows = np.flatnonzero(np.isin(self._kind, tuple(_WITH_VALUE)))
        changed: Arrays = {}
        if not len(rows):
            return changed
        sizes = [arrays[name].size // len(self._sensors) for name in self._measured]
        factors = np.ones((len(rows), sum(sizes)))
        noisy = self._kind[rows] == FaultKind.NOISY
        keys = [stream_key(int(key), "fault") for key in self._keys[rows[noisy]]]
        streams = NoiseStreams(
            np.array(keys, np.uint64), len(keys), per_measurement=factors.shape[1]
        )
        factors[noisy] = streams.measurement(k)
        first, start = 0, 0
        for (name, count), size in zip(self._measured.items(), sizes, strict=True):
            array = arrays[name].copy()
            value = self._value[rows, first : first + count]
            each = value if count > 1 else value.reshape(-1, *[1] * (array.ndim - 1))
            drawn = factors[:, start : start + size].reshape(array[rows].shape)
            array[rows] += (each * drawn).astype(array.dtype)
            changed[name] = read_only(array)
            first, start = first + count, start + size
        return changed

    def _repeat(self, arrays: Arrays) -> Arrays:
        """Returns the quantities with stuck sensors' last values; empty without a stuck sensor."""
        rows = np.flatnonzero((self._kind == FaultKind.STUCK) & self._known)
        changed: Arrays = {}
        last = _arrays_of(self._last)
        for name, array in arrays.items():
            if len(rows) and last[name].shape == array.shape:
                mixed = array.copy()
                mixed[rows] = last[name][rows]
                changed[name] = read_only(mixed)
        return changed


class FaultableBank:
    """A bank whose sensors can fail; it wraps another bank."""

    def __init__(self, bank: Bank, measured: Mapping[str, int], keys: Sequence[np.uint64]) -> None:
        self.bank = bank
        self.faults = FaultTable(bank.sensors, measured, keys)

    @property
    def name(self) -> str:
        """Kind of the sensors."""
        return self.bank.name

    @property
    def schedule(self) -> Schedule:
        """Rate and phase of the measurements."""
        return self.bank.schedule

    @property
    def lag_ns(self) -> int:
        """Delay from a measurement's time to its availability, ns."""
        return self.bank.lag_ns

    @property
    def wanted(self) -> Callable[[], bool] | None:
        """Returns whether to sample; None: always. Only cameras are skipped without receivers."""
        return getattr(self.bank, "is_wanted", None)

    @property
    def sensors(self) -> tuple[SensorId, ...]:
        """Sensors of the bank, row by row."""
        return self.bank.sensors

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> Samples:
        """Returns measurement number `k` with the faults applied; see `Bank.sample`."""
        return self.faults.apply(self.bank.sample(k, time_ns, fleet), k)

    def sample_rows(self, rows: NDArray[np.int64], k: int, time_ns: int, fleet: Fleet) -> Samples:
        """Returns what `sample` returns for the sensors `rows` (R,); others may have anything.

        Cameras render the images of `rows` alone.
        """
        sample = getattr(self.bank, "sample_rows", None)
        if sample is None:
            return self.sample(k, time_ns, fleet)
        return self.faults.apply(sample(rows, k, time_ns, fleet), k)

    def get_state(self) -> dict[str, Any]:
        """Returns the state of the bank and its faults."""
        return {"bank": self.bank.get_state(), "faults": self.faults.get_state()}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a state of `get_state`."""
        self.bank.set_state(state["bank"])
        self.faults.set_state(state["faults"])

    def reset(
        self,
        uavs: NDArray[np.int64] | None,
        keys: NDArray[np.uint64] | None,
        time_ns: int,
        k: int,
    ) -> None:
        """Resets the sensors of some UAVs and removes their faults; see `Bank.reset`."""
        self.bank.reset(uavs, keys, time_ns, k)
        self.faults.reset(rows_of(uav_rows(self.sensors), uavs), keys)


def _arrays_of(samples: Arrays | Samples) -> Arrays:
    """Returns the arrays by name of the quantity."""
    if isinstance(samples, dict):
        return samples
    return {n: v for n, v in vars(samples).items() if isinstance(v, np.ndarray)}


def _kind_of(kind: FaultKind | str) -> FaultKind:
    try:
        return FaultKind[kind.upper()] if isinstance(kind, str) else FaultKind(kind)
    except (KeyError, ValueError):
        known = ", ".join(k.name.lower() for k in FaultKind)
        raise CommandError(f"no sensor fault {kind!r}; known: {known}") from None


def _without(samples: Samples, arrays: Arrays, dropped: NDArray[np.bool_]) -> Samples:
    kept = np.flatnonzero(~dropped)
    left: Arrays = {name: read_only(array[kept]) for name, array in arrays.items()}
    sensors = tuple(samples.sensors[i] for i in kept)
    return replace(samples, sensors=sensors, **left)
