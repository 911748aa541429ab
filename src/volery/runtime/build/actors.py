"""Builds the actors of a scenario."""

from __future__ import annotations

import math

from volery.core import rotations
from volery.scenario import actors as schema
from volery.scenario.schema import Scenario
from volery.world.actors import SHAPES, MovingActor, MovingActors
from volery.world.actors.motions import (
    ActorMotion,
    CircleMotion,
    GivenMotion,
    HeightAt,
    WaypointMotion,
)
from volery.world.terrain import Terrain

_TURN_M = {"person": 0.3, "car": 2.0, "bird": 2.0}
"""Distance before and after a waypoint within which an actor turns, m: a modelling choice."""


def build_actors(scenario: Scenario, terrain: Terrain) -> MovingActors | None:
    """Returns the actors of the scenario; None without any."""
    if not scenario.world.actors:
        return None
    shapes = {name: SHAPES[name]() for name in {actor.shape for actor in scenario.world.actors}}

    def ground(x: float, y: float) -> float:
        return float(terrain.height(x, y))

    return MovingActors(
        [
            MovingActor(actor.name, actor.shape, shapes[actor.shape], _motion(actor, ground))
            for actor in scenario.world.actors
        ]
    )


def _motion(actor: schema.Actor, ground: HeightAt) -> ActorMotion:
    motion = actor.motion
    if isinstance(motion, schema.WaypointActor):
        return WaypointMotion(
            motion.waypoints_m,
            motion.speed_m_s,
            motion.at_end,
            start_s=motion.start_s,
            turn_m=_TURN_M[actor.shape],
            ground=ground if len(motion.waypoints_m[0]) == 2 else None,
        )
    if isinstance(motion, schema.CircleActor):
        return CircleMotion(
            motion.centre_m,
            motion.radius_m,
            motion.speed_m_s,
            start_rad=math.radians(motion.start_deg),
            clockwise=motion.clockwise,
        )
    x, y, *rest = motion.position_m
    attitude = rotations.from_rpy(0.0, 0.0, math.radians(motion.yaw_deg))
    return GivenMotion([x, y, rest[0] if rest else ground(x, y), *attitude.tolist()])
