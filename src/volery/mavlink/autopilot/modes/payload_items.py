"""Items of missions for cameras, gimbals, grippers and similar payloads, and markers.

Surveys and corridors contain many of them. An autopilot accepts them with or without a payload;
without one they change only the heading (regions of interest), and are passed one after the other.
The supported items, frames and settable parameters follow `mavlink_mission.cpp` and
`mavlink_command_params.hpp` of PX4 1.18.
"""

from __future__ import annotations

import math

_GRIPPER, _WINCH = 211, 42600
_ROI_LOCATION, _ROI_OLD, _ROI_OLDEST = 195, 201, 80
INTEREST = {_ROI_LOCATION, 196, 197, _ROI_OLD, _ROI_OLDEST}
"""Regions of interest; only `_ROI_LOCATION` has a position."""
_MISSION_FRAME, _GLOBAL_FRAMES = 2, (0, 3, 5, 6)
"""Values of MAV_FRAME."""
_MODES_WITH_POSITION, _MODES_WITHOUT = (0, 3), (0, 1, 2)
"""MAV_ROI of the old commands, in global frames and in that of missions."""
_ALL = 0b1111111
_USED = {
    80: 0b1110111,
    187: _ALL,
    189: 0b1110000,
    195: 0b1110000,
    196: 0b0000001,
    197: 0b0000001,
    200: _ALL,
    201: 0b0000111,
    203: _ALL,
    204: _ALL,
    205: _ALL,
    206: 0b0001111,
    _GRIPPER: 0b0000011,
    214: 0b0000111,
    260: _ALL,
    530: 0b0000011,
    532: 0b0000111,
    534: 0b0000111,
    1000: _ALL,
    1001: _ALL,
    2000: 0b0001111,
    2001: 0b0000001,
    2003: 0b0001111,
    2500: 0b0000111,
    2501: 0b0000011,
    _WINCH: 0b0001111,
}
"""Parameters that may be set, by MAV_CMD: the lowest bit is the first of the seven."""
COMMANDS = frozenset(_USED)
MARKERS = COMMANDS - {_GRIPPER, _WINCH, 187}
"""Items that may precede a take-off; PX4 treats the others as positions."""

_ACCEPTED, _BAD_FRAME, _UNSUPPORTED, _INVALID_PARAM1 = 0, 2, 3, 6
"""Values of MAV_MISSION_RESULT; those of the parameters are consecutive."""
_UNSET_DEGREES = ((2**31 - 1) * 1e-7, -(2**31) * 1e-7)
"""Values that mean "not set" for a latitude or longitude."""


def fault_of(command: int, frame: int, fields: tuple[float, ...]) -> int:
    """Returns the MAV_MISSION_RESULT of an item.

    fields: four parameters, degrees, degrees, height.
    """
    if frame != _MISSION_FRAME and frame not in _GLOBAL_FRAMES:
        return _BAD_FRAME
    has_position = frame != _MISSION_FRAME
    old = command in (_ROI_OLD, _ROI_OLDEST)
    if not old and has_position != (command == _ROI_LOCATION):
        return _UNSUPPORTED
    used = _USED[command]
    for k, value in enumerate(fields):
        if not used >> k & 1 and not _is_unset(value):
            return _INVALID_PARAM1 + k
    modes = _MODES_WITH_POSITION if has_position else _MODES_WITHOUT
    known = not old or (math.isfinite(fields[0]) and int(fields[0]) in modes)
    return _ACCEPTED if known else _INVALID_PARAM1


def is_roi_location(command: int) -> bool:
    """Returns whether an item defines a position to face."""
    return command == _ROI_LOCATION


def _is_unset(value: float) -> bool:
    return value == 0.0 or math.isnan(value) or value in _UNSET_DEGREES
