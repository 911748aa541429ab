"""Content of a scene, as flat tables for ray casting.

Instances: 0 is the terrain, 1..T the trees in forest order, then the solids. An instance has one
or more parts; a part is a mesh with a material, shared by all instances of a tree model. A tree has
four: wood and leaves of its foot, wood and leaves of its crown (see `tree_pieces`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.world.embree import PaddedMesh, padded
from volery.world.ground_cover import BARE_GROUND, GroundCover
from volery.world.materials import Material
from volery.world.mesh import Mesh
from volery.world.point_query import TriangleTable
from volery.world.terrain import Terrain
from volery.world.tree_pieces import foot_and_crown
from volery.world.trees.model import DetailLevel

if TYPE_CHECKING:
    from volery.world.forest import Forest

MATERIALS = 2
"""Maximum number of materials of an instance; a tree's parts alternate between the two."""
_TREE_PARTS = 4


class Look(NamedTuple):
    """Appearance of a solid of material FACADE or PAINTED, for cameras."""

    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Linear red, green, blue; factors of the material's own colour."""
    foot_m: float = 0.0
    """z in the map from which storeys are counted."""
    storey_m: float = 1.0
    storeys: int = 0
    """Rows of windows; 0: none."""


PLAIN = Look()
"""The material's own colour, no windows."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A fixed object in the map: a wall, a building; its mesh is in map coordinates, m.

    A point is inside the solid if the first surface straight above it is an upper side of the mesh,
    seen from its back: a mesh is closed except for its underside, or has no upper side at all.
    Stacked solids need a gap of a millimetre, which determines the side that is hit first.
    """

    mesh: Mesh
    material: Material
    name: str
    top: Material | None = None
    """Material of faces that point up more than sideways; None: `material`, too."""
    look: Look = PLAIN
    is_shell: bool = False
    """Whether the surface has holes, so that the solid has no inside."""


@dataclass(frozen=True, eq=False)
class BodyShape:
    """Shape of a UAV or actor for sensors: meshes in the body frame (FLU) with materials."""

    parts: tuple[tuple[Mesh, Material], ...]
    rotors: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 10)))
    """(R, 10) turning rotors: centre, two unit vectors in the disc (rotation from the first to the
    second), radius, m. The part of material ROTOR has `DISC_SIDES` triangles for each
    (`rotor_kernels`), in order; without rotors it is solid."""

    @property
    def radius(self) -> float:
        """Radius of the sphere about the body's origin that contains all parts, m."""
        lengths = [
            float(np.linalg.norm(mesh.vertices, axis=1).max())
            for mesh, _ in self.parts
            if len(mesh.vertices)
        ]
        return max(lengths, default=0.0)


@dataclass(frozen=True, eq=False)
class SceneContent:
    """Tables over instances and parts; see `TriangleTable` for the indexing."""

    parts: tuple[PaddedMesh, ...]
    table: TriangleTable
    material: NDArray[np.uint8]
    """(instances, MATERIALS) materials of the instance's parts."""
    normal_matrix: NDArray[np.float32]
    """(instances, 9) rows of the inverse transpose of the instance's 3x3 matrix."""
    tree_parts: NDArray[np.int64]
    """(models,) first part of each tree model."""
    tree_model: NDArray[np.int32]
    """(trees,) model of each tree."""
    tree_transforms: NDArray[np.float32]
    """(trees, 3, 4) map from tree."""
    has_terrain: bool
    steepest: float
    """Maximum slope of the terrain, height by distance; 0 without one."""
    solids: int
    look: NDArray[np.float32]
    """(instances, 6) rows of `Look`."""
    cover: GroundCover

    @property
    def trees(self) -> int:
        """Number of trees."""
        return len(self.tree_model)

    @property
    def instances(self) -> int:
        """Number of static instances; the terrain's number counts even without a terrain."""
        return 1 + self.trees + self.solids

    def solid_part(self, instance: int) -> PaddedMesh:
        """Returns the mesh of a solid, by its instance number."""
        return self.parts[int(self.table.first_part[instance])]


def rotor_table(shapes: Sequence[BodyShape]) -> NDArray[np.float64]:
    """Returns the rotors (shapes, R, 10) of body shapes, padded with zeros."""
    max_rotors = max((len(shape.rotors) for shape in shapes), default=0)
    table = np.zeros((len(shapes), max_rotors, 10))
    for row, shape in zip(table, shapes, strict=True):
        row[: len(shape.rotors)] = shape.rotors
    return table


def _looks(before: int, solids: Sequence[Solid]) -> NDArray[np.float32]:
    rows = np.zeros((before + len(solids), 6), dtype=np.float32)
    for row, solid in zip(rows[before:], solids, strict=True):
        colour, *storeys = solid.look
        row[:3], row[3:] = colour, storeys
    return rows


