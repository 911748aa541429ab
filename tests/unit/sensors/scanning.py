"""What the LIDAR tests share: poses, scans, and rays by formula."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "world"))

from volery.core import rotations
from volery.sensors.lidar.lidar import make_batch, sample_echoes, stack_mounts
from volery.sensors.mount import make_mount
from volery.vehicle.pose_history import PoseHistory, new_history
from volery.world.materials import Material
from volery.world.scene import Scene, Solid

DT_NS = 1_000_000
LEVEL = stack_mounts([make_mount()])


def standing(position=(0.0, 0.0, 0.0), yaw=0.0):
    return new_history([position], [rotations.from_rpy(0.0, 0.0, yaw)], DT_NS)


def flying(velocity, yaw_rate, length=128):
    """One UAV from the origin, yawing."""
    t = np.arange(length) * DT_NS * 1e-9
    position = t[:, None, None] * np.asarray(velocity, dtype=float)
    attitude = rotations.from_rpy(0.0, 0.0, yaw_rate * t)[:, None, :]
    return PoseHistory(position, attitude, DT_NS)


def echoes_of(scene, model, history=None, *, scans=1, number=0, start_ns=0, key=1, **options):
    """Echoes of `scans` scans of one sensor in the body's frame."""
    moving = not model.scan.is_fixed
    numbers = number if moving else number + np.arange(scans)
    batch = make_batch(np.zeros(scans, int), 0, start_ns, key, numbers, LEVEL)
    return sample_echoes(scene, model, batch, history or standing(), **options)


def solids(*meshes, material=Material.WALL, **options):
    named = [Solid(mesh, material, f"solid {i}") for i, mesh in enumerate(meshes)]
    return Scene(None, None, solids=named, **options)
