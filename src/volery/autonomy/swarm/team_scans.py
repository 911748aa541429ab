"""What the planar LIDARs of a team see: the nearest echoes around each UAV."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from volery.autonomy.perception.list_parameters import declare_mount
from volery.autonomy.perception.scan_points import ScanProjector
from volery.autonomy.swarm.team_link import TeamLink
from volery.core.arrays import Array
from volery.core.compiled import kernel
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import LaserScan
from volery.graph.nodes.node import Node

_SECTORS = 36
_MAX_RANGE_M = 8.0
_LEVEL_M = 0.8
"""Height difference beyond which an echo is no obstacle: of the ground, for a UAV that tilts."""
_TEAMMATE_M = 1.0
"""Distance from a UAV of the team within which an echo is its own."""


class TeamScans(SavedAttributes):
    """Subscribes to the scans of a team; a part of a node's state.

    topic: of the scans, below the UAVs' namespaces; empty: there are none. The LIDARs' position in
    the body is the parameter `lidar_mount`.
    """

    STATE = ("_points",)

    def __init__(self, node: Node, team: TeamLink, topic: str) -> None:
        self._team = team
        self._projector = ScanProjector(declare_mount(node, "lidar"), _MAX_RANGE_M, keep_every=1)
        self._points: list[Array] = [np.empty((0, 2))] * len(team.names)
        """(P, 2) m, map: echoes of the last scan of each UAV."""
        self._num_sectors = _SECTORS if topic else 0
        for row, name in enumerate(team.names if topic else ()):
            node.create_subscription(LaserScan, f"/{name}/{topic}", self._listener(row), 1)

    def _listener(self, row: int) -> Callable[[Any], None]:
        def on_scan(scan: Any) -> None:
            sample = self._team.sample(row)
            if sample is not None:
                points = self._projector.points(scan, sample)
                is_level = np.abs(points[:, 2] - sample.position[2]) < _LEVEL_M
                self._points[row] = np.ascontiguousarray(points[is_level, :2])

        return on_scan

    def echoes(self, members: Sequence[int], position: Array) -> Array:
        """Returns echoes (M, S, 2), offsets in m, of UAVs at positions (M, 2) m; NaN: none.

        Each sector around a UAV has its nearest echo. Those of other UAVs of the team are left out.
        """
        found = np.full((len(members), self._num_sectors, 2), np.nan)
        for i, row in enumerate(members if self._num_sectors else ()):
            find_nearest(self._points[row], position, i, found[i])
        return found


@kernel
def find_nearest(points: Any, position: Any, i: int, found: Any) -> None:
    """Fills the nearest echo of each sector (S, 2) of UAV i, of points (P, 2) in the map."""
    sectors = len(found)
    for p in range(len(points)):
        is_own = False
        for j in range(len(position)):
            x, y = points[p, 0] - position[j, 0], points[p, 1] - position[j, 1]
            is_own = is_own or (j != i and x * x + y * y < _TEAMMATE_M * _TEAMMATE_M)
        if is_own:
            continue
        x, y = points[p, 0] - position[i, 0], points[p, 1] - position[i, 1]
        sector = int((math.atan2(y, x) + math.pi) / (2.0 * math.pi) * sectors) % sectors
        before = math.hypot(found[sector, 0], found[sector, 1])
        if not math.hypot(x, y) >= before:  # also where there is none yet: nan
            found[sector, 0], found[sector, 1] = x, y