def collect(
    terrain: Terrain | None,
    forest: Forest | None,
    detail: DetailLevel,
    solids: Sequence[Solid],
    cover: GroundCover = BARE_GROUND,
) -> SceneContent:
    """Returns the tables of a world at one level of detail."""
    return with_solids(_collect_land(terrain, forest, detail, cover), 0, solids)


def with_solids(content: SceneContent, kept: int, solids: Sequence[Solid]) -> SceneContent:
    """Returns `content` with `solids` instead of its own solids after the first `kept`.

    Meshes that remain are not moved in memory.
    """
    first, old = content.instances - content.solids + kept, content.table
    staying = content.parts[: len(content.parts) - content.solids + kept]
    new = tuple(padded(solid.mesh) for solid in solids)
    count = len(solids)
    transform = np.tile(np.eye(3, 4), (count, 1, 1))
    upright = np.tile(np.eye(3, dtype=np.float32).reshape(1, 9), (count, 1))
    material = np.zeros((count, MATERIALS), dtype=np.uint8)
    for row, solid in zip(material, solids, strict=True):
        row[:] = solid.material, solid.material if solid.top is None else solid.top
    vertices, triangles, length = _memory_of(new)
    part_rows = len(staying) + np.arange(count)
    return replace(
        content,
        parts=(*staying, *new),
        table=TriangleTable(
            vertices=np.concatenate([old.vertices[: len(staying)], vertices]),
            triangles=np.concatenate([old.triangles[: len(staying)], triangles]),
            length=np.concatenate([old.length[: len(staying)], length]),
            first_part=np.concatenate([old.first_part[:first], part_rows]),
            part_count=np.concatenate([old.part_count[:first], np.ones(count, dtype=np.int64)]),
            transform=np.concatenate([old.transform[:first], transform.reshape(count, 12)]),
        ),
        material=np.concatenate([content.material[:first], material]),
        look=np.concatenate([content.look[:first], _looks(0, solids)]),
        normal_matrix=np.concatenate([content.normal_matrix[:first], upright]),
        solids=kept + count,
    )


def _memory_of(
    parts: Sequence[PaddedMesh],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Returns the addresses of the parts' vertices and triangles, and the numbers of triangles."""
    return (
        np.array([p.vertices.ctypes.data for p in parts], dtype=np.int64),
        np.array([p.triangles.ctypes.data for p in parts], dtype=np.int64),
        np.array([len(p.triangles) for p in parts], dtype=np.int64),
    )


def _collect_land(
    terrain: Terrain | None, forest: Forest | None, detail: DetailLevel, cover: GroundCover
) -> SceneContent:
    """Returns the tables of ground and trees alone."""
    models = forest.models if forest is not None else ()
    trees = len(forest.model_index) if forest is not None else 0
    meshes: list[Mesh] = []
    if terrain is not None:
        meshes.append(terrain.mesh())
    tree_parts = np.empty(len(models), dtype=np.int64)
    for i, model in enumerate(models):
        tree_parts[i] = len(meshes)
        level = model.levels[detail]
        for piece in foot_and_crown(level):
            meshes.extend((piece.wood, piece.leaves))
    parts = tuple(padded(mesh) for mesh in meshes)
    vertices, triangles, length = _memory_of(parts)

    count = 1 + trees
    transforms = np.broadcast_to(np.eye(3, 4), (count, 3, 4)).copy()
    first = np.zeros(count, dtype=np.int64)
    parts_of = np.ones(count, dtype=np.int64)
    parts_of[0] = terrain is not None
    material = np.zeros((count, MATERIALS), dtype=np.uint8)
    material[0] = Material.GROUND
    tree_transforms = np.zeros((0, 3, 4), dtype=np.float32)
    model_index = np.zeros(0, dtype=np.int32)
    if forest is not None:
        tree_transforms = np.ascontiguousarray(forest.tree_transforms(), dtype=np.float32)
        model_index = np.asarray(forest.model_index, dtype=np.int32)
        transforms[1:] = tree_transforms
        first[1:] = tree_parts[model_index]
        parts_of[1:] = _TREE_PARTS
        material[1:] = (Material.WOOD, Material.LEAF)

    inverse = np.linalg.inv(transforms[:, :, :3])
    return SceneContent(
        parts=parts,
        table=TriangleTable(
            vertices=vertices,
            triangles=triangles,
            length=length,
            first_part=first,
            part_count=parts_of,
            transform=transforms.reshape(count, 12),
        ),
        material=material,
        normal_matrix=np.ascontiguousarray(
            np.swapaxes(inverse, 1, 2).reshape(count, 9), dtype=np.float32
        ),
        tree_parts=tree_parts,
        tree_model=model_index,
        tree_transforms=tree_transforms,
        has_terrain=terrain is not None,
        steepest=0.0 if terrain is None else terrain.steepest,
        solids=0,
        look=_looks(1 + trees, ()),
        cover=cover,
    )
