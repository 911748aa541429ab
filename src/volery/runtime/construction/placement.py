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
"""Depth of the feet in the ground at which a UAV starts on the ground all the same, m."""
_TILT_SWEEPS = 4
_GRIP_FRACTION = 0.9
"""Fraction of the feet's friction up to which a UAV rests on a slope."""
_DROP_M = 0.3
"""Height above the ground below which a landed UAV is placed on it, m."""
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
        yaw = rotations.from_yaw(math.radians(group.yaw_deg))
        altitude = scenario.types[group.type].flight.take_off_altitude_m
        for k in range(group.count):
            name = f"uav{len(starts) + 1}"
            where = f"{scenario.name}: uavs[{g}] ({name})"
            position = _nominal_position(group, k, airframe, terrain)
            slides = scenario.types[group.type].plant != "kinematic"
            if group.placement == "nearest_free":
                position = _nearest_free(
                    position, yaw, airframe, altitude, scene, terrain, starts, where, slides=slides
                )
            attitude, at_rest = yaw, False
            feet = _position_on_feet(position[:2], airframe, terrain)[2]
            if position[2] >= feet - _AT_REST_M and _is_on_terrain(position, terrain):
                what = f"{where}: {_at(position)}"
                position, attitude, at_rest = landed_pose(
                    position, yaw, airframe, terrain, what, slides=slides, hint=_HINT
                )
            check_position(
                position, airframe, scene, terrain, starts, where, hint=_HINT, at_rest=at_rest
            )
            starts.append(
                StartPose(
                    name,
                    group.type,
                    airframe,
                    position,
                    attitude,
                    on_ground=at_rest or stands_on_ground(position, airframe, terrain),
                    takes_off=group.on_start == "take_off",
                    at_rest=at_rest,
                )
            )
    return tuple(starts)


def _nominal_position(group: UavGroup, k: int, airframe: Airframe, terrain: Terrain) -> Array:
    xy = np.array(group.position_m[:2])
    if group.last_position_m is not None and group.count > 1:
        xy = xy + (np.array(group.last_position_m) - xy) * (k / (group.count - 1))
    if len(group.position_m) == 3:
        return np.array([xy[0], xy[1], group.position_m[2]])
    return _position_on_feet(xy, airframe, terrain)


def _position_on_feet(xy: Array, airframe: Airframe, terrain: Terrain) -> Array:
    """Returns the body position (3,), m, with all feet at or above the ground."""
    z = max(
        float(terrain.height(xy[0] + foot[0], xy[1] + foot[1])) - foot[2]
        for foot in airframe.ground.feet_m
    )
    return np.array([xy[0], xy[1], z])


def _is_on_terrain(position: Array, terrain: Terrain) -> bool:
    x0, y0, x1, y1 = terrain.bounds
    return bool(x0 <= position[0] <= x1 and y0 <= position[1] <= y1)


def _at(position: Array) -> str:
    return f"position_m ({position[0]:.2f}, {position[1]:.2f}, {position[2]:.2f})"


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
    position: Array,
    yaw: Array,
    airframe: Airframe,
    altitude: float,
    scene: Scene,
    terrain: Terrain,
    others: list[StartPose],
    where: str,
    *,
    slides: bool,
) -> Array:
    """Returns the nearest position on a spiral with room to stand, to climb and to other UAVs.

    slides: whether the UAV slides on ground that is too steep; it then stands elsewhere.
    """
    for radius in np.arange(0.0, _SEARCH_RADIUS_M, _SEARCH_STEP_M):
        around = max(1, int(2.0 * math.pi * radius / _SEARCH_STEP_M))
        for i in range(around):
            angle = 2.0 * math.pi * i / around
            xy = position[:2] + radius * np.array([math.cos(angle), math.sin(angle)])
            candidate = _position_on_feet(xy, airframe, terrain)
            column = candidate + np.linspace(0.0, altitude, _CLIMB_LOOKS)[:, None] * [0.0, 0.0, 1.0]
            room = scene.clearance(column, _ROOM_TO_STAND_M, include_terrain=False).distance
            apart = all(
                np.linalg.norm(candidate - other.position_map) > 2.0 * _ROOM_TO_STAND_M
                for other in others
            )
            free = room.min() >= _ROOM_TO_STAND_M and scene.enclosing(candidate[None])[0] < 0
            holds = not slides or resting(xy, yaw, airframe, terrain) is not None
            if apart and free and holds:
                return candidate
    raise PlacementError(
        f"{where}: no free position within {_SEARCH_RADIUS_M:g} m of "
        f"({position[0]:.1f}, {position[1]:.1f}) m with "
        f"{_ROOM_TO_STAND_M} m of room; choose another one"
    )


