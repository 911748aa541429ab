"""Scenario data of actors: people, vehicles, birds."""

from __future__ import annotations

import re
from typing import Annotated, Literal, Self

from pydantic import Field, WithJsonSchema, field_validator, model_validator

from volery.scenario.base import Data, Name, NonNegative, Vector3, warn_of_former_word

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

    kind: Annotated[
        Literal["external", "outside"],
        WithJsonSchema({"const": "external", "type": "string"}),
    ] = "external"
    """Motion that an external program sets."""
    position_m: Annotated[tuple[float, ...], Field(min_length=2, max_length=3)]
    """Initial position: x, y (on the ground) or x, y, z."""
    yaw_deg: float = 0.0
    """Initial heading, counter-clockwise from x of the map."""

    @field_validator("kind")
    @classmethod
    def _rename_former_kind(cls, kind: str) -> str:
        if kind == "outside":
            warn_of_former_word("motion 'outside'", "external")
        return "external"


class Actor(Data):
    """A moving body: every sensor sees it, and UAVs can hit it."""

    name: Name
    """Name of the actor in frames, topics and messages."""
    shape: Literal["person", "car", "bird"]
    """Body of the actor."""
    motion: Annotated[WaypointActor | CircleActor | ExternalActor, Field(discriminator="kind")]
    """Motion of the actor."""

    @model_validator(mode="after")
    def _is_no_uav(self) -> Self:
        if _UAV_NAME.fullmatch(self.name):
            raise ValueError(f"'{self.name}' is a UAV's name; give the actor another name")
        return self


Actors = Annotated[tuple[Actor, ...], Field(max_length=1000)]


def check_actors(actors: tuple[Actor, ...]) -> None:
    """Raises `ValueError` if two actors have the same name."""
    names = [actor.name for actor in actors]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"names of actors must differ; used twice: {', '.join(twice)}")
