"""The camera and the tag of the task `servoing` and of the scenario `servoing`."""

from __future__ import annotations

from volery.learning.tags.camera import TagCamera
from volery.sensors.cameras.model import CameraModel

MOUNT_M = (0.0, 0.0, -0.06)
MOUNT_RPY_DEG = (0.0, 90.0, 0.0)
"""The camera looks down; the top of its image is ahead."""
TAG_SIZE_M = 0.5
TAG_ID = 0
RATE_HZ = 10.0


def downward_camera() -> TagCamera:
    """Returns the pinhole camera with 320 x 240 pixels and 80 degrees, below the UAV."""
    changes = {"width": 320, "height": 240, "horizontal_fov_deg": 80.0, "samples": 4}
    model = CameraModel.load("pinhole").model_copy(update=changes)
    return TagCamera(model, MOUNT_M, MOUNT_RPY_DEG, TAG_SIZE_M, TAG_ID)
