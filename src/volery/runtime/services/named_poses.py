"""Serves the named poses of the standard: the start poses of the UAVs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from volery.graph.graph import Graph
from volery.graph.messages import Vector3
from volery.runtime.construction.placement import StartPose
from volery.runtime.services.entities import pose_message
from volery.runtime.services.filters import BoundsType, tag_filter
from volery.runtime.services.results import Fields, RefusedError, ResultCode, filled, offer_result

_MSG = "simulation_interfaces/msg"
_SRV = "simulation_interfaces/srv"
_SUFFIX = "_start"


def offer_named_poses(graph: Graph, starts: Sequence[StartPose]) -> None:
    """Creates `/get_named_poses` and `/get_named_pose_bounds`: `uav1_start`, `uav2_start`, ..."""
    by_name = {f"{start.name}{_SUFFIX}": start for start in starts}

    def poses(request: Any) -> Fields:
        passes = tag_filter(request.tags)
        found = [(n, s) for n, s in by_name.items() if passes(["start", s.type_name])]
        return {"poses": [_named(name, start) for name, start in found]}

    def bounds(request: Any) -> Fields:
        start = by_name.get(request.name)
        if start is None:
            raise RefusedError(ResultCode.NOT_FOUND, f"there is no named pose '{request.name}'")
        center, radius = start.position_map, start.airframe.body.collision_radius_m
        points = [Vector3(*center.tolist()), Vector3(radius, 0.0, 0.0)]
        return {"bounds": filled(f"{_MSG}/Bounds", {"type": BoundsType.SPHERE, "points": points})}

    offer_result(graph, "/get_named_poses", f"{_SRV}/GetNamedPoses", poses)
    offer_result(graph, "/get_named_pose_bounds", f"{_SRV}/GetNamedPoseBounds", bounds)


def _named(name: str, start: StartPose) -> Any:
    fields = {
        "name": name,
        "description": f"start pose of {start.name}",
        "tags": ["start", start.type_name],
        "pose": pose_message(np.asarray(start.position_map), np.asarray(start.attitude)),
    }
    return filled(f"{_MSG}/NamedPose", fields)
