"""Camera model: image size, lens, range, exposure and noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from volery.core.arrays import Array
from volery.sensors.cameras.lens import distort, undistort
from volery.sensors.cameras.pixel_table import PixelTable, make_table
from volery.sensors.model import SensorModel

Side = Annotated[int, Field(ge=1, le=8192)]


class CameraModel(SensorModel):
    """Parameters of a camera; see the data files in `models/`.

    Pixel (column u, row v) covers u - .5 to u + .5: its centre has integer coordinates, as in
    OpenCV and ROS.
    """

    sensor_kind: ClassVar = "camera"

    name: str = "pinhole"
    width: Side = 640
    height: Side = 480
    horizontal_fov_deg: Annotated[float, Field(gt=0.0, lt=180.0)] = 60.0
    """Field of view of the ideal image, before the lens distorts it."""
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    """k1, k2, p1, p2, k3 of `plumb_bob`."""
    near_m: NonNegativeFloat = 0.05
    """Minimum depth; nearer surfaces have depth -inf."""
    far_m: PositiveFloat = 200.0
    """Maximum depth; beyond it the image shows sky, and depth is inf."""
    readout_s: Annotated[float, Field(ge=0.0, le=0.1)] = 0.0
    """Time from the exposure of the first row to that of the last; 0: a global shutter."""
    samples: Literal[1, 4] = 1
    """Rays per pixel; 4 smooth the edges of the colour image."""
    exposure: PositiveFloat = 1.0
    """Factor of the light."""
    exposure_time_s: Annotated[float, Field(gt=0.0, le=0.05)] = 0.005
    """Time that the shutter is open; falling particles leave streaks of that duration (modelling
    choice)."""
    read_noise: NonNegativeFloat = 0.0
    """Standard deviation of a dark pixel, as a fraction of the saturating light."""
    shot_noise: NonNegativeFloat = 0.0
    """Standard deviation that light adds to a pixel which it just saturates; proportional to the
    square root of the light."""
    depth_noise_per_m: NonNegativeFloat = 0.0
    """Standard deviation of 1 / depth, 1/m, as for stereo; that of the depth grows with the depth
    squared, and has this value at 1 m. A noisy depth beyond `far_m` becomes inf."""

    @model_validator(mode="after")
    def _sees_something(self) -> Self:
        if self.near_m >= self.far_m:
            raise ValueError(f"near_m = {self.near_m} must be below far_m = {self.far_m}")
        return self

    @property
    def focal_px(self) -> float:
        """Focal length fx = fy, pixels."""
        return self.width / (2.0 * math.tan(math.radians(self.horizontal_fov_deg) / 2.0))

    @property
    def centre_px(self) -> tuple[float, float]:
        """Image centre (cx, cy), pixels."""
        return (self.width - 1) / 2.0, (self.height - 1) / 2.0

    @property
    def matrix(self) -> Array:
        """Camera matrix K (3, 3), pixels."""
        (cx, cy), f = self.centre_px, self.focal_px
        return np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])

    def model_copy(
        self, *, update: Mapping[str, Any] | None = None, deep: bool = False
    ) -> CameraModel:
        """Returns a copy with `update` applied; cached properties are not copied."""
        copy = super().model_copy(update=update, deep=deep)
        for name in ("table", "ideal", "widest"):
            copy.__dict__.pop(name, None)
        return copy

    def without_noise(self) -> CameraModel:
        """Returns the same camera without noise."""
        none = {"read_noise": 0.0, "shot_noise": 0.0, "depth_noise_per_m": 0.0}
        return self.model_copy(update=none)

    @property
    def readout_ns(self) -> int:
        """Time from the first row's exposure to the last one's, ns."""
        return round(self.readout_s * 1e9)

    @cached_property
    def table(self) -> PixelTable:
        """Rays of the pixels, for kernels."""
        return make_table(
            self.width,
            self.height,
            self.focal_px,
            self.centre_px,
            self.distortion,
            self.samples,
            self.readout_ns,
        )

    @cached_property
    def ideal(self) -> NDArray[np.float32]:
        """(height, width, 2) x and y, in the optical frame, of a pixel's point at depth 1.

        NaN outside the lens's image.
        """
        v, u = np.mgrid[0 : self.height, 0 : self.width]
        seen = (np.stack([u, v], axis=-1) - np.array(self.centre_px)) / self.focal_px
        return np.ascontiguousarray(undistort(seen, self.distortion), dtype=np.float32)

    @cached_property
    def widest(self) -> float:
        """Largest lateral or vertical distance in view, per metre of depth."""
        ahead, aside = self.table.direction[:, 0], np.abs(self.table.direction[:, 1:])
        return float((aside.max(axis=1) / ahead).max())

    def project(self, points: ArrayLike) -> Array:
        """Returns pixels (..., 2), column and row, of points (..., 3) in the optical frame, m.

        The optical frame has z forward, x right, y down. NaN for points that are not in front.
        """
        p = np.asarray(points, dtype=np.float64)
        ahead = np.where(p[..., 2] > 0.0, p[..., 2], np.nan)
        pixels = distort(p[..., :2] / ahead[..., None], self.distortion)
        return np.asarray(pixels * self.focal_px + np.array(self.centre_px))
