"""How the teams of nodes flee from hostile UAVs."""

from __future__ import annotations

import numpy as np

from volery.autonomy.swarm.team_link import TeamLink, number
from volery.core.arrays import Array
from volery.core.saved_state import SavedAttributes
from volery.graph.nodes.node import Node


class HostileUavs(SavedAttributes):
    """Follows hostile UAVs, and adds to the velocities of a team what it lacks to flee from them.

    Declares the parameters `hostile`, `hostile_m` and `flee_m_s` of a node. odometry: name of the
    topic below the UAVs' namespaces; height_m: of the flight, in the map.
    """

    PARTS = ("_link",)

    def __init__(self, node: Node, odometry: str, height_m: float) -> None:
        self.names = tuple(node.declare_parameter("hostile", []).value)
        """Names of the UAVs."""
        self._distance_m = number(node, "hostile_m", 20.0, 0.1, 1000.0)
        self.speed_m_s = number(node, "flee_m_s", 5.0, 0.0, 100.0)
        """Speed at which a team flees."""
        self._link = TeamLink(node, self.names, odometry, height_m, is_commanded=False)

    def add_flight(self, position: Array, preferred: Array, now_ns: int) -> bool:
        """Adds to preferred velocities (M, 2) what UAVs lack to part from hostile ones.

        position: (M, 2) m. Velocities across the way are left: the team passes them. Returns
        whether a hostile UAV is near.
        """
        is_near = False
        for hostile in self._link.present(now_ns).values():
            away = position - hostile.position[:2]
            distance = np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
            outward = away / distance
            part = np.clip(2.0 - 2.0 * distance / self._distance_m, 0.0, 1.0)
            lacking = part * self.speed_m_s - (preferred * outward).sum(axis=1, keepdims=True)
            preferred += np.where(part > 0.0, np.maximum(lacking, 0.0), 0.0) * outward
            is_near |= bool((part > 0.0).any())
        return is_near
