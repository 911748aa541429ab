"""Builds the actors of a scenario."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache

from volery.core import rotations
from volery.scenario import actors as schema
from volery.scenario.schema import Scenario
from volery.world.actors import SHAPES, MovingActor, MovingActors
from volery.world.actors.motions import (
    ActorMotion,
    AttachedMotion,
    CircleMotion,
    GivenMotion,
    HeightAt,
    WaypointMotion,
)
from volery.world.actors.tags import code_words, tag_shape
from volery.world.scene_content import BodyShape
from volery.world.terrain import Terrain

_TURN_M = {"person": 0.3, "car": 2.0, "bird": 2.0, "tag": 0.5}
"""Distance before and after a waypoint within which an actor turns, m: a modelling choice."""


def build_actors(scenario: Scenario, terrain: Terrain) -> MovingActors | None:
    """Returns the actors of the scenario; None without any."""
    if not scenario.world.actors:
        return None

    def ground(x: float, y: float) -> float:
        return float(terrain.height(x, y))

    motions: dict[str, ActorMotion] = {}
    own = [a for a in scenario.world.actors if not isinstance(a.motion, schema.AttachedActor)]
    for actor in own:
        motions[actor.name] = _motion(actor, ground)
    shape_of = cache(_shape)
    return MovingActors(
        [
            MovingActor(
                actor.name,
                actor.shape,
                shape_of(actor.shape, actor.tag),
                motions.get(actor.name) or _attached(actor, motions),
                is_flat=actor.tag is not None,
                tags=() if actor.tag is None else _print_tags(actor.tag),
            )
            for actor in scenario.world.actors
        ]
    )


def _shape(name: str, tag: schema.AprilTag | None) -> BodyShape:
    return SHAPES[name]() if tag is None else tag_shape(tag.id, tag.size_m)


def _print_tags(tag: schema.AprilTag) -> tuple[str, ...]:
    """Returns what a client needs to draw the print: the code's 36 bits are hexadecimal digits."""
    code = f"{code_words()[tag.id]:09x}"
    return f"family={tag.family}", f"id={tag.id}", f"size_m={tag.size_m:g}", f"code={code}"


def _attached(actor: schema.Actor, motions: Mapping[str, ActorMotion]) -> ActorMotion:
    motion = actor.motion
    assert isinstance(motion, schema.AttachedActor)
    attitude = rotations.from_yaw(math.radians(motion.yaw_deg))
    return AttachedMotion(motions[motion.actor], [*motion.position_m, *attitude.tolist()])


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
    assert isinstance(motion, schema.ExternalActor)
    x, y, *rest = motion.position_m
    attitude = rotations.from_yaw(math.radians(motion.yaw_deg))
    return GivenMotion([x, y, rest[0] if rest else ground(x, y), *attitude.tolist()])
