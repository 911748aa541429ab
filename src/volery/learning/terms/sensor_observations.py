"""Observations of sensors: LIDARs and cameras of the scenario, at their rates.

A part is that of the last sample. Its data are as old as the time from the measurement to the
decision: choose the sensor's `rate_hz` and `phase_s` so that a sweep or exposure ends at a
decision, and `flight.sample_age_s` says how old they are. Before the first sample of an episode,
closeness and colours are 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.policy import sensor_terms
from volery.core.arrays import Array
from volery.core.errors import ScenarioError
from volery.learning.flight import Flight
from volery.learning.task import Observation
from volery.runtime.environment_block import SampleArrays


def lidar_sectors(
    sensor: str = "horizontal",
    *,
    sectors: int = 36,
    angle_min_rad: float = -math.pi,
    angle_max_rad: float = math.pi,
    max_range_m: float = 10.0,
) -> Observation:
    """Returns the closeness of the nearest echo in each sector of a planar LIDAR.

    Closeness is 1 - range / `max_range_m`, 0 beyond it. Sectors are numbered counter-clockwise from
    `angle_min_rad`.
    """
    parameters: dict[str, Any] = {
        "sectors": sectors,
        "angle_min_rad": angle_min_rad,
        "angle_max_rad": angle_max_rad,
        "max_range_m": max_range_m,
    }

    def nearest(flight: Flight, sample: SampleArrays) -> NDArray[np.float32]:
        angles = flight.sensor_model(sensor).scan.angles
        return sensor_terms.lidar_sectors(sample["echoes"][..., 0, :], angles, **parameters)

    return _part("lidar_sectors", sensor, nearest, sectors, parameters)


def lidar_scan(sensor: str = "horizontal", *, beams: int, max_range_m: float = 10.0) -> Observation:
    """Returns the closeness of the first echo of all `beams` of a LIDAR: 1 - range / max."""

    def scan(_flight: Flight, sample: SampleArrays) -> NDArray[np.float32]:
        return sensor_terms.lidar_scan(sample["echoes"][..., 0, :], max_range_m=max_range_m)

    return _part("lidar_scan", sensor, scan, beams, {"max_range_m": max_range_m})


def depth_image(
    sensor: str = "camera", *, width: int, height: int, max_depth_m: float = 10.0
) -> Observation:
    """Returns the closeness 1 - depth / `max_depth_m` of the pixels of a depth camera.

    The numbers are an image of shape (1, height, width), row by row.
    """

    def image(_flight: Flight, sample: SampleArrays) -> NDArray[np.float32]:
        return sensor_terms.depth_image(sample["depth"], max_depth_m=max_depth_m)

    parameters = {"shape": [1, height, width], "max_depth_m": max_depth_m}
    return _part("depth_image", sensor, image, width * height, parameters, "depth")


def colour_image(sensor: str = "camera", *, width: int, height: int) -> Observation:
    """Returns the colours, 0 to 1, of the pixels of a camera: an image (3, height, width)."""

    def image(_flight: Flight, sample: SampleArrays) -> NDArray[np.float32]:
        return sensor_terms.colour_image(sample["colour"])

    size = 3 * width * height
    return _part("colour_image", sensor, image, size, {"shape": [3, height, width]}, "colour")


def _part(
    name: str,
    sensor: str,
    function: Callable[[Flight, SampleArrays], NDArray[np.float32]],
    size: int,
    parameters: Mapping[str, Any],
    image: str | None = None,
) -> Observation:
    """Returns a part that `function` computes from the last samples; zeros before the first."""

    def last(flight: Flight) -> Array:
        sample = flight.sample(sensor)
        if sample is None:
            return np.zeros((flight.num_envs, flight.num_uavs, size), np.float32)
        numbers = function(flight, sample)
        if numbers.shape[-1] != size:
            raise ScenarioError(
                f"observation '{name}': sensor '{sensor}' gives {numbers.shape[-1]} numbers, "
                f"not {size}"
            )
        has_sample = flight.has_sample(sensor)
        return np.asarray(numbers if has_sample.all() else numbers * has_sample[..., None])

    return Observation(
        name,
        last,
        size,
        "1",
        limit=1.0,
        parameters={"sensor": sensor, **parameters},
        image=None if image is None else (sensor, image),
    )
