"""Images of a scene from several cameras of one model, rendered together."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cache
from statistics import NormalDist
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.workers import Workers, new_counter
from volery.sensors.cameras.camera_kernels import NORMALS, Frames, Optics, render_images
from volery.sensors.cameras.light import Light
from volery.sensors.cameras.model import CameraModel
from volery.sensors.cameras.pixel_table import PIECE
from volery.sensors.cameras.precipitation import Falling
from volery.sensors.cameras.weather_kernels import WeatherView, draw_falling
from volery.sensors.lidar.aim_kernels import RayBatch
from volery.sensors.lidar.lidar import move_bodies
from volery.vehicle.fleet import RotorTurns
from volery.vehicle.pose_history import PoseHistory
from volery.world.embree import LANES
from volery.world.scene import Scene
from volery.world.scene_kernels import thread_block

Part = Literal["colour", "depth", "labels"]
EVERY_PART: tuple[Part, ...] = ("colour", "depth", "labels")


class Images(NamedTuple):
    """Images of S exposures; a part that was not requested is None."""

    colour: NDArray[np.uint8] | None
    """(S, height, width, 3) sRGB."""
    depth: NDArray[np.float32] | None
    """(S, height, width) m along the optical axis; -inf: nearer than `near_m`, inf: beyond `far_m`,
    NaN: outside the lens's image."""
    instance: NDArray[np.int32] | None
    """(S, height, width) scene instance, -1 for none."""
    material: NDArray[np.uint8] | None
    """(S, height, width) `Material`."""


def take(
    scene: Scene,
    model: CameraModel,
    light: Light,
    batch: RayBatch,
    history: PoseHistory,
    *,
    rotors: RotorTurns | None = None,
    parts: Collection[Part] = EVERY_PART,
    falling: Sequence[Falling] = (),
    workers: Workers | None = None,
) -> Images:
    """Renders the batch's S images and returns the requested `parts`.

    The first row of each image is exposed at its `sweep_start_ns`. Noise depends on `key` and
    `scan_number`, the number of a camera's image. `history` must reach from the earliest exposure
    to the end of the latest readout. A camera does not see its own UAV. `rotors` holds the rotor
    angles of the other UAVs; None draws blurred discs. `falling`: drops and flakes, drawn into the
    colour image only. Images do not depend on the number of threads.
    """
    shots, pixels = len(batch.uav), model.width * model.height
    colour, depth, labels = (pixels if part in parts else 0 for part in EVERY_PART)
    if colour and falling:
        depth = pixels  # hides particles behind surfaces
    frames = Frames(
        np.empty((shots, colour, 3), np.uint8),
        np.empty((shots, depth), np.float32),
        np.empty((shots, labels), np.int32),
        np.empty((shots, labels), np.uint8),
    )
    if shots:
        start = int(batch.sweep_start_ns.min())
        end = int(batch.sweep_start_ns.max()) + model.readout_ns
        bodies = move_bodies(scene, history, start, end)
        table, counter = model.table, new_counter()
        handle = (
            scene.handle
            if rotors is None
            else scene.handle_with_blades(rotors.at(start), rotors.at(end))
        )
        max_range = model.far_m / float(table.direction[:, 0].min())
        optics = Optics(
            model.near_m,
            model.far_m,
            max_range,
            model.readout_ns,
            model.exposure,
            model.read_noise,
            model.shot_noise,
            model.depth_noise_per_m,
            _normals(),
        )

        def expose() -> None:
            block = thread_block(PIECE * LANES, bodies)
            render_images(
                handle, table, optics, light, batch, history, start, end, counter, block, frames
            )

        team = workers or scene.workers
        team.run(expose)
        for kind in falling if colour else ():
            view = _view_of(model)
            team.run(draw_falling, view, light, kind, batch, history, new_counter(), frames)
    shape = shots, model.height, model.width
    return Images(
        frames.colour.reshape(*shape, 3) if colour else None,
        frames.depth.reshape(shape) if "depth" in parts else None,
        frames.instance.reshape(shape) if labels else None,
        frames.material.reshape(shape) if labels else None,
    )


def _view_of(model: CameraModel) -> WeatherView:
    return WeatherView(
        model.width,
        model.height,
        model.focal_px,
        model.centre_px,
        np.array(model.distortion),
        model.widest,
        round(model.exposure_time_s * 1e9),
        model.exposure,
        _linear(),
    )


@cache
def _linear() -> NDArray[np.float32]:
    """Returns (256,) linear light of each byte value: IEC 61966-2-1 (sRGB)."""
    coded = np.arange(256) / 255.0
    light = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    return np.asarray(light, dtype=np.float32)


@cache
def _normals() -> NDArray[np.float32]:
    """Returns (NORMALS,) quantiles of the normal distribution at the middles of equal intervals."""
    quantile = NormalDist().inv_cdf
    return np.array([quantile((i + 0.5) / NORMALS) for i in range(NORMALS)], dtype=np.float32)
