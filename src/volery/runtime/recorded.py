"""Recorded logs in the place of worlds: what is shown of them, and the service that asks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from volery.core.errors import RecordingError
from volery.graph.graph import Graph
from volery.runtime.geometry import Geometry
from volery.runtime.player import Player
from volery.runtime.services.offering import offer_command
from volery.runtime.worlds import build_city, build_forest, build_solids, build_terrain
from volery.scenario.schema import Scenario
from volery.world.ground_cover import BARE_GROUND

_SUFFIXES = (".mcap", ".bag")


class Recorded:
    """A recording as clients join it: the player's graph, and what stood where it was flown."""

    def __init__(self, player: Player) -> None:
        self.graph = player.graph
        self.gateway = player.gateway
        self.scenario: Scenario | None = player.scenario
        self.geometry: Geometry | None = None
        if player.scenario is not None:
            self.geometry = geometry_of(player.scenario)
        self.be_prompt = player.be_prompt


def geometry_of(scenario: Scenario) -> Geometry:
    """What stands in the world of a scenario at its start."""
    terrain = build_terrain(scenario)
    city = build_city(scenario, terrain)
    cover = BARE_GROUND if city is None else city.cover
    forest = build_forest(scenario, terrain, city)
    return Geometry(terrain, forest, build_solids(scenario, terrain, city), cover)


def offer_recordings(graph: Graph, folder: Path | None, play: Callable[[Path], None]) -> None:
    """Offer `/volery/play_recording`: `play` is called with a log of the folder."""

    def handle(request: Any) -> None:
        play(recording_named(folder, request.name))

    srvtype = "volery_interfaces/srv/PlayRecording"
    offer_command(graph, "/volery/play_recording", srvtype, handle)


def recording_named(folder: Path | None, name: str) -> Path:
    """The log of that name. `RecordingError` where the folder has none."""
    if folder is None:
        raise RecordingError("there is no folder of recordings; start with --recordings")
    path = folder / name
    inside = path.name == name and path.suffix in _SUFFIXES and not path.is_symlink()
    if not inside or not path.is_file():
        raise RecordingError(f"there is no recording '{name[:100]}'")
    return path
