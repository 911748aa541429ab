"""Loads the user's meshes as solids of a scenario's world."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.errors import DataFileError
from volery.scenario.schema import Scenario
from volery.scenario.user_mesh import UserMesh
from volery.world.materials import Material
from volery.world.mesh import Mesh
from volery.world.mesh_files import MAX_DISTANCE_M, MeshFile, read_mesh
from volery.world.scene import Look, Solid

_log = logging.getLogger(__name__)
_MIN_SIZE_M, _MAX_HEIGHT_M = 0.02, 1000.0
"""Sizes beyond which a mesh probably is in other units: the tallest building has 828 m."""


def mesh_solids(scenario: Scenario) -> tuple[Solid, ...]:
    """Returns a solid for each of `world.meshes`; each file is read once.

    Warns of one whose size suggests another unit. Raises `DataFileError` with scenario and key.
    """
    read: dict[tuple[Path, str | None], MeshFile] = {}
    solids = []
    for number, entry in enumerate(scenario.world.meshes):
        try:
            path = scenario.access.find_file(entry.file)
            if (path, entry.up) not in read:
                read[path, entry.up] = read_mesh(path, up=entry.up)
            solids.append(_solid(entry, path, read[path, entry.up]))
        except DataFileError as error:
            raise DataFileError(f"{scenario.name}: world.meshes[{number}]: {error}") from None
    return tuple(solids)


def _solid(entry: UserMesh, path: Path, file: MeshFile) -> Solid:
    mesh = file.placed(_placing(entry))
    _check_distance(entry, path, mesh)
    _check_size(path, mesh)
    colour = entry.colour or file.colour
    material, name = Material[entry.material.upper()], entry.name or path.stem
    return Solid(mesh, material, name, look=Look(colour), is_shell=not mesh.is_closed)


def _placing(entry: UserMesh) -> NDArray[np.float64]:
    """Returns the transform (3, 4) from the file to the map frame."""
    turn = rotations.from_rpy(*np.radians(entry.rpy_deg))
    axes = np.stack([rotations.rotate(turn, axis) for axis in np.eye(3)], axis=1)
    return np.column_stack([axes * np.broadcast_to(entry.scale, 3), entry.position_m])


def _check_distance(entry: UserMesh, path: Path, mesh: Mesh) -> None:
    """Raises `DataFileError` for a mesh far away, with the position of one only shifted."""
    far = float(np.abs(mesh.vertices).max())
    if far <= MAX_DISTANCE_M:
        return
    low, high = mesh.bounds
    advice = "is `scale` right?"
    if float((high - low).max()) <= MAX_DISTANCE_M:
        middle = np.round(np.array(entry.position_m) - (low + high) / 2.0)
        there = ", ".join(f"{value:.0f}" for value in middle.tolist())
        advice += f" If its coordinates are projected ones: position_m = [{there}]"
    raise DataFileError(
        f"{path} extends to {far:.3g} m from the map's origin, at most {MAX_DISTANCE_M:g} m is "
        f"allowed; {advice}"
    )


def _check_size(path: Path, mesh: Mesh) -> None:
    size = np.subtract(*mesh.bounds[::-1])
    shown = " x ".join(f"{value:.3g}" for value in size.tolist())
    if size[2] > _MAX_HEIGHT_M:
        _log.warning("%s is %s m: if the file is in mm, set scale = 0.001", path.name, shown)
    elif size.max() < _MIN_SIZE_M:
        _log.warning("%s is %s m: is `scale` right?", path.name, shown)
