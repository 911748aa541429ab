"""Manages the grid map of a running simulation: its name, block height and cell size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from volery.core.errors import CommandError
from volery.engine.engine import Engine
from volery.runtime.construction.grid_map import blocks_of, read_grid_map
from volery.scenario.schema import Scenario
from volery.world.grid_maps import GridMap
from volery.world.scene import Solid


class GridMapManager:
    """Shows one grid map at a time in the world of an engine; changes act from the next step.

    It reads all maps of the scenario at the start, so that a broken file fails then. A change is
    an event of kind `world`. A UAV inside a new block touches it with the next step.

    on_blocks: called after the blocks changed, also after a restore; it must change nothing.
    """

    def __init__(self, scenario: Scenario, engine: Engine, on_blocks: Callable[[], object]) -> None:
        world = scenario.world.grid_map
        self._engine = engine
        self._on_blocks = on_blocks
        self.on_change: Callable[[GridMap], None] = lambda _grid: None
        """Callback with each map that is shown; it must change nothing."""
        entries = () if world is None else world.maps
        self._maps = {entry.called: read_grid_map(scenario, entry) for entry in entries}
        starting = None if world is None or world.starting is None else self._maps[world.starting]
        self._current: GridMap | None = starting
        solids = engine.scene.solids
        count = 0 if starting is None or starting.bounds_of_blocks() is None else 1
        self._others = solids[: len(solids) - count]
        """All other solids of the world."""
        self._blocks: tuple[Solid, ...] = solids[len(solids) - count :]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the scenario's maps, and of the last one received over the graph."""
        return tuple(self._maps)

    @property
    def current(self) -> GridMap | None:
        """Present map; None before the first."""
        return self._current

    def change(
        self,
        name: str | None = None,
        *,
        block_height_m: float | None = None,
        cell_size_m: float | None = None,
    ) -> GridMap:
        """Shows another map, or changes block height or cell size of the present one.

        Without a height, blocks keep their present height; without a cell size, cells keep the size
        that they last had in that map. The origin is fixed. Raises `CommandError`, and changes
        nothing, if the map is unknown, a size is invalid or blocks exceed the terrain.
        """
        if name is not None and name not in self._maps:
            known = ", ".join(self._maps) or "none"
            raise CommandError(f"there is no grid map '{name}'; known: {known}")
        grid = self._current if name is None else self._maps[name]
        if grid is None:
            raise CommandError("there is no grid map yet; name one, or send one")
        if block_height_m is None and self._current is not None:
            block_height_m = self._current.block_height_m
        changed = replace(
            grid,
            cell_size_m=grid.cell_size_m if cell_size_m is None else cell_size_m,
            block_height_m=grid.block_height_m if block_height_m is None else block_height_m,
        )
        self.show(changed)
        return changed

    def show(self, grid: GridMap) -> None:
        """Puts the blocks of `grid` into the world; its name stays available for `change`."""
        blocks = blocks_of(grid, self._engine.ground)
        self._maps = {**self._maps, grid.name: grid}
        self._stand(grid, blocks)
        self._engine.note_world(grid.describe())
        self.on_change(grid)

    def refuse(self, reason: str) -> None:
        """Logs an event with the reason why a received map is not shown."""
        self._engine.note_world(f"a grid map was refused: {reason}")

    def get_state(self) -> object:
        """Returns the present map, its blocks and all maps, for a snapshot."""
        return self._current, self._blocks, self._maps

    def set_state(self, state: object) -> None:
        """Restores a saved state. The caller must restore the engine's state afterwards."""
        assert isinstance(state, tuple)
        current, blocks, self._maps = state
        if current is not self._current:
            self._stand(current, blocks)

    def _stand(self, grid: GridMap | None, blocks: tuple[Solid, ...]) -> None:
        self._engine.replace_solids((*self._others, *blocks))
        self._current, self._blocks = grid, blocks
        self._on_blocks()
