"""Flight modes with PX4's numbers and MAVROS's names.

Numbers: PX4's `px4_custom_mode.h`; names: MAVROS's `uas_stringify.cpp`.
"""

from __future__ import annotations

from enum import Enum

_SLOW_POSITION = (3, 2)
_MANUAL_INPUT, _STABILIZE, _GUIDED, _AUTO = 64, 16, 8, 4
"""Flags of MAV_MODE_FLAG."""


class Mode(Enum):
    """Mode of the autopilot: PX4's main mode, sub mode, MAVROS's name, flags of the heartbeat."""

    ALTITUDE = (2, 0, "ALTCTL", _MANUAL_INPUT | _STABILIZE)
    POSITION = (3, 0, "POSCTL", _MANUAL_INPUT | _STABILIZE | _GUIDED)
    ORBIT = (3, 1, "CMODE(16973824)", _AUTO | _STABILIZE | _GUIDED)
    """Has only a number as its name in MAVROS."""
    TAKE_OFF = (4, 2, "AUTO.TAKEOFF", _AUTO | _STABILIZE | _GUIDED)
    HOLD = (4, 3, "AUTO.LOITER", _AUTO | _STABILIZE | _GUIDED)
    MISSION = (4, 4, "AUTO.MISSION", _AUTO | _STABILIZE | _GUIDED)
    RETURN = (4, 5, "AUTO.RTL", _AUTO | _STABILIZE | _GUIDED)
    LAND = (4, 6, "AUTO.LAND", _AUTO | _STABILIZE | _GUIDED)
    FOLLOW_TARGET = (4, 8, "AUTO.FOLLOW_TARGET", _AUTO | _STABILIZE | _GUIDED)
    OFFBOARD = (6, 0, "OFFBOARD", _AUTO | _STABILIZE | _GUIDED)

    @property
    def custom_mode(self) -> int:
        """Value of `custom_mode` in a heartbeat."""
        return int(self.value[0]) << 16 | int(self.value[1]) << 24

    @property
    def mavros(self) -> str:
        """Name in MAVROS."""
        return str(self.value[2])

    @property
    def flags(self) -> int:
        """Flags of MAV_MODE_FLAG, besides 'custom mode' and 'armed'."""
        return int(self.value[3])

    @property
    def by_sticks(self) -> bool:
        """Whether an operator controls the UAV manually."""
        return self in (Mode.ALTITUDE, Mode.POSITION)


def mode_of(main: int, sub: int) -> Mode | None:
    """Returns the mode of PX4's numbers; None for an unsupported mode."""
    if main == 4 and sub == 9:  # a precision landing without a visible target is a landing
        sub = 6
    if main == 4 and sub == 0:
        return Mode.MISSION
    if (main, sub) == _SLOW_POSITION:
        return None
    found = (mode for mode in Mode if mode.value[0] == main and mode.value[1] in (sub, 0))
    return next(found, None)


def mode_of_flags(base: int) -> Mode | None:
    """Returns the mode that PX4 selects by the flags of MAV_MODE_FLAG alone; None: unsupported."""
    if base & _AUTO:
        return Mode.MISSION
    return Mode.POSITION if base & _MANUAL_INPUT and base & _GUIDED else None


def mode_named(name: str) -> Mode | None:
    """Returns the mode of MAVROS's name; None if unknown."""
    return next((mode for mode in Mode if mode.mavros == name), None)
