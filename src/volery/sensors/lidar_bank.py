"""All LIDARs of one model and phase, swept together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.core.clock import Schedule
from volery.core.errors import DataFileError
from volery.sensors.lidar import make_batch, sample_echoes, stack_mounts
from volery.sensors.lidar_model import LidarModel
from volery.sensors.mount import Mount
from volery.sensors.samples import LidarScans, SensorId, owned
from volery.vehicle.pose_history import KEPT_NS
from volery.world.scene import Scene

_LONGEST_SWEEP_NS = KEPT_NS - 10_000_000


class LidarBank:
    """One batch of rays for all LIDARs that are due; `keys` (S,) are their noise streams, or None.

    A scan is known when its sweep has ended: it is sampled `lag_ns` after its first beam, from the
    poses that the fleet's history kept. A bank holds nothing that changes: patterns, noise and
    warm-up follow from the scan's number and time.
    """

    name = "lidar"

    def __init__(
        self,
        model: LidarModel,
        schedule: Schedule,
        sensors: tuple[SensorId, ...],
        mounts: tuple[Mount, ...],
        keys: NDArray[np.uint64] | None,
        scene: Scene,
        *,
        intensities: bool = False,
    ) -> None:
        if model.sweep_duration_ns > _LONGEST_SWEEP_NS:
            raise DataFileError(
                f"LIDAR model '{model.name}': a sweep may take "
                f"{_LONGEST_SWEEP_NS / 1e9} s at most, not {model.sweep_duration_ns / 1e9}"
            )
        self.schedule = schedule
        self.sensors = sensors
        self.lag_ns = model.sweep_duration_ns
        self._model = model if keys is not None else model.without_noise()
        self._keys = np.zeros(len(sensors), np.uint64) if keys is None else keys
        self._scene = scene
        self._intensities = intensities
        self._rows = np.array([s.uav for s in sensors])
        self._mounts = stack_mounts(mounts)

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> LidarScans:
        """Scan number k of all LIDARs of the bank; `time_ns` is that of the first beam."""
        batch = make_batch(
            self._rows, np.arange(len(self._rows)), time_ns, self._keys, k, self._mounts
        )
        echoes = sample_echoes(
            self._scene, self._model, batch, fleet.history, intensities=self._intensities
        )
        return LidarScans(
            self.sensors,
            time_ns,
            self._model,
            k,
            owned(echoes.ranges),
            owned(echoes.intensities),
        )
