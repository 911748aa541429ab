"""Holds the latest sample of every sensor of a simulation, by reference."""

from __future__ import annotations

import weakref
from collections.abc import Iterable, Sequence
from typing import Any

from volery.engine.engine import SensorBank
from volery.runtime.construction.sensor_suites import SensorInstance
from volery.runtime.vehicles.sample_stream import SampleStream
from volery.sensors.mount import Mount
from volery.sensors.sample_rows import sample_of
from volery.sensors.samples import CameraFrames, JointAngles, Samples, SensorId
from volery.sensors.sensor_samples import SensorSample


class LatestSamples:
    """Holds the last batch of every bank, without copies, and feeds the streams of single sensors.

    A camera renders for a sensor that is requested here, as it does for subscribers of its topics.
    """

    def __init__(self) -> None:
        self._bank_of: dict[int, int] = {}
        """Number of a bank by the identity of its tuple of sensors, which the banks hold."""
        self._banks: tuple[SensorBank, ...] = ()
        self._batches: dict[int, Samples] = {}
        """Last complete batch of each bank."""
        self._single: dict[str, tuple[Samples, int] | None] = {}
        """Batch and row by path, where they are not those of the bank; None: no sample yet."""
        self._sensor_rows: dict[str, tuple[int, int]] = {}
        """Bank and row of each sensor by path."""
        self._mounts: dict[str, Mount] = {}
        self._kinds: dict[str, str] = {}
        """Kinds of the sensors by path."""
        self._names: dict[str, tuple[str, ...]] = {}
        """Names of the sensors by UAV."""
        self._requested: set[str] = set()
        """Paths of cameras that render for readers of `latest`."""
        self._streams: weakref.WeakSet[SampleStream] = weakref.WeakSet()

    # ------------------------------------------------------------------------------- the fleet

    def arrange(self, banks: Sequence[SensorBank], fitted: Iterable[SensorInstance]) -> None:
        """Uses the banks of a changed fleet; the samples of sensors that go on stay."""
        before = {path: self._found(path) for path in self._sensor_rows}
        self._banks = tuple(bank for bank in banks if bank.name != "joints")
        self._bank_of = {id(bank.sensors): k for k, bank in enumerate(self._banks)}
        self._sensor_rows = {
            sensor.path: (k, row)
            for k, bank in enumerate(self._banks)
            for row, sensor in enumerate(bank.sensors)
        }
        self._batches = {}
        self._single = {
            path: before[path] for path in self._sensor_rows if before.get(path) is not None
        }
        self._mounts, self._kinds = {}, {}
        names: dict[str, list[str]] = {}
        for sensor in fitted:
            self._mounts[sensor.id.path] = sensor.mount
            self._kinds[sensor.id.path] = sensor.spec.kind
            names.setdefault(sensor.id.uav_name, []).append(sensor.id.name)
        self._names = {uav: tuple(own) for uav, own in names.items()}
        self._requested &= self._sensor_rows.keys()

    def names(self, uav: str) -> tuple[str, ...]:
        """Returns the names of a UAV's sensors, in the order of its type."""
        return self._names.get(uav, ())

    def forget(self, uav: str) -> None:
        """Removes the samples of a UAV that is reset or deleted."""
        own = f"{uav}/"
        for path in self._sensor_rows:
            if path.startswith(own):
                self._single[path] = None
        for stream in self._streams:
            if stream.path.startswith(own):
                stream.clear()

    # ------------------------------------------------------------------------------ the samples

    def sampled(self, samples: Samples) -> None:
        """Holds the samples of a bank."""
        bank = self._bank_of.get(id(samples.sensors))
        if bank is not None:
            self._batches[bank] = samples
            if self._single:
                for sensor in samples.sensors:
                    self._single.pop(sensor.path, None)
        elif not isinstance(samples, JointAngles):  # without the rows of sensors that send nothing
            for row, sensor in enumerate(samples.sensors):
                self._single[sensor.path] = (samples, row)
        if self._streams:
            self._feed(samples)

    def latest(self, uav: str, sensor: str) -> SensorSample | None:
        """Returns the last sample of a sensor, None before the first."""
        path = f"{uav}/{sensor}"
        found = self._found(path)
        if found is None or not _is_complete(found[0]):
            return None
        return sample_of(*found, self._mounts[path])

    def request(self, uav: str, sensor: str) -> None:
        """Makes a camera render from now on; any other sensor measures anyway."""
        path = f"{uav}/{sensor}"
        if self.is_camera(uav, sensor):
            self._requested.add(path)

    def kind(self, uav: str, sensor: str) -> str:
        """Returns the kind of a sensor, such as `gnss`."""
        return self._kinds[f"{uav}/{sensor}"]

    def is_camera(self, uav: str, sensor: str) -> bool:
        """Returns whether a sensor is a camera."""
        return self._banks[self._sensor_rows[f"{uav}/{sensor}"][0]].name == "camera"

    def requests(self, cameras: Sequence[SensorId]) -> bool:
        """Returns whether samples of any of these cameras are requested here."""
        if not (self._requested or self._streams):
            return False
        paths = self._requested | {stream.path for stream in self._streams}
        return any(camera.path in paths for camera in cameras)

    def open_stream(self, uav: str, sensor: str, **options: Any) -> SampleStream:
        """Returns a queue of a sensor's samples from now on."""
        stream = SampleStream(f"{uav}/{sensor}", self._streams.discard, **options)
        self._streams.add(stream)
        return stream

    # -------------------------------------------------------------------------------- snapshots

    def get_state(self) -> dict[str, Any]:
        """Returns the samples; batches never change, so they are not copied."""
        return {"batches": dict(self._batches), "single": dict(self._single)}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state and empties the streams."""
        self._batches = dict(state["batches"])
        self._single = dict(state["single"])
        for stream in self._streams:
            stream.clear()

    # ----------------------------------------------------------------------------------- inside

    def _found(self, path: str) -> tuple[Samples, int] | None:
        if path in self._single:
            return self._single[path]
        bank, row = self._sensor_rows[path]
        batch = self._batches.get(bank)
        return None if batch is None else (batch, row)

    def _feed(self, samples: Samples) -> None:
        if isinstance(samples, JointAngles) or not _is_complete(samples):
            return
        for stream in tuple(self._streams):
            for row, sensor in enumerate(samples.sensors):
                if sensor.path == stream.path:
                    stream.add(sample_of(samples, row, self._mounts[stream.path]))


def _is_complete(samples: Samples) -> bool:
    """Returns whether all parts of a camera's images were rendered; true for other sensors."""
    if not isinstance(samples, CameraFrames):
        return True
    return bool(samples.colour.size and samples.depth.size and samples.instance.size)
