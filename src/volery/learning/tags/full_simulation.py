"""What the full simulation needs to fly tasks with tags: camera, tag, node and wind."""

from __future__ import annotations

import math
from typing import Any

from volery.core import rotations
from volery.learning.flight import Flight
from volery.learning.tags.memory import TAG_YAW
from volery.learning.tags.setup import RATE_HZ, downward_camera
from volery.learning.task import Task
from volery.learning.terms.observations import GOAL
from volery.runtime.simulation import Simulation

_ACTOR, _CAMERA = "tag", "down"
_WIND = {"velocity_m_s": [2.5, 1.5, 0.0], "turbulence": "light"}
"""Steady wind and gusts in the middle of what the task draws."""


def observes_tag(task: Task) -> bool:
    """Returns whether a task observes a tag."""
    return any(part.name == "tag" for part in task.observations)


def add_tag(data: dict[str, Any], uav_type: str, latency_s: float) -> None:
    """Adds camera, tag, wind and the node `tag_detection` to a scenario as plain data.

    latency_s: computation latency of the node.
    """
    camera = downward_camera()
    model = camera.model
    own = data["types"][uav_type]
    sensor = {
        "kind": "camera",
        "name": _CAMERA,
        "width": model.width,
        "height": model.height,
        "horizontal_fov_deg": model.horizontal_fov_deg,
        "samples": model.samples,
        "rate_hz": RATE_HZ,
        "position_m": list(camera.mount_m),
        "rpy_deg": list(camera.mount_rpy_deg),
    }
    own["sensors"] = [*own.get("sensors", []), sensor]
    parameters = {"camera": _CAMERA, "size_m": camera.tag_size_m, "ids": [camera.tag_id]}
    detection = {"node": "tag_detection", "latency_s": latency_s, "parameters": parameters}
    own["nodes"] = [detection, *own.get("nodes", [])]
    tag = {
        "name": _ACTOR,
        "shape": "tag",
        "tag": {"id": camera.tag_id, "size_m": camera.tag_size_m},
        "motion": {"kind": "external", "position_m": [0.0, 0.0]},
    }
    data["world"] = {**data.get("world", {}), "actors": [tag], "wind": _WIND}


def place_tag(simulation: Simulation, flight: Flight) -> None:
    """Moves the tag to its position and yaw in the values of a flight of one environment."""
    yaw = float(flight.values[TAG_YAW][0, 0])
    attitude = rotations.from_yaw(math.remainder(yaw, math.tau))
    simulation.world.set_actor_pose(_ACTOR, flight.values[GOAL][0, 0], attitude)
