"""The parts of observations that the node `policy` computes, by the names in policy files.

Each part names its inputs (`node_inputs`) and calls the same pure functions as the environments of
`volery.learning`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.policy import gate_terms, observation_terms, sensor_terms, team_terms
from volery.autonomy.policy.course_inputs import GatesInput, TrajectoryInput
from volery.autonomy.policy.description import ObservationPart, PolicyDescription
from volery.autonomy.policy.node_inputs import GoalInput, NodeInput, OdometryInput
from volery.autonomy.policy.sensor_inputs import (
    ColourInput,
    DepthInput,
    LineInput,
    ScanInput,
)
from volery.autonomy.policy.tag_input import TagInput
from volery.autonomy.policy.tag_terms import TAG_SIZE
from volery.autonomy.policy.team_inputs import NeighboursInput, PostsInput
from volery.core.arrays import Array
from volery.core.errors import NodeError
from volery.core.vectors import norm
from volery.graph.nodes.node import Node

_Input = TypeVar("_Input", bound=NodeInput)
INPUTS: dict[str, Callable[[Node, float], NodeInput]] = {
    "odometry": OdometryInput,
    "goal": GoalInput,
    "neighbours": NeighboursInput,
    "posts": PostsInput,
    "tags": TagInput,
    "scan": ScanInput,
    "depth": DepthInput,
    "colour": ColourInput,
    "line": LineInput,
    "trajectory": TrajectoryInput,
    "gates": GatesInput,
}
"""Inputs by the names that parts use."""


@dataclass
class Observed:
    """What a node knows at a decision."""

    inputs: Mapping[str, NodeInput]
    """By name."""
    last_action: Array
    """(A,)."""
    max_goal_distance_m: float = 0.0
    """Farther goals count as this far, in the same direction; 0: as far as they are."""

    @property
    def pose(self) -> OdometrySample:
        """Pose and velocity in the map."""
        pose = self.input(OdometryInput).pose
        assert pose is not None
        return pose

    @property
    def to_goal(self) -> Array:
        """Vector to the goal (3,), m, map."""
        vector = self.input(GoalInput).position - self.pose.position
        distance = float(norm(vector))
        if 0.0 < self.max_goal_distance_m < distance:
            vector = vector * (self.max_goal_distance_m / distance)
        return np.asarray(vector)

    def input(self, kind: type[_Input]) -> _Input:
        """Returns the input of a class."""
        return next(source for source in self.inputs.values() if isinstance(source, kind))


Compute = Callable[[Observed, Mapping[str, Any]], Array | NDArray[np.float32]]


@dataclass(frozen=True)
class Part:
    """How a node computes a part."""

    compute: Compute
    """Returns (size,) numbers in the part's unit, of what is observed and the part's parameters."""
    inputs: tuple[str, ...] = ()
    """Names of the inputs that it uses."""
    size: int | None = None
    """Numbers of the part; None: they depend on its parameters."""


def _goal_velocity(seen: Observed, _: Mapping[str, Any]) -> Array:
    velocity = seen.input(GoalInput).velocity
    return observation_terms.to_heading(seen.pose.attitude, velocity)


def _centre(seen: Observed, parameters: Mapping[str, Any]) -> Array:
    centre = np.array([parameters[f"{axis}_m"] for axis in "xyz"], np.float64)
    return observation_terms.to_heading(seen.pose.attitude, centre - seen.pose.position)


def _neighbours(seen: Observed, parameters: Mapping[str, Any]) -> Array:
    others, own = seen.input(NeighboursInput).present(), seen.pose
    position = np.array([o.position - own.position for o in others]).reshape(-1, 3)
    velocity = np.array([o.velocity - own.velocity for o in others]).reshape(-1, 3)
    return team_terms.neighbours(
        observation_terms.to_heading(own.attitude, position),
        observation_terms.to_heading(own.attitude, velocity),
        np.ones(len(others), np.bool_),
        **parameters,
    )


def _posts(seen: Observed, parameters: Mapping[str, Any]) -> Array:
    posts = seen.input(PostsInput).posts
    level = observation_terms.to_heading(seen.pose.attitude, posts - seen.pose.position)
    return team_terms.posts(level[:, :2], posts[:, 2], **parameters)


def _sectors(seen: Observed, parameters: Mapping[str, Any]) -> NDArray[np.float32]:
    scan = seen.input(ScanInput)
    keys = ("sectors", "angle_min_rad", "angle_max_rad", "max_range_m")
    own = {key: parameters[key] for key in keys}
    return sensor_terms.lidar_sectors(scan.ranges, scan.angles, **own)


def _line_offset(seen: Observed, _: Mapping[str, Any]) -> Array:
    return np.array([seen.input(LineInput).lateral_m(seen.pose.position)])


def _reference(seen: Observed, parameters: Mapping[str, Any]) -> Array:
    points = seen.input(TrajectoryInput).points(parameters["ahead_s"])
    return observation_terms.to_body(seen.pose.attitude, points - seen.pose.position)


def _gates(seen: Observed, parameters: Mapping[str, Any]) -> Array:
    centres = seen.input(GatesInput).ahead(int(parameters["count"]))[:, :3]
    return observation_terms.to_heading(seen.pose.attitude, centres - seen.pose.position)


def _gate_directions(seen: Observed, parameters: Mapping[str, Any]) -> Array:
    yaw = seen.input(GatesInput).ahead(int(parameters["count"]))[:, 3]
    return observation_terms.to_heading(seen.pose.attitude, gate_terms.directions(yaw))[:, :2]


_ODOMETRY, _GOAL = ("odometry",), ("odometry", "goal")
PARTS: dict[str, Part] = {
    "goal_body": Part(
        lambda seen, _: observation_terms.to_body(seen.pose.attitude, seen.to_goal), _GOAL, 3
    ),
    "goal_heading": Part(
        lambda seen, _: observation_terms.to_heading(seen.pose.attitude, seen.to_goal), _GOAL, 3
    ),
    "velocity_body": Part(
        lambda seen, _: observation_terms.to_body(seen.pose.attitude, seen.pose.velocity),
        _ODOMETRY,
        3,
    ),
    "velocity_heading": Part(
        lambda seen, _: observation_terms.to_heading(seen.pose.attitude, seen.pose.velocity),
        _ODOMETRY,
        3,
    ),
    "rotation": Part(
        lambda seen, _: observation_terms.rotation_rows(seen.pose.attitude), _ODOMETRY, 9
    ),
    "rates": Part(lambda seen, _: seen.pose.omega_body, _ODOMETRY, 3),
    "last_action": Part(lambda seen, _: seen.last_action),
    "tag": Part(
        lambda seen, parameters: seen.input(TagInput).observation(parameters),
        ("odometry", "tags"),
        TAG_SIZE,
    ),
    "goal_velocity_heading": Part(_goal_velocity, _GOAL, 3),
    "centre_heading": Part(_centre, _ODOMETRY, 3),
    "neighbours": Part(_neighbours, ("odometry", "neighbours")),
    "line_offset": Part(_line_offset, ("odometry", "line"), 1),
    "lidar_sectors": Part(_sectors, ("scan",)),
    "lidar_scan": Part(
        lambda seen, own: sensor_terms.lidar_scan(
            seen.input(ScanInput).ranges, max_range_m=own["max_range_m"]
        ),
        ("scan",),
    ),
    "depth_image": Part(
        lambda seen, own: sensor_terms.depth_image(
            seen.input(DepthInput).depth, max_depth_m=own["max_depth_m"]
        ),
        ("depth",),
    ),
    "colour_image": Part(
        lambda seen, _: sensor_terms.colour_image(seen.input(ColourInput).colour), ("colour",)
    ),
    "posts": Part(_posts, ("odometry", "posts")),
    "reference_body": Part(_reference, ("odometry", "trajectory")),
    "gates_heading": Part(_gates, ("odometry", "gates")),
    "gate_directions_heading": Part(_gate_directions, ("odometry", "gates")),
}
"""Parts by name."""


def needed_inputs(description: PolicyDescription) -> list[str]:
    """Returns the inputs of a policy's parts, each once, odometry first.

    Raises `NodeError` for a part that no node computes, or that has another size.
    """
    found = ["odometry"]
    for part in description.observation:
        known = PARTS.get(part.name)
        if known is None:
            raise NodeError(
                f"the policy observes '{part.name}', which no node computes; known: "
                f"{', '.join(sorted(PARTS))}"
            )
        if known.size not in (None, part.size):
            raise NodeError(f"part '{part.name}' has {known.size} numbers, not {part.size}")
        found += known.inputs
    return list(dict.fromkeys(found))


Histories = dict[str, Array]
"""Numbers (H, size) of the last decisions, oldest first, by part."""


def observe(
    parts: tuple[ObservationPart, ...], seen: Observed, histories: Histories
) -> NDArray[np.float32]:
    """Returns the observation (D,) as the network takes it, and updates `histories`.

    Raises `NodeError` if a part has another size than the policy's.
    """
    numbers = []
    for part in parts:
        values = np.asarray(PARTS[part.name].compute(seen, part.parameters), np.float64).ravel()
        if len(values) != part.size:
            raise NodeError(
                f"part '{part.name}' has {len(values)} numbers here; the policy takes {part.size}"
            )
        if part.history > 1:
            past = histories.get(part.name)
            histories[part.name] = observation_terms.stacked(past, values, part.history)
            values = histories[part.name].ravel()
        numbers.append(observation_terms.scaled(values, part.scale, part.limit))
    return np.concatenate(numbers).astype(np.float32)
