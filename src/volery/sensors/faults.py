"""Sensor faults: one fault table per bank, applied to its samples.

A faulty sensor continues to measure internally, so that a fault does not change the noise of later
measurements.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.control.fleet import Fleet
from volery.core.arrays import Array, read_only
from volery.core.clock import Schedule
from volery.core.errors import CommandError
from volery.sensors.bank import Bank, rows_of, uav_rows
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


class FaultTable:
    """Faults of the S sensors of a bank, at most one each.

    `measured` names the quantities that a bias is added to and the numbers that a bias of each has,
    such as `{"ranges": 1}`: see `MEASURED` of the samples.
    """

    def __init__(self, sensors: tuple[SensorId, ...], measured: Mapping[str, int]) -> None:
        self._sensors = sensors
        self._measured = dict(measured)
        self._kind = np.zeros(len(sensors), np.int64)
        self._bias = np.zeros((len(sensors), sum(measured.values())))
        self._known = np.zeros(len(sensors), np.bool_)
        """(S,) whether a sensor has measured since its start."""
        self._last: Arrays | Samples = {}
        """The last output of the table, or its arrays by name of the quantity; rows are sensors."""
        self._is_quiet = False
        """Whether no sensor fails and all have measured: the usual case."""

    def set(self, row: int, kind: FaultKind | str, value: ArrayLike | None = None) -> None:
        """Makes sensor `row` of the bank fail from its next measurement on.

        `kind` may be a name: none, dropped, stuck, biased. A bias needs `value`: one number for
        each measured component (an IMU: three rates in rad/s, three forces in m/s^2), or a single
        number for a sensor that measures one quantity. Raises `CommandError` for an unknown row or
        kind, a missing, superfluous or malformed value.
        """
        if not 0 <= row < len(self._sensors):
            raise CommandError(f"no sensor in row {row}: the bank has {len(self._sensors)}")
        fault = _kind_of(kind)
        if (fault is FaultKind.BIASED) != (value is not None):
            raise CommandError(f"fault {fault.name.lower()}: a value belongs to biased only")
        self._bias[row] = 0.0 if value is None else self._checked(value)
        self._kind[row] = fault
        self._is_quiet = False

    def clear(self, row: int) -> None:
        """Removes the fault of sensor `row`."""
        self.set(row, FaultKind.NONE)

    def kind(self, row: int) -> FaultKind:
        """Returns the present fault of sensor `row`."""
        return FaultKind(int(self._kind[row]))

    def apply(self, samples: Samples) -> Samples:
        """Returns the samples with the faults applied; rows of dropped sensors are removed."""
        if self._is_quiet:
            self._last = samples
            return samples
        arrays = _arrays_of(samples)
        failing = bool(self._kind.any())
        if failing:
            changed = self._bias_of(arrays)
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
            "kind": self._kind.copy(),
            "bias": self._bias.copy(),
            "known": self._known.copy(),
            "last": {name: array.copy() for name, array in _arrays_of(self._last).items()},
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""
        self._kind = np.array(state["kind"])
        self._bias = np.array(state["bias"])
        self._known = np.array(state["known"])
        self._last = {name: read_only(np.array(array)) for name, array in state["last"].items()}
        self._is_quiet = False

    def reset(self, rows: NDArray[np.int64]) -> None:
        """Removes the faults and last measurements of the sensors `rows` (R,)."""
        self._kind[rows] = FaultKind.NONE
        self._bias[rows] = 0.0
        self._known[rows] = False
        self._is_quiet = False

    def _checked(self, value: ArrayLike) -> Array:
        try:
            bias = np.atleast_1d(np.asarray(value, dtype=np.float64))
        except (TypeError, ValueError):
            raise CommandError(f"fault biased: value must be numbers, not {value!r}") from None
        numbers = self._bias.shape[1]
        allowed = (1, numbers) if len(self._measured) == 1 else (numbers,)
        if bias.ndim != 1 or len(bias) not in allowed or not np.isfinite(bias).all():
            wanted = " or ".join(str(n) for n in sorted(set(allowed)))
            what = ", ".join(f"{name} ({count})" for name, count in self._measured.items())
            raise CommandError(
                f"fault biased: the bias must be {wanted} finite numbers for {what}, not {value!r}"
            )
        return bias

    def _bias_of(self, arrays: Arrays) -> Arrays:
        """Returns the measured quantities with biases added; empty without a biased sensor."""
        rows = np.flatnonzero(self._kind == FaultKind.BIASED)
        changed: Arrays = {}
        first = 0
        for name, count in self._measured.items():
            bias = self._bias[:, first : first + count]
            first += count
            if len(rows):
                array = arrays[name].copy()
                each = bias[rows] if count > 1 else bias[rows].reshape(-1, *[1] * (array.ndim - 1))
                array[rows] += each.astype(array.dtype)
                changed[name] = read_only(array)
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

    def __init__(self, bank: Bank, measured: Mapping[str, int]) -> None:
        self.bank = bank
        self.faults = FaultTable(bank.sensors, measured)

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

    def is_wanted(self) -> bool:
        """Returns whether to sample; only camera banks are skipped without receivers."""
        asks = getattr(self.bank, "is_wanted", None)
        return asks is None or bool(asks())

    @property
    def sensors(self) -> tuple[SensorId, ...]:
        """Sensors of the bank, row by row."""
        return self.bank.sensors

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> Samples:
        """Returns measurement number `k` with the faults applied; see `Bank.sample`."""
        return self.faults.apply(self.bank.sample(k, time_ns, fleet))

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
        self.faults.reset(rows_of(uav_rows(self.sensors), uavs))


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
