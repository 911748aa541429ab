"""Missions, fences and rally points: their items and the checks on each item."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from volery.mavlink.autopilot.modes import payload_items

MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255
"""Values of MAV_MISSION_TYPE."""
MAX_ITEMS = {MISSION: 500, FENCE: 200, RALLY: 50}
"""Largest numbers of items (modelling choice), similar to PX4 on a flight controller."""

WAYPOINT, LOITER_UNLIMITED, LOITER_TIME, LOITER_TO_ALTITUDE = 16, 17, 19, 31
RETURN_TO_LAUNCH, LAND, TAKE_OFF = 20, 21, 22
DELAY, CONDITION_DELAY, CONDITION_YAW = 93, 112, 115
JUMP, CHANGE_SPEED, SET_HOME = 177, 178, 179
"""MAV_CMD of missions."""
RETURN_POINT, POLYGON_IN, POLYGON_OUT, CIRCLE_IN, CIRCLE_OUT = 5000, 5001, 5002, 5003, 5004
RALLY_POINT = 5100
"""MAV_CMD of fences and rally points."""
PLACED = {WAYPOINT, LOITER_UNLIMITED, LOITER_TIME, LOITER_TO_ALTITUDE, LAND, TAKE_OFF}
"""Items of missions with a position."""
_KNOWN = {
    MISSION: PLACED
    | {RETURN_TO_LAUNCH, DELAY, CONDITION_DELAY, CONDITION_YAW, JUMP, CHANGE_SPEED, SET_HOME}
    | payload_items.COMMANDS,
    FENCE: {RETURN_POINT, POLYGON_IN, POLYGON_OUT, CIRCLE_IN, CIRCLE_OUT},
    RALLY: {RALLY_POINT},
}
NEED_NO_POSITION = {
    DELAY,
    CONDITION_DELAY,
    CONDITION_YAW,
    JUMP,
    CHANGE_SPEED,
    SET_HOME,
} | payload_items.MARKERS
"""Items that may precede a take-off."""
AMSL, MISSION_FRAME, ABOVE_HOME = (0, 5), (2,), (3, 6)
"""MAV_FRAME: GLOBAL(_INT); MISSION; GLOBAL_RELATIVE_ALT(_INT). As in PX4 there are no others."""

ACCEPTED, ERROR, BAD_FRAME, UNSUPPORTED, NO_SPACE, INVALID = 0, 1, 2, 3, 4, 5
INVALID_PARAM1, INVALID_X, INVALID_Y, INVALID_Z, INVALID_SEQUENCE, DENIED = 6, 10, 11, 12, 13, 14
CANCELLED = 15
"""Values of MAV_MISSION_RESULT."""


_UNSET = {-(2**31), 2**31 - 1}
"""Integers that stand for a missing latitude or longitude; MAVLink's is INT32_MAX."""
_LEVEL_SPEEDS = (0.0, 1.0)
"""SPEED_TYPE of speeds along the ground."""


class MissionItem(NamedTuple):
    """One item. latitude and longitude in degrees, nan if not given; altitude m."""

    command: int
    frame: int
    params: tuple[float, float, float, float]
    latitude: float
    longitude: float
    altitude: float
    goes_on: bool = True
    """Field autocontinue."""

    @property
    def placed(self) -> bool:
        """Whether the item has a position."""
        here = self.latitude == 0.0 and self.longitude == 0.0
        return math.isfinite(self.latitude) and math.isfinite(self.longitude) and not here


def item_of(message: Any) -> MissionItem:
    """Converts a MISSION_ITEM_INT or a MISSION_ITEM."""
    frame = int(message.frame)
    params = (message.param1, message.param2, message.param3, message.param4)
    x, y = float(message.x), float(message.y)
    if message.get_type() == "MISSION_ITEM_INT":
        unset = {message.x, message.y} & _UNSET
        x, y = (math.nan, math.nan) if unset else (x * 1e-7, y * 1e-7)
    return MissionItem(
        int(message.command), frame, params, x, y, message.z, bool(message.autocontinue)
    )


