"""Sets the number of UAVs of a scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from volery.core.errors import ScenarioError

_APART_M = 3.0
"""Distance between UAVs that are added to a scenario of one, which separates their rotors' air."""


def resized(
    groups: Sequence[Mapping[str, Any]], uavs: int, *, name: str, where: str
) -> list[Mapping[str, Any]]:
    """Returns the only group of a scenario, as plain data, with another count.

    Additional UAVs on the ground are placed on the existing line, each at the nearest free
    position; in the air, on a new line. name: of the scenario, for the error. Raises
    `ScenarioError` for a scenario with several groups.
    """
    total = sum(group.get("count", 1) for group in groups)
    if uavs == total:
        return list(groups)
    if len(groups) > 1:
        raise ScenarioError(
            f"{where}: key 'uavs': scenario '{name}' has {len(groups)} groups of UAVs, "
            f"{total} in all, whose numbers are fixed"
        )
    first = groups[0]
    group = {**first, "count": uavs}
    if uavs < total or uavs == 1:
        return [group]
    in_air = len(first["position_m"]) == len("xyz")
    if in_air or first.get("last_position_m") is None:
        x, y = first["position_m"][:2]
        group["last_position_m"] = [x, y + _APART_M * (uavs - 1)]
    return [group if in_air else {**group, "placement": "nearest_free"}]
