"""Places UAVs at the start and checks that they fit there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from volery.core import rotations
from volery.core.arrays import Array
from volery.core.errors import PlacementError
from volery.scenario.schema import Scenario, UavGroup
from volery.vehicle.airframe import Airframe
from volery.world.scene import Scene
from volery.world.terrain import Terrain

_SEARCH_STEP_M = 1.0
_SEARCH_RADIUS_M = 30.0
_ROOM_TO_STAND_M = 1.5
_TOLERANCE_M = 0.002
"""Depth of the feet below the ground that counts as none, m."""
_AT_REST_M = 0.005
"""Maximum distance of a given height from that at rest at which a UAV stands there, m."""
_TILT_SWEEPS = 4
_GRIP_FRACTION = 0.9
"""Fraction of the feet's friction up to which a UAV rests on a slope."""
_DROP_M = 0.3
"""Max height above the ground at which a UAV still counts as landed, m."""
_PRESSED_M = 0.02
"""Max depth of the feet below the ground, more than after any landing, m."""
_HINT = ' (placement = "nearest_free" finds a free position)'
_CLIMB_LOOKS = 4
"""Number of heights up to the take-off altitude at which `nearest_free` requires room."""


@dataclass(frozen=True, eq=False)
class StartPose:
    """Describes one UAV before the first step; instances are compared by identity."""

    name: str
    type_name: str
    airframe: Airframe
    position_map: Array
    attitude: Array
    on_ground: bool
    takes_off: bool
    at_rest: bool = False
    """Whether the pose is one in which it rests on the ground."""


def place_uavs(
    scenario: Scenario, airframes: dict[str, Airframe], scene: Scene, terrain: Terrain
) -> tuple[StartPose, ...]:
    """Returns the start poses of all UAVs, numbered from uav1 through the groups.

    Raises `PlacementError` with the UAV, its key and the obstacle: a tree, a building, the
    ground, another UAV.
    """
    starts: list[StartPose] = []
    for g, group in enumerate(scenario.uavs):
        airframe = airframes[group.type]
        yaw = rotations.from_rpy(0.0, 0.0, math.radians(group.yaw_deg))
        altitude = scenario.types[group.type].flight.take_off_altitude_m
        for k in range(group.count):
            name = f"uav{len(starts) + 1}"
            where = f"{scenario.name}: uavs[{g}] ({name})"
            place = _nominal_place(group, k, airframe, terrain)
            if group.placement == "nearest_free":
                place = _nearest_free(place, airframe, altitude, scene, terrain, starts, where)
            rest = _rest_of(group, place, yaw, airframe, terrain)
            place, attitude = (place, yaw) if rest is None else rest
            check_place(
                place,
                airframe,
                scene,
                terrain,
                starts,
                where,
                hint=_HINT,
                at_rest=rest is not None,
            )
            starts.append(
                StartPose(
                    name,
                    group.type,
                    airframe,
                    place,
                    attitude,
                    on_ground=rest is not None or stands_on_ground(place, airframe, terrain),
                    takes_off=group.on_start == "take_off",
                    at_rest=rest is not None,
                )
            )
    return tuple(starts)


def _nominal_place(group: UavGroup, k: int, airframe: Airframe, terrain: Terrain) -> Array:
    xy = np.array(group.position_m[:2])
    if group.last_position_m is not None and group.count > 1:
        xy = xy + (np.array(group.last_position_m) - xy) * (k / (group.count - 1))
    if len(group.position_m) == 3:
        return np.array([xy[0], xy[1], group.position_m[2]])
    return _standing(xy, airframe, terrain)


def _standing(xy: Array, airframe: Airframe, terrain: Terrain) -> Array:
    """Returns the body position (3,), m, with all feet at or above the ground."""
    z = max(
        float(terrain.height(xy[0] + foot[0], xy[1] + foot[1])) - foot[2]
        for foot in airframe.ground.feet_m
    )
    return np.array([xy[0], xy[1], z])


def _rest_of(
    group: UavGroup, place: Array, yaw: Array, airframe: Airframe, terrain: Terrain
) -> tuple[Array, Array] | None:
    """Returns the pose at rest of a UAV that starts on the ground; None: it starts elsewhere."""
    given = len(group.position_m) == 3 and group.placement == "exact"
    if given and abs(place[2] - _standing(place[:2], airframe, terrain)[2]) > _AT_REST_M:
        return None
    x0, y0, x1, y1 = terrain.bounds
    if not (x0 <= place[0] <= x1 and y0 <= place[1] <= y1):
        return None
    return resting(place[:2], yaw, airframe, terrain)


def resting(
    xy: Array, yaw: Array, airframe: Airframe, terrain: Terrain
) -> tuple[Array, Array] | None:
    """Returns position (3,), m, and attitude (4,) in which a UAV rests on the ground.

    yaw: (4,), a turn about the vertical. It tilts with the plane below its feet, none of which is
    in the ground. None: the ground is too steep to rest on.
    """
    feet_body = np.array(airframe.ground.feet_m)
    attitude = yaw
    for _ in range(_TILT_SWEEPS):
        feet = rotations.rotate(attitude, feet_body)
        ground = terrain.height(xy[0] + feet[:, 0], xy[1] + feet[:, 1])
        spread = np.column_stack([feet[:, :2], np.ones(len(feet))])
        slope = np.linalg.lstsq(spread, ground, rcond=None)[0][:2]
        steepness = float(np.hypot(*slope))
        if steepness > _GRIP_FRACTION * airframe.ground.friction:
            return None
        if steepness == 0.0:
            attitude = yaw
            continue
        normal = np.array([-slope[0], -slope[1], 1.0]) / math.hypot(1.0, steepness)
        tilt = np.array([-normal[1], normal[0], 0.0, 1.0 + normal[2]])
        attitude = rotations.multiply(rotations.normalize(tilt), yaw)
    feet = rotations.rotate(attitude, feet_body)
    ground = terrain.height(xy[0] + feet[:, 0], xy[1] + feet[:, 1])
    return np.array([xy[0], xy[1], float((ground - feet[:, 2]).max())]), attitude


