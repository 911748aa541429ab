"""The bank of all LIDARs of one model and phase."""

from __future__ import annotations

import numpy as np

from volery.control.fleet import Fleet
from volery.core.arrays import read_only
from volery.core.errors import DataFileError
from volery.sensors.bank import NoisyBank, SensorGroup
from volery.sensors.lidar.lidar import make_batch, sample_echoes, stack_mounts
from volery.sensors.lidar.lidar_model import LidarModel
from volery.sensors.lidar.particle_echoes import ParticleTable, particle_table
from volery.sensors.samples import LidarScans
from volery.vehicle.pose_history import KEPT_NS
from volery.world.scene import Scene
from volery.world.weather import CLEAR_AIR, Particles

_LONGEST_SWEEP_NS = KEPT_NS - 10_000_000


class LidarBank(NoisyBank):
    """Sweeps all LIDARs of one model and phase in one batch of rays.

    A scan is sampled `lag_ns` after its first beam, when its sweep has ended, from the fleet's pose
    history. Noise depends on the number of a LIDAR's scan since its start; warm-up and the pattern
    of a rosette, which never repeats, depend on the clock.

    Raises `DataFileError` if a sweep takes longer than the pose history reaches.
    """

    name = "lidar"

    def __init__(
        self, model: LidarModel, group: SensorGroup, scene: Scene, *, intensities: bool = False
    ) -> None:
        if model.sweep_duration_ns > _LONGEST_SWEEP_NS:
            raise DataFileError(
                f"LIDAR model '{model.name}': a sweep may take "
                f"{_LONGEST_SWEEP_NS / 1e9} s at most, not {model.sweep_duration_ns / 1e9}"
            )
        super().__init__(group)
        self.lag_ns = model.sweep_duration_ns
        self.model = model if group.keys is not None else model.without_noise()
        """Model of the LIDARs; an exact one without noise."""
        self._scene = scene
        self._intensities = intensities
        self._mounts = stack_mounts(group.mounts)
        self._particles: Particles = CLEAR_AIR
        self._air: ParticleTable | None = None

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> LidarScans:
        """Returns scan number `k` of all LIDARs; `time_ns` is the time of the first beam."""
        numbers = k - self._noise.first_k if self.model.scan.is_fixed else k
        batch = make_batch(
            self._rows, np.arange(len(self._rows)), time_ns, self._noise.keys, numbers, self._mounts
        )
        echoes = sample_echoes(
            self._scene,
            self.model,
            batch,
            fleet.history,
            intensities=self._intensities,
            air=self._air_of(fleet.weather.particles),
        )
        return LidarScans(
            self.sensors,
            time_ns,
            self.model,
            k,
            read_only(echoes.ranges),
            read_only(echoes.intensities),
        )

    def _air_of(self, particles: Particles) -> ParticleTable | None:
        """Returns the particle table of this model, rebuilt when the particles change."""
        if particles != self._particles:
            clear = particles == CLEAR_AIR
            self._air = None if clear else particle_table(self.model, particles)
            self._particles = particles
        return self._air
