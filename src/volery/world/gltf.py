"""Exports worlds as binary glTF 2.0, for browsers, Blender and game engines.

`glb_of` has one node for the ground, for each tree and for each solid, named as in
`Scene.instance_name`. Nodes of trees share the meshes of their models, so a forest is little more
than a list of positions. `instanced_glb_of` is for real-time rendering: a node for each tree model
with all its positions (EXT_mesh_gpu_instancing), one for all solids. Axes are glTF's (y up), see
`core.frames`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.frames import gltf_from_enu, q_gltf_from_enu
from volery.world.gltf_file import Colours, GltfFile, Surface
from volery.world.ground_cover import BARE_GROUND, GroundCover
from volery.world.materials import Material
from volery.world.mesh import Mesh, concatenate
from volery.world.scene_content import PLAIN, Look, Solid
from volery.world.terrain import Terrain
from volery.world.trees.model import DetailLevel

if TYPE_CHECKING:
    from volery.world.forest import Forest

_DIGITS = 5
"""Digits of positions in m: a hundredth of a millimetre."""
_GRAIN_M = 1.0 / 256.0
"""Resolution of the trees' vertices for rendering: their last bits are half a file's bytes."""


def glb_of(
    terrain: Terrain | None,
    forest: Forest | None,
    solids: Sequence[Solid] = (),
    *,
    colours: Colours,
    cover: GroundCover = BARE_GROUND,
    detail: DetailLevel = DetailLevel.SENSING,
) -> bytes:
    """Returns a world as the bytes of a .glb file; colours: linear (r, g, b) of each material."""
    file = GltfFile(colours)
    _add_ground(file, terrain, cover)
    if forest is not None:
        meshes = [file.add_mesh(surfaces) for surfaces in _tree_surfaces(forest, detail)]
        placed = (rows.tolist() for rows in _placed(forest))
        trees = zip(forest.model_index.tolist(), *placed, strict=True)
        for number, (model, position, turn, scale) in enumerate(trees, start=1):
            placing = {"translation": position, "rotation": turn, "scale": scale}
            file.add_node(f"tree {number}", meshes[model], **placing)
    for solid in solids:
        file.add_node(solid.name, file.add_mesh(_parts_of(solid)))
    return file.content()


def instanced_glb_of(
    terrain: Terrain | None,
    forest: Forest | None,
    solids: Sequence[Solid] = (),
    *,
    colours: Colours,
    cover: GroundCover = BARE_GROUND,
    detail: DetailLevel = DetailLevel.SENSING,
    extras: Mapping[str, Any] | None = None,
) -> bytes:
    """Returns the same surfaces in few nodes; ground and wood are shaded smooth, others flat.

    Solids are one node, a primitive for each material: COLOR_0 holds the colour of each, `_STOREYS`
    of facades z where storeys begin, their height, m, and their number. `extras` are those of the
    asset.
    """
    file = GltfFile(colours, extras)
    _add_ground(file, terrain, cover, smooth=True)
    if forest is not None:
        placed = _placed(forest)
        for number, surfaces in enumerate(_tree_surfaces(forest, detail, smooth=True)):
            model, here = forest.models[number], forest.model_index == number
            name = f"trees {model.species} {model.variant} {number}"
            file.add_instances(name, file.add_mesh(surfaces), *(rows[here] for rows in placed))
    file.add_node("solids", file.add_mesh(_joined([p for s in solids for p in _parts_of(s)])))
    return file.content()


class _Instance(NamedTuple):
    """Poses and scales of trees, in glTF's axes."""

    positions: NDArray[np.float64]
    turns: NDArray[np.float64]
    scales: NDArray[np.float64]


def _add_ground(
    file: GltfFile, terrain: Terrain | None, cover: GroundCover, *, smooth: bool = False
) -> None:
    if terrain is None:
        return
    mesh = terrain.mesh()
    ground = file.add_mesh([Surface(mesh, Material.GROUND, smooth=smooth)])
    if cover.material.size:
        file.lay_over(ground, mesh, cover)
    file.add_node("ground", ground)


def _tree_surfaces(
    forest: Forest, detail: DetailLevel, *, smooth: bool = False
) -> list[list[Surface]]:
    """Returns wood and leaves of each model; smooth: for rendering alone."""
    trees = [model.levels[detail] for model in forest.models]
    fit = _grained if smooth else _as_it_is
    return [
        [
            Surface(fit(tree.wood), Material.WOOD, smooth=smooth),
            Surface(fit(tree.leaves), Material.LEAF),
        ]
        for tree in trees
    ]


def _as_it_is(mesh: Mesh) -> Mesh:
    return mesh


def _grained(mesh: Mesh) -> Mesh:
    steps = np.round(mesh.vertices / _GRAIN_M)
    return Mesh((steps * _GRAIN_M).astype(np.float32), mesh.triangles)


def _placed(forest: Forest) -> _Instance:
    half = 0.5 * forest.yaw
    zero = np.zeros_like(half)
    return _Instance(
        gltf_from_enu(forest.position_map).round(_DIGITS),
        q_gltf_from_enu(np.stack([zero, zero, np.sin(half), np.cos(half)], -1)),
        np.abs(gltf_from_enu(forest.scale)),
    )


def _parts_of(solid: Solid) -> list[Surface]:
    """Returns a solid's surfaces, with its tops separate if of another material."""
    if solid.top is None or solid.top == solid.material:
        return [Surface(solid.mesh, solid.material, solid.look)]
    normals = solid.mesh.face_normals
    up = (normals[:, 2] > 0.0) & (normals[:, 2] ** 2 > normals[:, 0] ** 2 + normals[:, 1] ** 2)
    return [
        Surface(_piece(solid.mesh, ~up), solid.material, solid.look),
        Surface(_piece(solid.mesh, up), solid.top),
    ]


def _piece(mesh: Mesh, chosen: NDArray[np.bool_]) -> Mesh:
    """Returns some triangles of a mesh, without unused vertices."""
    used, triangles = np.unique(mesh.triangles[chosen], return_inverse=True)
    return Mesh(mesh.vertices[used], triangles.reshape(-1, 3).astype(np.uint32))


def _joined(parts: Sequence[Surface]) -> list[Surface]:
    """Returns all parts of a material as one surface, with their looks at the vertices."""
    joined = []
    for material in sorted({part.material for part in parts}):
        same = [part for part in parts if part.material == material]
        counts = [len(part.mesh.vertices) for part in same]
        looks = [part.look for part in same]
        colours, storeys = None, None
        if any(look.colour != PLAIN.colour for look in looks):
            colours = np.repeat([look.colour for look in looks], counts, axis=0)
        if any(look.storeys for look in looks):
            rows = np.array([(look.foot_m, look.storey_m, look.storeys) for look in looks])
            storeys = np.repeat(rows, counts, axis=0).astype(np.float32)
        mesh = concatenate([part.mesh for part in same])
        joined.append(Surface(mesh, material, Look(), colours=colours, storeys=storeys))
    return joined