def fault_of(item: MissionItem, kind: int, count: int) -> int:  # noqa: PLR0911
    """Returns the MAV_MISSION_RESULT of an item of a plan of `count` items."""
    if item.command not in _KNOWN[kind]:
        return UNSUPPORTED
    if any(math.isinf(param) or abs(param) > 1e9 for param in item.params):
        return INVALID
    if kind == MISSION and item.command in payload_items.COMMANDS:
        fields = (*item.params, item.latitude, item.longitude, item.altitude)
        return payload_items.fault_of(item.command, item.frame, fields)
    if item.command == JUMP:
        whole = item.params[0] == item.params[0] // 1 and item.params[1] == item.params[1] // 1
        return ACCEPTED if whole and 0 <= item.params[0] < count else INVALID_PARAM1
    if item.command in (DELAY, CONDITION_DELAY, LOITER_TIME) and not item.params[0] >= 0.0:
        return INVALID_PARAM1
    if item.command == CHANGE_SPEED:
        if not (math.isnan(item.params[0]) or item.params[0] in _LEVEL_SPEEDS):
            return INVALID_PARAM1
        return ACCEPTED if math.isfinite(item.params[1]) else INVALID_PARAM1 + 1
    if item.command == CONDITION_YAW:
        return _fault_of_turn(item)
    if kind == MISSION and item.command not in (*PLACED, SET_HOME):
        return ACCEPTED
    return _fault_of_position(item, kind)


def _fault_of_turn(item: MissionItem) -> int:
    angle, rate, direction, relative = item.params
    if not math.isfinite(angle):
        return INVALID_PARAM1
    if rate < 0.0:
        return INVALID_PARAM1 + 1
    if not (math.isnan(direction) or direction in (-1.0, 0.0, 1.0)):
        return INVALID_PARAM1 + 2
    known = math.isnan(relative) or relative in (0.0, 1.0)
    return ACCEPTED if known else INVALID_PARAM1 + 3


def _fault_of_position(item: MissionItem, kind: int) -> int:  # noqa: PLR0911
    if item.frame not in (*AMSL, *ABOVE_HOME, *(MISSION_FRAME if kind != MISSION else ())):
        return BAD_FRAME
    if kind != MISSION or item.placed:
        if not abs(item.latitude) <= 90.0:
            return INVALID_X
        if not abs(item.longitude) <= 180.0:
            return INVALID_Y
    if kind != FENCE and not (math.isfinite(item.altitude) and abs(item.altitude) < 1e5):
        return INVALID_Z
    circle = item.command in (CIRCLE_IN, CIRCLE_OUT)
    if circle and not item.params[0] >= 0.0:  # PX4 accepts 0, which contains nothing
        return INVALID_PARAM1
    if item.command in (POLYGON_IN, POLYGON_OUT) and not 3 <= item.params[0] <= MAX_ITEMS[FENCE]:
        return INVALID_PARAM1
    return ACCEPTED


def polygons_are_whole(items: list[MissionItem]) -> bool:
    """Returns whether each polygon of a fence has its stated number of consecutive corners."""
    k = 0
    while k < len(items):
        if items[k].command in (POLYGON_IN, POLYGON_OUT):
            corners = int(items[k].params[0])
            same = {(item.command, int(item.params[0])) for item in items[k : k + corners]}
            if len(items) - k < corners or len(same) != 1:
                return False
            k += corners
        else:
            k += 1
    return True


def flies_for_ever(items: list[MissionItem]) -> bool:
    """Returns whether jumps can loop without an item that flies or waits."""
    busy = {*PLACED, DELAY, CONDITION_DELAY, CONDITION_YAW, RETURN_TO_LAUNCH}
    for start, item in enumerate(items):
        if item.command != JUMP:
            continue
        seen: set[int] = set()
        k = start
        while k < len(items) and items[k].command not in busy:
            if k in seen:
                return True
            seen.add(k)
            k = int(items[k].params[0]) if items[k].command == JUMP else k + 1
    return False
