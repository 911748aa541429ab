"""Detects the searched object in an image and returns its position."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.search.colour_blob import NO_DISCS, colour_mask, largest_blob, pixels_of
from volery.autonomy.search.ground_view import GroundView, Intrinsics, pose_at
from volery.autonomy.search.settings import SearchSettings
from volery.core.arrays import Array
from volery.graph.messages import Image, stamp_of

_TEAMMATE_M = 0.7
"""Radius of the ball around a teammate, which may have the colour too. Modelling choice."""


def object_position(
    image: Image,
    intrinsics: Intrinsics,
    settings: SearchSettings,
    pose: OdometrySample,
    teammates: Iterable[Array],
) -> Array | None:
    """Returns the map position (3,) m of the largest patch of the colour inside the area.

    pose: odometry of about the image's time. teammates: their positions (3,), which are excluded.
    Returns None if the patch is too small, lies outside, or its ray misses the ground.
    """
    pose = pose_at(pose, stamp_of(image))
    view = GroundView(intrinsics, settings.mount_m, settings.mount_rpy_deg)
    discs = [view.disc_of(position, _TEAMMATE_M, pose) for position in teammates]
    hidden = [disc for disc in discs if disc is not None]
    mask = colour_mask(pixels_of(image), settings.colours, np.array(hidden) if hidden else NO_DISCS)
    blob = largest_blob(mask)
    if blob is None or blob.fraction < settings.min_fraction:
        return None
    position = view.position_of(blob.u, blob.v, pose, settings.object_height_m)
    return (
        position if position is not None and settings.area.holds(position[0], position[1]) else None
    )
