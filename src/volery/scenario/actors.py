"""Scenario data of actors: people, vehicles, birds."""

from __future__ import annotations

import re
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from volery.scenario.base import Data, Name, NonNegative, Vector3

Speed = Annotated[float, Field(gt=0.0, le=100.0)]
_UAV_NAME = re.compile(r"uav\d+")


class WaypointActor(Data):
    """Moves along straight lines from waypoint to waypoint."""

    kind: Literal["waypoints"] = "waypoints"
    """Motion along waypoints."""
    waypoints_m: Annotated[
        tuple[Annotated[tuple[float, ...], Field(min_length=2, max_length=3)], ...],
        Field(min_length=2, max_length=10_000),
    ]
    """Each x, y (on the ground) or x, y, z in the map; all with the same dimension."""
    speed_m_s: Speed
    """Speed along the path."""
    at_end: Literal["loop", "back", "stop"] = "loop"
    """Continues to the first waypoint, reverses, or stops."""
    start_s: NonNegative = 0.0
    """Time at the first waypoint before the motion begins."""

    @model_validator(mode="after")
    def _waypoints_lead_somewhere(self) -> Self:
        if len({len(point) for point in self.waypoints_m}) != 1:
            raise ValueError("waypoints_m must have two numbers each, or three each")
        if len(set(self.waypoints_m)) == 1:
            raise ValueError("waypoints_m are all equal; at least two must differ")
        return self


class CircleActor(Data):
    """Circles at one height, banked like an aircraft."""

    kind: Literal["circle"] = "circle"
    """Motion on a circle."""
    centre_m: Vector3
    """Centre x, y, z of the circle in the map."""
    radius_m: Annotated[float, Field(gt=0.0, le=10_000.0)]
    """Radius of the circle."""
    speed_m_s: Speed
    """Speed along the circle."""
    start_deg: float = 0.0
    """Start angle on the circle, counter-clockwise from x."""
    clockwise: bool = False
    """Direction as seen from above."""


class ExternalActor(Data):
    """Receives its pose from `/actors/NAME/pose` or `/set_entity_state`."""

    kind: Literal["external"] = "external"
    """Motion that an external program sets."""
    position_m: Annotated[tuple[float, ...], Field(min_length=2, max_length=3)]
    """Initial position: x, y (on the ground) or x, y, z."""
    yaw_deg: float = 0.0
    """Initial heading, counter-clockwise from x of the map."""


class AttachedActor(Data):
    """Moves with another actor."""

    kind: Literal["attached"] = "attached"
    """Motion with another actor."""
    actor: Name
    """Name of the other actor."""
    position_m: Vector3
    """Position in the frame of the other actor: x forward, y left, z up."""
    yaw_deg: float = 0.0
    """Heading in the frame of the other actor, counter-clockwise from its x."""


class AprilTag(Data):
    """The print of an AprilTag."""

    family: Literal["36h11"] = "36h11"
    """Family of the tag."""
    id: Annotated[int, Field(ge=0, le=586)] = 0
    """Number of the tag in its family."""
    size_m: Annotated[float, Field(ge=0.01, le=20.0)] = 0.5
    """Outer side of the black border; the white border around it adds a quarter."""


class Actor(Data):
    """A moving body: every sensor sees it, and UAVs can hit it, but for a flat tag."""

    name: Name
    """Name of the actor in frames, topics and messages."""
    shape: Literal["person", "car", "bird", "tag"]
    """Body of the actor."""
    motion: Annotated[
        WaypointActor | CircleActor | ExternalActor | AttachedActor, Field(discriminator="kind")
    ]
    """Motion of the actor; only tags can be attached to another actor."""
    tag: AprilTag | None = None
    """Print of an actor of shape tag."""

    @model_validator(mode="after")
    def _is_no_uav(self) -> Self:
        if _UAV_NAME.fullmatch(self.name):
            raise ValueError(f"'{self.name}' is a UAV's name; give the actor another name")
        return self

    @model_validator(mode="after")
    def _tag_has_a_print(self) -> Self:
        if (self.shape == "tag") != (self.tag is not None):
            raise ValueError('shape = "tag" and a table tag = { id = 0 } belong together')
        if isinstance(self.motion, AttachedActor) and self.shape != "tag":
            raise ValueError("only actors of shape tag can be attached to another actor")
        return self


Actors = Annotated[tuple[Actor, ...], Field(max_length=1000)]


def check_actors(actors: tuple[Actor, ...]) -> None:
    """Raises `ValueError` if two actors have one name, or one is attached to no other actor."""
    names = [actor.name for actor in actors]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"names of actors must differ; used twice: {', '.join(twice)}")
    bodies = {actor.name for actor in actors if actor.shape != "tag"}
    for actor in actors:
        if isinstance(actor.motion, AttachedActor) and actor.motion.actor not in bodies:
            known = ", ".join(sorted(bodies)) or "none"
            raise ValueError(
                f"{actor.name} is attached to '{actor.motion.actor}', which is no actor other than "
                f"a tag; known: {known}"
            )