def stands_on_ground(position: Array, airframe: Airframe, terrain: Terrain) -> bool:
    """Returns whether a UAV at `position` (3,), m, stands, or is less than 0.3 m above standing."""
    return bool(position[2] - _position_on_feet(position[:2], airframe, terrain)[2] < _DROP_M)


def raised(position: Array, airframe: Airframe, terrain: Terrain) -> Array:
    """Returns `position` (3,), m, raised onto its feet if it lies between feet and ground."""
    ground = float(terrain.height(position[0], position[1]))
    on_feet = _position_on_feet(position[:2], airframe, terrain)
    return on_feet if ground - _PRESSED_M <= position[2] < on_feet[2] else position


def landed_pose(
    position: Array,
    attitude: Array,
    airframe: Airframe,
    terrain: Terrain,
    what: str,
    *,
    slides: bool,
    hint: str = "",
) -> tuple[Array, Array, bool]:
    """Returns position (3,), m, attitude (4,) and whether it rests, of a UAV that is landed.

    It rests if `position` is between the ground and 0.3 m above its height at rest, and keeps its
    heading. slides: whether ground can be too steep for it; `PlacementError`, which begins with
    `what` and ends with `hint`, is raised there.
    """
    position = raised(position, airframe, terrain)
    depth = _position_on_feet(position[:2], airframe, terrain)[2] - position[2]
    if depth > _AT_REST_M or not stands_on_ground(position, airframe, terrain):
        return position, attitude, False
    yaw = rotations.from_yaw(rotations.yaw_of(attitude))
    rest = resting(position[:2], yaw, airframe, terrain)
    if rest is not None:
        return (*rest, True)
    if slides:
        max_slope_deg = math.degrees(math.atan(_GRIP_FRACTION * airframe.ground.friction))
        raise PlacementError(
            f"{what}: the ground is steeper than the {max_slope_deg:.0f} degrees on which it "
            f"stands{hint}"
        )
    return _position_on_feet(position[:2], airframe, terrain), yaw, False


def check_position(
    position: Array,
    airframe: Airframe,
    scene: Scene,
    terrain: Terrain,
    others: Sequence[StartPose],
    where: str,
    *,
    hint: str = "",
    at_rest: bool = False,
) -> None:
    """Raises `PlacementError` if a UAV cannot be at `position` (3,), m, map, among `others`.

    `where` begins the message; `hint` ends it with a remedy. at_rest: the position is one of
    `resting`, where a tilted UAV may be lower than a level one.
    """
    at = _at(position)
    if not _is_on_terrain(position, terrain):
        x0, y0, x1, y1 = terrain.bounds
        raise PlacementError(
            f"{where}: {at} is beyond the terrain, which extends from ({x0:g}, {y0:g}) to "
            f"({x1:g}, {y1:g}) m"
        )
    check_room(position, airframe, scene, terrain, f"{where}: {at}", hint=hint, at_rest=at_rest)
    radius = airframe.body.collision_radius_m
    for other in others:
        distance = float(np.linalg.norm(position - other.position_map))
        needed = radius + other.airframe.body.collision_radius_m
        if distance < needed:
            raise PlacementError(
                f"{where}: {at} overlaps {other.name}, {distance:.2f} m away; "
                f"at least {needed:.2f} m is needed"
            )


def check_room(
    position: Array,
    airframe: Airframe,
    scene: Scene,
    terrain: Terrain,
    what: str,
    *,
    hint: str = "",
    at_rest: bool = False,
) -> None:
    """Raises `PlacementError` if a position (3,), m, map, is below the ground or in an obstacle.

    `what` begins the message; `hint` ends it with a remedy. at_rest: as in `check_position`.
    """
    min_z = float(_position_on_feet(position[:2], airframe, terrain)[2])
    if position[2] < min_z - _TOLERANCE_M and not at_rest:
        raise PlacementError(
            f"{what} lies {min_z - position[2]:.2f} m under the ground or with its feet in "
            f"it; z must be at least {min_z:.2f} there"
        )
    around = int(scene.enclosing(position[None])[0])
    if around >= 0:
        raise PlacementError(f"{what} lies inside {scene.instance_name(around)}{hint}")
    radius = airframe.body.collision_radius_m
    look = scene.clearance(position[None], radius, include_terrain=False)
    if look.instance[0] >= 0:
        raise PlacementError(
            f"{what} lies in {scene.instance_name(int(look.instance[0]))}, "
            f"{look.distance[0]:.2f} m from it; at least {radius:.2f} m is needed{hint}"
        )
