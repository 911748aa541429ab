"""Defines the geometry of a running world, and its id."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from volery.graph.graph import Graph
from volery.graph.messages import String
from volery.world.forest import Forest
from volery.world.ground_cover import BARE_GROUND, GroundCover
from volery.world.scene_content import Solid
from volery.world.terrain import Terrain


@dataclass(frozen=True, eq=False)
class Geometry:
    """Holds ground, trees and solids of a world at one time; no part is ever modified."""

    terrain: Terrain
    forest: Forest | None = None
    solids: tuple[Solid, ...] = ()
    cover: GroundCover = BARE_GROUND

    @cached_property
    def id(self) -> str:
        """24 hexadecimal digits, equal for equal geometry on any machine at any time."""
        digest = hashlib.blake2b(digest_size=12)
        for part in self._parts():
            digest.update(repr(part).encode() if not isinstance(part, np.ndarray) else part.data)
        return digest.hexdigest()

    def _parts(self) -> Iterator[Any]:
        yield from _plain(self.terrain.grid)
        yield from _plain(self.cover)
        if self.forest is not None:
            for model in self.forest.models:
                yield from (model.species, model.variant, model.height_m, model.dbh_m)
            forest = self.forest
            placing = (forest.model_index, forest.position_map, forest.yaw, forest.scale)
            yield from _plain(placing)
        for solid in self.solids:
            yield from (solid.name, solid.material, solid.top, solid.look)
            yield from _plain((solid.mesh.vertices, solid.mesh.triangles))


def _plain(parts: tuple[Any, ...]) -> Iterator[Any]:
    """Yields the shape and memory of arrays, and other values unchanged."""
    for part in parts:
        if isinstance(part, np.ndarray):
            yield part.shape
            yield np.ascontiguousarray(part)
        else:
            yield part


class WorldTopic:
    """Publishes the id of the present geometry on `/volery/world`, latched."""

    def __init__(self, graph: Graph, geometry: Callable[[], Geometry]) -> None:
        self._publisher = graph.advertise("/volery/world", String, latched=True)
        self._geometry = geometry
        self._published_id = ""

    def publish(self) -> None:
        """Publishes the id if it has changed; call it in the simulation's thread."""
        geometry_id = self._geometry().id
        if geometry_id != self._published_id:
            self._published_id = geometry_id
            self._publisher.publish(String(data=geometry_id))
