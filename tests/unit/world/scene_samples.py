"""Small worlds whose geometry is known exactly."""

from __future__ import annotations

import numpy as np

from volery.world.forest import Forest
from volery.world.materials import Material
from volery.world.mesh import Mesh, concatenate
from volery.world.scene import BodyShape
from volery.world.trees.model import DetailLevel, TreeMesh, TreeModel


def cylinder(radius, height, sides, x=0.0, y=0.0, z=0.0):
    """Open upright cylinder whose sides touch the true one from inside at their edges."""
    angle = np.arange(sides) * 2.0 * np.pi / sides
    ring = np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])
    low, high = np.full((sides, 1), z), np.full((sides, 1), z + height)
    i = np.arange(sides)
    j = (i + 1) % sides
    triangles = np.concatenate(
        [np.column_stack([i, j, j + sides]), np.column_stack([i, j + sides, i + sides])]
    )
    return Mesh(np.concatenate([np.hstack([ring, low]), np.hstack([ring, high])]), triangles)


def wall(x, half=200.0):
    """Plane x = const."""
    corners = [[x, -half, -half], [x, half, -half], [x, half, half], [x, -half, half]]
    return Mesh(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))


def scattered(rng, count, spread, size):
    """Random triangles."""
    middle = rng.normal(size=(count, 1, 3)) * spread
    corners = middle + rng.normal(size=(count, 3, 3)) * size
    return Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def small_forest(count=25, extent=20.0, seed=0):
    """Trees of random triangles, turned and scaled unequally."""
    rng = np.random.default_rng(seed)
    models = []
    for i in range(3):
        leaves = scattered(rng, 120, [0.8, 0.8, 1.2], 0.12)
        crown = Mesh(leaves.vertices + np.float32([0, 0, 4.0]), leaves.triangles)
        tree = TreeMesh(cylinder(0.15, 4.0, 8), crown if i else Mesh(crown.vertices[:0], []))
        models.append(
            TreeModel(
                species="test",
                variant=i,
                height_m=7.0,
                dbh_m=0.3,
                levels=dict.fromkeys(DetailLevel, tree),
                stem=np.array([[0.0, 0.15], [4.0, 0.15]]),
            )
        )
    positions = np.column_stack([rng.uniform(0.0, extent, (count, 2)), np.zeros(count)])
    return Forest(
        models=tuple(models),
        model_index=rng.integers(0, 3, count).astype(np.int32),
        position_map=positions,
        yaw=rng.uniform(-np.pi, np.pi, count),
        scale=rng.uniform(0.6, 1.5, (count, 3)),
        dbh_m=np.full(count, 0.3),
        height_m=np.full(count, 7.0),
        species=("test",) * count,
    )


def drone_shape():
    """Something like a quadrotor: a hub and four flat rotors."""
    rotors = [
        cylinder(0.12, 0.02, 12, x=0.2 * sx, y=0.2 * sy, z=0.03) for sx in (1, -1) for sy in (1, -1)
    ]
    return BodyShape(
        (
            (cylinder(0.1, 0.1, 16, z=-0.05), Material.UAV_BODY),
            (concatenate(rotors), Material.ROTOR),
        )
    )


def unit(v):
    """Unit vectors."""
    v = np.asarray(v, dtype=float)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)
