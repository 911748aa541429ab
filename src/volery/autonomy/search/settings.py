"""Parameters of a cooperative search."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from volery.autonomy.search.colour_blob import ColourRange
from volery.autonomy.search.search_positions import Area
from volery.core.errors import GraphError
from volery.graph.nodes.node import Node


@dataclass(frozen=True)
class SearchSettings:
    """Settings; see `cooperative_search.CooperativeSearch`."""

    name: str
    """Name of this UAV, from the node's namespace."""
    team: tuple[str, ...]
    area: Area
    altitude_m: float
    layer_spacing_m: float
    speed_m_s: float
    separation_m: float
    camera: str
    mount_m: tuple[float, ...]
    mount_rpy_deg: tuple[float, ...]
    object_height_m: float
    colours: ColourRange
    min_fraction: float
    gather_s: float
    timeout_s: float
    hold_s: float
    max_search_s: float
    seed: int

    @property
    def rank(self) -> int:
        """Index of this UAV in its team, from 0."""
        return self.team.index(self.name)

    @property
    def teammates(self) -> tuple[str, ...]:
        """Names of the other UAVs."""
        return tuple(name for name in self.team if name != self.name)

    @property
    def layer_z(self) -> float:
        """Height in the map at which this UAV flies, m."""
        return self.altitude_m + self.rank * self.layer_spacing_m

    @classmethod
    def declare(cls, node: Node) -> SearchSettings:
        """Declares and reads the parameters of a node. Raises GraphError for invalid values."""

        def number(name: str, default: float, minimum: float = -math.inf) -> float:
            value = float(node.declare_parameter(name, default).value)
            if not (math.isfinite(value) and value >= minimum):
                raise GraphError(
                    f"search: {name} must be a number of at least {minimum:g}, not {value}"
                )
            return value

        def numbers(name: str, default: Sequence[float]) -> tuple[float, ...]:
            values = tuple(float(v) for v in node.declare_parameter(name, list(default)).value)
            if len(values) != len(default) or not all(map(math.isfinite, values)):
                raise GraphError(f"search: {name} must be {len(default)} numbers, not {values}")
            return values

        name = node.get_namespace().strip("/")
        team = tuple(node.declare_parameter("team", [name]).value)
        if name not in team or len(set(team)) != len(team):
            raise GraphError(f"search: team must contain '{name}', and each UAV once, not {team}")
        first_hue, last_hue = numbers("hue_deg", ColourRange()[:2])
        minimums = number("min_saturation", 0.5, 0.0), number("min_value", 0.2, 0.0)
        return cls(
            name=name,
            team=team,
            area=Area(*numbers("area_m", (0.0, 0.0, 50.0, 50.0))),
            altitude_m=number("altitude_m", 8.0, 0.3),
            layer_spacing_m=number("layer_spacing_m", 2.0, 0.5),
            speed_m_s=number("speed_m_s", 3.0, 0.1),
            separation_m=number("separation_m", 3.0, 0.5),
            camera=str(node.declare_parameter("camera", "down").value),
            mount_m=numbers("mount_m", (0.0, 0.0, 0.0)),
            mount_rpy_deg=numbers("mount_rpy_deg", (0.0, 90.0, 0.0)),
            object_height_m=number("object_height_m", 0.5, 0.01),
            colours=ColourRange(first_hue, last_hue, *minimums),
            min_fraction=number("min_fraction", 0.001, 0.0),
            gather_s=number("gather_s", 20.0, 0.0),
            timeout_s=number("timeout_s", 5.0, 0.0),
            hold_s=number("hold_s", 5.0, 0.0),
            max_search_s=number("max_search_s", 0.0, 0.0),
            seed=int(node.declare_parameter("seed", 1).value),
        )
