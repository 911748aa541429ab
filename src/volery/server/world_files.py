"""Exports the world as glTF, once for each geometry, in a separate thread."""

from __future__ import annotations

import asyncio
import gzip
from dataclasses import dataclass

from volery.runtime.construction.geometry import Geometry
from volery.runtime.construction.world_asset import asset_of
from volery.scenario.schema import Scenario
from volery.world.trees.model import DetailLevel

_MAX_CACHED = 6
"""Max number of cached files."""
_EFFORT = 6
"""Level of gzip; 9 takes three times as long for one per cent."""


@dataclass(frozen=True)
class WorldFile:
    """One .glb file, plain and compressed."""

    plain: bytes
    zipped: bytes


class WorldFiles:
    """Exports and caches the files. Its methods belong to one event loop."""

    def __init__(self) -> None:
        self._cache: dict[tuple[str, DetailLevel], asyncio.Task[WorldFile]] = {}

    async def get(self, scenario: Scenario, geometry: Geometry, detail: DetailLevel) -> WorldFile:
        """Returns the file of a geometry; concurrent requests share one export."""
        key = geometry.id, detail
        task = self._cache.get(key)
        if task is None or (task.done() and (task.cancelled() or task.exception())):
            making = asyncio.to_thread(_made, scenario, geometry, detail)
            task = self._cache[key] = asyncio.create_task(making)
            while len(self._cache) > _MAX_CACHED:
                del self._cache[next(iter(self._cache))]
        return await asyncio.shield(task)


def _made(scenario: Scenario, geometry: Geometry, detail: DetailLevel) -> WorldFile:
    content = asset_of(scenario, geometry, detail)
    return WorldFile(content, gzip.compress(content, _EFFORT, mtime=0))
