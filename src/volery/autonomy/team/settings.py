"""Parameters of a task manager."""

from __future__ import annotations

import math
from dataclasses import dataclass

from volery.autonomy.search.search_positions import Area
from volery.autonomy.team.sectors import Sectors
from volery.core.errors import GraphError
from volery.graph.nodes.node import Node


@dataclass(frozen=True)
class TeamSettings:
    """Settings; see `task_manager.TaskManager`."""

    name: str
    """Name of this UAV, from the node's namespace."""
    sectors: Sectors
    altitude_m: float
    cell_m: float
    sight_m: float
    enough: float
    gather_s: float
    patience_s: float
    stuck_s: float
    low_battery: float
    search_s: float
    alone_s: float
    gate_m: float
    corrected: bool
    odometry: str
    goal_topic: str

    @classmethod
    def declare(cls, node: Node) -> TeamSettings:
        """Declares and reads the parameters of a node. Raises GraphError for invalid values."""

        def number(name: str, default: float, least: float, most: float = math.inf) -> float:
            value = float(node.declare_parameter(name, default).value)
            if not (math.isfinite(value) and least <= value <= most):
                within = f"{least:g} to {most:g}" if math.isfinite(most) else f"at least {least:g}"
                raise GraphError(f"task_manager: {name} must be {within}, not {value}")
            return value

        corners = node.declare_parameter("area_m", [0.0, 0.0, 100.0, 100.0]).value
        area = tuple(float(value) for value in corners)
        if len(area) != 4 or not (area[0] < area[2] and area[1] < area[3]):
            raise GraphError(
                f"task_manager: area_m must be [x_min, y_min, x_max, y_max], not {list(area)}"
            )
        name = node.get_namespace().strip("/")
        if not name:
            raise GraphError("task_manager: no namespace; run the node in the namespace of its UAV")
        return cls(
            name=name,
            sectors=Sectors(Area(*area), number("sector_m", 40.0, 1.0)),
            altitude_m=number("altitude_m", 3.0, 0.3),
            cell_m=number("cell_m", 2.0, 0.1),
            sight_m=number("sight_m", 6.0, 0.1),
            enough=number("enough", 0.9, 0.0, 1.0),
            gather_s=number("gather_s", 3.0, 0.0),
            patience_s=number("patience_s", 5.0, 0.1),
            stuck_s=number("stuck_s", 30.0, 1.0),
            low_battery=number("low_battery", 0.3, 0.0, 1.0),
            search_s=number("search_s", 0.0, 0.0),
            alone_s=number("alone_s", 0.0, 0.0),
            gate_m=number("gate_m", 4.0, 0.0),
            corrected=bool(node.declare_parameter("corrected", False).value),
            odometry=str(node.declare_parameter("odometry", "odom").value),
            goal_topic=str(node.declare_parameter("goal_topic", "planning/goal").value),
        )