def _nearest_free(
    place: Array,
    airframe: Airframe,
    altitude: float,
    scene: Scene,
    terrain: Terrain,
    others: list[StartPose],
    where: str,
) -> Array:
    """Returns the nearest position on a spiral with room to stand, to climb and to other UAVs."""
    for radius in np.arange(0.0, _SEARCH_RADIUS_M, _SEARCH_STEP_M):
        around = max(1, int(2.0 * math.pi * radius / _SEARCH_STEP_M))
        for i in range(around):
            angle = 2.0 * math.pi * i / around
            xy = place[:2] + radius * np.array([math.cos(angle), math.sin(angle)])
            candidate = _standing(xy, airframe, terrain)
            column = candidate + np.linspace(0.0, altitude, _CLIMB_LOOKS)[:, None] * [0.0, 0.0, 1.0]
            room = scene.clearance(column, _ROOM_TO_STAND_M, include_terrain=False).distance
            apart = all(
                np.linalg.norm(candidate - other.position_map) > 2.0 * _ROOM_TO_STAND_M
                for other in others
            )
            if apart and room.min() >= _ROOM_TO_STAND_M and scene.enclosing(candidate[None])[0] < 0:
                return candidate
    raise PlacementError(
        f"{where}: no free position within {_SEARCH_RADIUS_M:g} m of "
        f"({place[0]:.1f}, {place[1]:.1f}) m with {_ROOM_TO_STAND_M} m of room; choose another one"
    )


def stands_on_ground(place: Array, airframe: Airframe, terrain: Terrain) -> bool:
    """Returns whether a UAV at `place` (3,), m, stands, or is less than 0.3 m above standing."""
    return bool(place[2] - _standing(place[:2], airframe, terrain)[2] < _DROP_M)


def lifted(place: Array, airframe: Airframe, terrain: Terrain) -> Array:
    """Returns `place` (3,), m, raised onto the ground if the feet are at most 2 cm below it."""
    standing = _standing(place[:2], airframe, terrain)
    return standing if 0.0 < standing[2] - place[2] < _PRESSED_M else place


def on_ground(place: Array, airframe: Airframe, terrain: Terrain) -> Array:
    """Returns `place` (3,), m, raised onto its feet if it lies between feet and ground."""
    ground = float(terrain.height(place[0], place[1]))
    standing = _standing(place[:2], airframe, terrain)
    return standing if ground - _PRESSED_M <= place[2] < standing[2] else place


def check_place(
    place: Array,
    airframe: Airframe,
    scene: Scene,
    terrain: Terrain,
    others: Sequence[StartPose],
    where: str,
    *,
    hint: str = "",
    at_rest: bool = False,
) -> None:
    """Raises `PlacementError` if a UAV cannot be at `place` (3,), m, map, among `others`.

    `where` begins the message; `hint` ends it with a remedy. at_rest: the place is one of
    `resting`, where a tilted UAV may be lower than a level one.
    """
    at = f"position_m ({place[0]:.2f}, {place[1]:.2f}, {place[2]:.2f})"
    x0, y0, x1, y1 = terrain.bounds
    if not (x0 <= place[0] <= x1 and y0 <= place[1] <= y1):
        raise PlacementError(
            f"{where}: {at} is beyond the terrain, which extends from ({x0:g}, {y0:g}) to "
            f"({x1:g}, {y1:g}) m"
        )
    check_room(place, airframe, scene, terrain, f"{where}: {at}", hint=hint, at_rest=at_rest)
    radius = airframe.body.collision_radius_m
    for other in others:
        distance = float(np.linalg.norm(place - other.position_map))
        needed = radius + other.airframe.body.collision_radius_m
        if distance < needed:
            raise PlacementError(
                f"{where}: {at} overlaps {other.name}, {distance:.2f} m away; "
                f"at least {needed:.2f} m is needed"
            )


def check_room(
    place: Array,
    airframe: Airframe,
    scene: Scene,
    terrain: Terrain,
    what: str,
    *,
    hint: str = "",
    at_rest: bool = False,
) -> None:
    """Raises `PlacementError` if a position (3,), m, map, is below the ground or in an obstacle.

    `what` begins the message; `hint` ends it with a remedy. at_rest: as in `check_place`.
    """
    standing = float(_standing(place[:2], airframe, terrain)[2])
    if place[2] < standing - _TOLERANCE_M and not at_rest:
        raise PlacementError(
            f"{what} lies {standing - place[2]:.2f} m under the ground or with its feet in "
            f"it; z must be at least {standing:.2f} there"
        )
    around = int(scene.enclosing(place[None])[0])
    if around >= 0:
        raise PlacementError(f"{what} lies inside {scene.instance_name(around)}{hint}")
    radius = airframe.body.collision_radius_m
    look = scene.clearance(place[None], radius, include_terrain=False)
    if look.instance[0] >= 0:
        raise PlacementError(
            f"{what} lies in {scene.instance_name(int(look.instance[0]))}, "
            f"{look.distance[0]:.2f} m from it; at least {radius:.2f} m is needed{hint}"
        )
