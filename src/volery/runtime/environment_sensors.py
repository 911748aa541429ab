"""The sensors of one UAV in all environments of a vectorized simulation, by name."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import read_only
from volery.core.errors import SensorError
from volery.runtime.environment_block import EnvironmentBlock
from volery.runtime.vehicles.uav_sensors import find_sensor
from volery.sensors.cameras.camera import Part
from volery.sensors.sample_rows import joined, sample_of
from volery.sensors.samples import Samples


class EnvironmentSensor:
    """One sensor of one UAV in all K environments."""

    def __init__(self, blocks: Sequence[EnvironmentBlock], uav: str, name: str) -> None:
        self._blocks = blocks
        self._uav = uav
        self.name = name
        """Name of the sensor, such as `imu`."""

    @property
    def latest(self) -> Any:
        """The last sample of each environment: a `LidarSample`, `ImuSample`, ...

        All arrays have a first axis of K environments and are read-only; numbers are arrays
        (K,). In environments without a sample since their reset (see `has_sample`) numbers are nan,
        whole numbers 0. Raises `SensorError` before the first sample of all.
        """
        found = [block.latest_rows(self._uav, self.name) for block in self._blocks]
        parts = [(part[0], part[1]) for part in found if part is not None]
        if len(parts) < len(self._blocks):
            raise SensorError(self._without_sample())
        mount = self._blocks[0].mount(self._uav, self.name)
        return sample_of(_without_old(joined(parts), self.has_sample), slice(None), mount)

    @property
    def stamp_ns(self) -> int | None:
        """Time of the last measurement, ns; None before the first."""
        batch = self._batch()
        return None if batch is None else batch.stamp_ns

    @property
    def model(self) -> Any:
        """Model of a LIDAR or camera, that of its samples. Raises `SensorError` before the first.

        Other sensors have none.
        """
        batch = self._batch()
        if batch is None:
            raise SensorError(self._without_sample())
        return getattr(batch, "model", None)

    def request_parts(self, parts: Collection[Part]) -> None:
        """Renders only `parts` of the images of a camera from now on: colour, depth, labels.

        All cameras of the same model, rate and phase render the same parts; others have no pixels.
        Images do not depend on the choice. Raises `SensorError` if the sensor is no camera.
        """
        for block in self._blocks:
            block.request_parts(self._uav, self.name, parts)

    @property
    def has_sample(self) -> NDArray[np.bool_]:
        """(K,) whether each environment has a sample since its start or last reset."""
        found = [block.latest_rows(self._uav, self.name) for block in self._blocks]
        flags = [
            np.zeros(len(block.seeds), np.bool_) if part is None else part[2]
            for part, block in zip(found, self._blocks, strict=True)
        ]
        return np.concatenate(flags)

    def _batch(self) -> Samples | None:
        found = self._blocks[0].latest_rows(self._uav, self.name)
        return None if found is None else found[0]

    def _without_sample(self) -> str:
        return f"sensor '{self.name}' of {self._uav} has no sample yet: run the environments first"

    def __repr__(self) -> str:
        return f"<sensor '{self.name}' of {self._uav} in all environments>"


class EnvironmentSensors(Mapping[str, EnvironmentSensor]):
    """Sensors of one UAV in all environments by name, in the order of the sensor banks."""

    def __init__(self, blocks: Sequence[EnvironmentBlock], uav: str) -> None:
        self._blocks = blocks
        self._uav = uav

    def __getitem__(self, name: str) -> EnvironmentSensor:
        """Returns a sensor by its name, or by its kind if it is the only one of that kind.

        LIDARs and cameras are found by name alone.
        Raises `UnknownSensorError`, a `KeyError`.
        """
        kinds = {own: self._blocks[0].kind(self._uav, own) for own in self}
        return EnvironmentSensor(self._blocks, self._uav, find_sensor(self._uav, name, kinds))

    def __iter__(self) -> Iterator[str]:
        return iter(self._blocks[0].names(self._uav))

    def __len__(self) -> int:
        return len(self._blocks[0].names(self._uav))

    def __repr__(self) -> str:
        return f"<sensors of {self._uav} in all environments: {', '.join(self)}>"


def _without_old(batch: Samples, has_sample: NDArray[np.bool_]) -> Samples:
    """Returns the batch with nan, or 0, in the rows of environments without a sample."""
    if has_sample.all():
        return batch
    changed: dict[str, Any] = {}
    for name, array in vars(batch).items():
        if isinstance(array, np.ndarray):
            changed[name] = array.copy()
            changed[name][~has_sample] = np.nan if array.dtype.kind == "f" else 0
            read_only(changed[name])
    return replace(batch, **changed)
