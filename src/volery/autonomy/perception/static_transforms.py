"""Mounts of sensors in the body, from `/tf_static`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from volery.core import rotations
from volery.core.arrays import Array
from volery.core.vectors import norm
from volery.graph.messages import TFMessage, frame_name, frame_of

_JOINTS = 16
"""Max number of frames between body and sensor."""


class Mount(NamedTuple):
    """Mount of a sensor: position (3,) m, attitude (4,) x y z w."""

    position: Array
    attitude: Array


LEVEL = Mount(np.zeros(3), rotations.IDENTITY)


class StaticTransforms:
    """Transforms by child frame: parent frame and the child's pose in it."""

    def __init__(self) -> None:
        self.joints: dict[str, tuple[str, Mount]] = {}

    def add(self, message: TFMessage) -> None:
        """Stores the transforms of a message; ignores those that are not finite."""
        for found in message.transforms:
            p, q = found.transform.translation, found.transform.rotation
            turn = np.array([q.x, q.y, q.z, q.w])
            if np.isfinite([p.x, p.y, p.z, *turn]).all() and norm(turn) > 0.5:
                mount = Mount(np.array([p.x, p.y, p.z]), rotations.normalize(turn))
                self.joints[frame_name(found.child_frame_id)] = frame_of(found), mount

    def mount_of(self, frame: str, own: Mount = LEVEL) -> Mount:
        """Returns a frame's pose in the body, the root of its chain.

        `own` is a pose in that frame to transform.
        """
        for _ in range(_JOINTS):
            if frame not in self.joints:
                break
            frame, joint = self.joints[frame]
            position = rotations.rotate(joint.attitude, own.position) + joint.position
            own = Mount(position, rotations.multiply(joint.attitude, own.attitude))
        return own
