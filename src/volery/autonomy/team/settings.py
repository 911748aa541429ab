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
    resolution_m: float
    view_radius_m: float
    coverage_fraction: float
    gather_s: float
    timeout_s: float
    stuck_timeout_s: float
    low_battery_fraction: float
    max_search_s: float
    team_timeout_s: float
    gate_m: float
    use_map_tf: bool
    odometry: str
    goal_topic: str

    @classmethod
    def declare(cls, node: Node) -> TeamSettings:
        """Declares and reads the parameters of a node. Raises GraphError for invalid values."""

        def number(name: str, default: float, minimum: float, maximum: float = math.inf) -> float:
            value = float(node.declare_parameter(name, default).value)
            if not (math.isfinite(value) and minimum <= value <= maximum):
                within = (
                    f"{minimum:g} to {maximum:g}"
                    if math.isfinite(maximum)
                    else f"at least {minimum:g}"
                )
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
            resolution_m=number("resolution_m", 2.0, 0.1),
            view_radius_m=number("view_radius_m", 6.0, 0.1),
            coverage_fraction=number("coverage_fraction", 0.9, 0.0, 1.0),
            gather_s=number("gather_s", 3.0, 0.0),
            timeout_s=number("timeout_s", 5.0, 0.1),
            stuck_timeout_s=number("stuck_timeout_s", 30.0, 1.0),
            low_battery_fraction=number("low_battery_fraction", 0.3, 0.0, 1.0),
            max_search_s=number("max_search_s", 0.0, 0.0),
            team_timeout_s=number("team_timeout_s", 0.0, 0.0),
            gate_m=number("gate_m", 4.0, 0.0),
            use_map_tf=bool(node.declare_parameter("use_map_tf", False).value),
            odometry=str(node.declare_parameter("odometry", "odom").value),
            goal_topic=str(node.declare_parameter("goal_topic", "planning/goal").value),
        )
