"""Measures detections of AprilTags in rendered images, by the size of their cells in the image.

    python tools/tag_detection_table.py --images 3000 > src/volery/learning/tags/detection.toml

The geometric model of detections in `volery.learning.tags` reads the table.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from volery.autonomy.perception.tags.detector import quad_area
from volery.core import rotations
from volery.core.arrays import Array
from volery.learning.tags.camera import TagCamera, TagView
from volery.learning.tags.images import TagImages
from volery.learning.tags.setup import downward_camera
from volery.vehicle.airframe import load_airframe

EDGES_PX = (1.0, 1.4, 1.7, 2.0, 2.3, 2.7, 3.5, 5.0, 8.0, 14.0, 30.0)
SIDE_CELLS = 8
_BATCH = 50
_TILT_RAD = 0.14


class Measured(NamedTuple):
    """A whole tag in one image; errors are nan without a detection."""

    cell_px: float
    is_detected: bool
    centre_px: Array
    """(2,) error of the centre."""
    side_px: float
    """Error of the side."""
    turn_px: float
    """Error of the direction, times the side."""


def measure(camera: TagCamera, count: int, seed: int) -> Iterator[Measured]:
    """Yields whole tags in at least `count` images, from any side, at tilts of about 8 degrees."""
    random = np.random.default_rng(seed)
    images = TagImages(camera, load_airframe("f450"), _BATCH)
    envs = np.arange(_BATCH)
    for number in range(-(-count // _BATCH)):
        cell = np.exp(random.uniform(np.log(EDGES_PX[0]), np.log(EDGES_PX[-1]), _BATCH))
        height = camera.model.focal_px * camera.tag_size_m / (SIDE_CELLS * cell)
        roll, pitch = random.normal(0.0, _TILT_RAD, (2, _BATCH))
        yaw, tag_yaw = random.uniform(-np.pi, np.pi, (2, _BATCH))
        attitude = rotations.from_rpy(roll, pitch, yaw)
        aside = random.uniform(-0.6, 0.6, (2, _BATCH)) * height
        position = np.column_stack([*aside, height - camera.mount_m[2]])
        tags = np.zeros((_BATCH, 3))
        view = camera.view(position, attitude, tags, tag_yaw)
        keys = random.integers(0, 2**63, _BATCH).astype(np.uint64)
        pictures = images.render(envs, position, attitude, tags, tag_yaw, keys=keys, number=number)
        for k in np.flatnonzero(view.is_whole).tolist():
            yield _compare(images, pictures[k], view, k)
    images.close()


def _compare(images: TagImages, picture: np.ndarray, view: TagView, k: int) -> Measured:
    tag, true = images.corners(picture), view.corners_px[k]
    if tag is None:
        return Measured(float(view.cell_px[k]), False, np.full(2, np.nan), np.nan, np.nan)
    side = float(np.sqrt(quad_area(true)))
    turn = np.angle(_direction(tag.corners_px) / _direction(true))
    return Measured(
        float(view.cell_px[k]),
        True,
        (tag.corners_px - true).mean(axis=0),
        tag.side_px - side,
        float(turn) * side,
    )


def _direction(corners: Array) -> complex:
    """Returns the direction from the tag's bottom to its top, as a complex number."""
    up = corners[0] + corners[1] - corners[2] - corners[3]
    return complex(up[0], up[1])


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--images", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    camera = downward_camera()
    tags = list(measure(camera, options.images, options.seed))
    model = camera.model
    print(
        "# Detections of whole tags in rendered images, by the side of a cell in the image, "
        f"pixels.\n# Measured by tools/tag_detection_table.py: {len(tags)} tags, camera of "
        f"{model.width} x {model.height}\n# pixels and {model.horizontal_fov_deg:g} degrees, "
        f"{model.samples} rays a pixel. detected: fraction; centre, side, turn: errors in\n"
        "# pixels of the centre, of the side (mean and standard deviation) and of the direction "
        "times the side.\n"
    )
    print("rows = [")
    for low, high in itertools.pairwise(EDGES_PX):
        here = [tag for tag in tags if low <= tag.cell_px < high]
        found = [tag for tag in here if tag.is_detected]
        if len(found) < 5:
            continue
        cell = np.mean([tag.cell_px for tag in here])
        centre = np.sqrt(np.mean([tag.centre_px**2 for tag in found]))
        side = [tag.side_px for tag in found]
        turn = np.std([tag.turn_px for tag in found])
        print(
            f"  {{ cell_px = {cell:.2f}, detected = {len(found) / len(here):.3f}, "
            f"centre = {centre:.3f}, side_mean = {np.mean(side):.3f}, "
            f"side_sigma = {np.std(side):.3f}, turn = {turn:.3f} }},  # {len(here)} tags"
        )
    print("]")


if __name__ == "__main__":
    main()
