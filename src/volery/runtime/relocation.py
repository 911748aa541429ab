"""UAVs that are put somewhere else while the simulation runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core import rotations
from volery.core.errors import CommandError, PlacementError
from volery.engine.engine import Engine
from volery.runtime.placement import Start, check_place, lifted, stands_on_ground
from volery.runtime.sensor_fitting import Fitted
from volery.world.scene import Scene
from volery.world.terrain import Terrain

Array = NDArray[np.float64]


class Relocator:
    """Puts UAVs of an engine where there is room for them."""

    def __init__(
        self,
        engine: Engine,
        scene: Scene,
        terrain: Terrain,
        starts: Sequence[Start],
        fitted: Sequence[Fitted],
    ) -> None:
        self._engine = engine
        self._scene = scene
        self._terrain = terrain
        self._starts = starts
        self._streams = {f.id.uav: f.key for f in fitted if f.id.name == "odom"}

    def place(self, row: int, position_map: ArrayLike, attitude: ArrayLike) -> None:
        """Put UAV `row` at (3,) m with (4,) x y z w, map from body; its motion goes on there.

        One that flies holds there; one that stood hovers if that is in the air. Its estimate
        begins anew. Raises `PlacementError` with the reason where it cannot be.
        """
        position = np.asarray(position_map, dtype=np.float64)
        if position.shape != (3,) or not np.isfinite(position).all():
            raise PlacementError(f"a position is three finite numbers, not {position_map!r}")
        fleet, start = self._engine.fleet, self._starts[row]
        try:
            position = lifted(position, start.airframe, self._terrain)
            self._check(row, position)
            in_air = not stands_on_ground(position, start.airframe, self._terrain)
            fleet.put(row, position, attitude, in_air=in_air)
        except CommandError as error:
            raise PlacementError(str(error)) from None
        self._engine.collisions.forget(np.array([row]))
        if self._engine.estimation is not None and row in self._streams:
            self._engine.estimation.restart({row: self._streams[row]})

    def move(self, row: int, velocity_map: ArrayLike, omega_map: ArrayLike) -> None:
        """Let UAV `row` move at (3,) m/s and turn at (3,) rad/s, both map, from now on.

        Its controllers take it from there. Raises `CommandError` for what cannot be.
        """
        attitude = self._engine.fleet.state.attitude[row]
        omega_body = rotations.rotate(rotations.conjugate(attitude), np.asarray(omega_map))
        self._engine.fleet.push(row, velocity_map, omega_body)

    def _check(self, row: int, position: Array) -> None:
        present = self._engine.fleet.state.position_map
        others = [
            replace(start, position_map=present[i])
            for i, start in enumerate(self._starts)
            if i != row and np.linalg.norm(present[i] - position) < 10.0
        ]
        start = self._starts[row]
        check_place(position, start.airframe, self._scene, self._terrain, others, start.name)
