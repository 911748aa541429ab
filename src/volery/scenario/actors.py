"""Scenario data of what moves by itself: people, vehicles, birds."""

from __future__ import annotations

import re
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from volery.scenario.base import Data, Name, NonNegative, Vector3

Speed = Annotated[float, Field(gt=0.0, le=100.0)]
_UAV_NAME = re.compile(r"uav\d+")


class WaypointActor(Data):
    """Along straight lines from one waypoint to the next."""

    kind: Literal["waypoints"]
    waypoints_m: Annotated[
        tuple[Annotated[tuple[float, ...], Field(min_length=2, max_length=3)], ...],
        Field(min_length=2, max_length=10_000),
    ]
    """Each x, y (on the ground) or x, y, z in the map; all have as many numbers."""
    speed_m_s: Speed
    at_end: Literal["loop", "back", "stop"] = "loop"
    """Goes on to the first one, turns back, or stays."""
    start_s: NonNegative = 0.0
    """Until then it stands at the first."""

    @model_validator(mode="after")
    def _waypoints_lead_somewhere(self) -> Self:
        if len({len(point) for point in self.waypoints_m}) != 1:
            raise ValueError("waypoints_m have two numbers each, or three each")
        if len(set(self.waypoints_m)) == 1:
            raise ValueError("waypoints_m are all the same place; two at least must differ")
        return self


class CircleActor(Data):
    """Round and round at one height, leaning into the turn as what flies does."""

    kind: Literal["circle"]
    centre_m: Vector3
    radius_m: Annotated[float, Field(gt=0.0, le=10_000.0)]
    speed_m_s: Speed
    start_deg: float = 0.0
    """Where on the circle it begins, counter-clockwise from x."""
    clockwise: bool = False


class ExternalActor(Data):
    """Stands where it is put by `/things/NAME/pose` or `/set_entity_state`."""

    kind: Literal["outside"]
    position_m: Annotated[tuple[float, ...], Field(min_length=2, max_length=3)]
    """Until then: x, y (on the ground) or x, y, z."""
    yaw_deg: float = 0.0


class Actor(Data):
    """One of them: every sensor sees it, and UAVs can hit it."""

    name: Name
    shape: Literal["person", "car", "bird"]
    motion: Annotated[WaypointActor | CircleActor | ExternalActor, Field(discriminator="kind")]

    @model_validator(mode="after")
    def _is_no_uav(self) -> Self:
        if _UAV_NAME.fullmatch(self.name):
            raise ValueError(f"'{self.name}' is a name of UAVs; a thing is called otherwise")
        return self


Things = Annotated[tuple[Actor, ...], Field(max_length=1000)]


def check_things(things: tuple[Actor, ...]) -> None:
    """ValueError where two things have one name."""
    names = [thing.name for thing in things]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"names of things must differ; used twice: {', '.join(twice)}")
