"""The sensors of one UAV, by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol

from volery.core.errors import CommandError, SensorError
from volery.core.near_names import near_miss
from volery.core.uncopied import Uncopied
from volery.runtime.checks import check_seconds
from volery.runtime.vehicles.sample_stream import SampleStream
from volery.sensors.sensor_samples import SensorSample

_NAMED_ONLY = ("lidar", "camera")
"""Kinds without a usual name: which one is meant may change with the next that is added."""


class UnknownSensorError(SensorError, KeyError):
    """A UAV has no sensor of this name."""

    __str__ = Exception.__str__


class SampleSource(Protocol):
    """Holds the latest samples of sensors; see `LatestSamples`."""

    def names(self, uav: str) -> tuple[str, ...]:
        """Returns the names of a UAV's sensors."""

    def latest(self, uav: str, sensor: str) -> SensorSample | None:
        """Returns the last sample of a sensor, None before the first."""

    def request(self, uav: str, sensor: str) -> None:
        """Makes a camera render from now on."""

    def kind(self, uav: str, sensor: str) -> str:
        """Returns the kind of a sensor, such as `gnss`."""

    def is_camera(self, uav: str, sensor: str) -> bool:
        """Returns whether a sensor is a camera."""

    def open_stream(self, uav: str, sensor: str, **options: Any) -> SampleStream:
        """Returns a queue of a sensor's samples from now on."""


class StreamRuns(Protocol):
    """Advances a simulation for loops over samples."""

    def advance(self, condition: Callable[[], bool], seconds: float | None) -> bool:
        """Advances until `condition()`, or by `seconds`; returns whether it became true.

        Without `seconds`, the run ends at the scenario's end.
        """

    @property
    def time_s(self) -> float:
        """Simulated time, s."""


class UavSensor(Uncopied):
    """One sensor of a UAV: its latest sample, and loops over new samples."""

    def __init__(self, source: SampleSource, runs: StreamRuns | None, uav: str, name: str) -> None:
        self._source = source
        self._runs = runs
        self._uav = uav
        self.name = name
        """Name of the sensor, such as `imu`."""

    @property
    def latest(self) -> Any:
        """The last sample that the sensor has sent: a `LidarSample`, `CameraSample`, ...

        Reading it neither waits nor copies; its arrays are read-only and never change.
        A camera renders for readers from the first reading on. Raises `SensorError` before the
        first sample; `has_sample` asks first.
        """
        _check_exists(self._source, self._uav, self.name)
        self._source.request(self._uav, self.name)
        sample = self._source.latest(self._uav, self.name)
        if sample is None:
            hint = (
                "it renders from now on; run the simulation, or call next()"
                if self._source.is_camera(self._uav, self.name)
                else "run the simulation first, or call next()"
            )
            raise SensorError(f"sensor '{self.name}' of {self._uav} has no sample yet: {hint}")
        return sample

    @property
    def has_sample(self) -> bool:
        """Whether there is a `latest` sample."""
        _check_exists(self._source, self._uav, self.name)
        return self._source.latest(self._uav, self.name) is not None

    def next(self, timeout_s: float = 10.0) -> Any:
        """Advances the simulation to the next sample and returns it.

        A camera renders that image alone. Raises `SensorError` if `timeout_s` of simulated time
        pass without a sample.
        """
        stream = self.samples(seconds=timeout_s)
        try:
            for sample in stream:
                return sample
        finally:
            stream.close()
        raise SensorError(
            f"sensor '{self.name}' of {self._uav} sends no sample within {timeout_s:g} s; "
            "is it dropped by a fault, or the timeout shorter than its period?"
        )

    def samples(self, seconds: float | None = None, *, depth: int | None = None) -> SampleStream:
        """Returns the samples from now on; a loop over them advances the simulation.

        The loop ends after `seconds` of simulated time, or at the scenario's end. `depth` limits
        the queue of samples that wait for the loop: the oldest leave it; None: no limit. See
        `SampleStream`.
        """
        runs = self._runs
        if runs is None:
            raise CommandError(
                "environments advance together; call run() of the VectorizedSimulation and "
                "read `latest`"
            )
        _check_exists(self._source, self._uav, self.name)
        if depth is not None and depth < 1:
            raise CommandError(f"depth must be at least 1, not {depth}")
        if seconds is not None:
            check_seconds(seconds)
        end_s = None if seconds is None else runs.time_s + seconds

        def advance(condition: Callable[[], bool]) -> bool:
            left = None if end_s is None else max(0.0, end_s - runs.time_s)
            return runs.advance(condition, left)

        return self._source.open_stream(self._uav, self.name, advance=advance, depth=depth)

    def __repr__(self) -> str:
        return f"<sensor '{self.name}' of {self._uav}>"


class UavSensors(Uncopied, Mapping[str, UavSensor]):
    """Sensors of one UAV by name, in the order of its type."""

    def __init__(self, source: SampleSource, runs: StreamRuns | None, uav: str) -> None:
        self._source = source
        self._runs = runs
        self._uav = uav

    def __getitem__(self, name: str) -> UavSensor:
        """Returns a sensor by its name, or by its kind if it is the only one of that kind.

        LIDARs and cameras are found by name alone.
        Raises `UnknownSensorError`, a `KeyError`.
        """
        kinds = {own: self._source.kind(self._uav, own) for own in self}
        return UavSensor(self._source, self._runs, self._uav, find_sensor(self._uav, name, kinds))

    def __iter__(self) -> Iterator[str]:
        return iter(self._source.names(self._uav))

    def __len__(self) -> int:
        return len(self._source.names(self._uav))

    def _ipython_key_completions_(self) -> list[str]:
        """Returns the names that Tab offers after `uav.sensors["`."""
        return list(self)

    def __repr__(self) -> str:
        return f"<sensors of {self._uav}: {', '.join(self)}>"


def find_sensor(uav: str, wanted: str, kinds: Mapping[str, str]) -> str:
    """Returns the name of the sensor that `wanted` names; `kinds` are the kinds by name.

    Raises `UnknownSensorError`, a `KeyError`.
    """
    if wanted in kinds:
        return wanted
    found = [name for name, kind in kinds.items() if kind == wanted]
    if len(found) == 1 and wanted not in _NAMED_ONLY:
        return found[0]
    known = ", ".join(kinds) or "none"
    if found:
        names = " or ".join(f"'{name}'" for name in found)
        advice = f"each {wanted} goes by its name, {names}"
        raise UnknownSensorError(f"{uav} has no sensor '{wanted}': {advice}. Known: {known}")
    hint = near_miss(wanted, [*kinds, *kinds.values()])
    raise UnknownSensorError(f"{uav} has no sensor '{wanted}'{hint} Known: {known}")


def _check_exists(source: SampleSource, uav: str, name: str) -> None:
    """Raises `UnknownSensorError` if a UAV has no such sensor, or was deleted."""
    names = source.names(uav)
    if name not in names:
        known = ", ".join(names) or "none"
        raise UnknownSensorError(f"{uav} has no sensor '{name}'; known: {known}")
