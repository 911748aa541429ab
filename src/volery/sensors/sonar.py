"""Sonars (ultrasonic range finders): the nearest echo within a cone."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from pydantic import Field, NonNegativeFloat, PositiveFloat

from volery.control.fleet import Fleet
from volery.core import rotations
from volery.core.arrays import Array, read_only
from volery.sensors.bank import NoisyBank, SensorGroup
from volery.sensors.model import SensorModel
from volery.sensors.samples import RangeSamples
from volery.world.scene import Scene

_RINGS = ((0.0, 1), (0.5, 6), (1.0, 12))
"""Rays of the cone: fraction of the half angle and number of rays on that ring."""


class SonarModel(SensorModel):
    """Range, cone and noise; see the data files in `models/`."""

    sensor_kind: ClassVar = "sonar"

    name: str
    range_min_m: NonNegativeFloat
    range_max_m: PositiveFloat
    resolution_m: PositiveFloat
    field_of_view_deg: float = Field(gt=0.0, lt=180.0)
    noise_m: NonNegativeFloat


class SonarBank(NoisyBank):
    """All sonars of one model, rate and phase, aimed along their frame's x axis."""

    name = "sonar"
    lag_ns = 0

    def __init__(self, model: SonarModel, group: SensorGroup, scene: Scene) -> None:
        super().__init__(group, per_measurement=1)
        self._model = model
        self._scene = scene
        self._position_body = group.position_body
        self._body_from_sensor = group.attitude_body
        rounding = model.resolution_m**2 / 12.0
        self._variance = model.noise_m**2 + rounding if self._noise.enabled else 0.0
        self._cone = _cone_directions(math.radians(model.field_of_view_deg) / 2.0)

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> RangeSamples:
        """Returns ranges (S,) m of measurement number `k`; see `Bank`."""
        rows, rays = self._rows, len(self._cone)
        attitude = fleet.state.attitude[rows]
        map_from_sensor = rotations.multiply(attitude, self._body_from_sensor)
        origin = fleet.state.position_map[rows] + rotations.rotate(attitude, self._position_body)
        directions = rotations.rotate(map_from_sensor[:, None, :], self._cone[None, :, :])
        self._scene.move_bodies(fleet.state.position_map, fleet.state.attitude)
        self._scene.move_actors(time_ns, time_ns)
        hits = self._scene.cast(
            np.repeat(origin, rays, axis=0),
            directions.reshape(-1, 3),
            self._model.range_max_m,
            exclude=np.repeat(rows, rays),
        )
        nearest = hits.distance.reshape(-1, rays).min(axis=1).astype(np.float64)
        if self._noise.enabled:
            nearest += self._model.noise_m * self._noise.measurement(k)[:, 0]
            step = self._model.resolution_m
            nearest = np.round(nearest / step) * step
        nearest[nearest > self._model.range_max_m] = np.inf
        nearest[nearest < self._model.range_min_m] = -np.inf
        return RangeSamples(
            self.sensors,
            time_ns,
            read_only(nearest),
            math.radians(self._model.field_of_view_deg),
            self._model.range_min_m,
            self._model.range_max_m,
            self._variance,
        )


def _cone_directions(half_angle: float) -> Array:
    rays = []
    for fraction, count in _RINGS:
        off_axis = fraction * half_angle
        for i in range(count):
            around = 2.0 * math.pi * i / count
            rays.append(
                [
                    math.cos(off_axis),
                    math.sin(off_axis) * math.cos(around),
                    math.sin(off_axis) * math.sin(around),
                ]
            )
    return np.array(rays)
