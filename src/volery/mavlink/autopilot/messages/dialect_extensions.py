"""Messages of MAVLink's `common` that pymavlink's `common` lacks, in the codec's form.

Their layouts and CRC_EXTRAs are those of MAVLink's definitions with which PX4 1.18 is built.
"""

from __future__ import annotations

import math
import struct
from typing import Any, ClassVar

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.codec import NEWER

_ADVANCED = 1
"""Flag MAV_MODE_PROPERTY_ADVANCED, which PX4 sets for all modes but altitude and position."""
_STANDARD = {
    Mode.POSITION: 1,
    Mode.ORBIT: 2,
    Mode.ALTITUDE: 4,
    Mode.RETURN: 5,
    Mode.MISSION: 6,
    Mode.LAND: 7,
    Mode.TAKE_OFF: 8,
}
"""MAV_STANDARD_MODE of modes; the others have a name instead."""
_NAMES = {Mode.HOLD: b"Hold", Mode.OFFBOARD: b"Offboard", Mode.FOLLOW_TARGET: b"Follow Target"}
_MIN_VERSION, _VERSION = 100, 200
"""Versions of MAVLink, times a hundred: both are received, 2 is sent."""


class _Message:
    """A message: fields by name, and attributes of pymavlink's messages that the codec reads."""

    id: ClassVar[int]
    crc_extra: ClassVar[int]
    unpacker: ClassVar[struct.Struct]
    ordered_fieldnames: ClassVar[tuple[str, ...]]
    fieldtypes: ClassVar[tuple[str, ...]] = ()
    lengths: ClassVar[tuple[int, ...]] = ()

    def __init__(self, **fields: int | bytes) -> None:
        self.__dict__.update(fields)


class ProtocolVersion(_Message):
    """PROTOCOL_VERSION; unknown hashes are 0."""

    id, crc_extra = 300, NEWER[300]
    unpacker = struct.Struct("<HHH8s8s")
    ordered_fieldnames = (
        *("version", "min_version", "max_version"),
        *("spec_version_hash", "library_version_hash"),
    )


class AvailableModes(_Message):
    """AVAILABLE_MODES: one mode."""

    id, crc_extra = 435, NEWER[435]
    unpacker = struct.Struct("<IIBBB35s")
    ordered_fieldnames = (
        *("custom_mode", "properties", "number_modes", "mode_index", "standard_mode"),
        "mode_name",
    )


class CurrentMode(_Message):
    """CURRENT_MODE."""

    id, crc_extra = 436, NEWER[436]
    unpacker = struct.Struct("<IIB")
    ordered_fieldnames = ("custom_mode", "intended_custom_mode", "standard_mode")


def protocol_version(_context: AutopilotContext) -> Any:
    """Returns the supported versions of MAVLink."""
    return ProtocolVersion(
        version=_VERSION,
        min_version=_MIN_VERSION,
        max_version=_VERSION,
        spec_version_hash=b"",
        library_version_hash=b"",
    )


def current_mode(context: AutopilotContext) -> Any:
    """Returns CURRENT_MODE; the intended mode is unknown after a failsafe has acted."""
    mode = context.memory.mode
    return CurrentMode(
        custom_mode=mode.custom_mode,
        intended_custom_mode=0 if context.memory.failsafe else mode.custom_mode,
        standard_mode=_STANDARD.get(mode, 0),
    )


def standard_mode(number: float) -> Mode | None:
    """Returns the mode of a MAV_STANDARD_MODE; None if there is no such mode."""
    return next((mode for mode, standard in _STANDARD.items() if standard == number), None)


def available_modes(which: float) -> list[Any]:
    """Returns the mode of an index from 1, all modes for 0, none for other numbers."""
    index = round(which) if math.isfinite(which) else 0
    modes = tuple(Mode)
    numbers = range(1, len(modes) + 1) if index == 0 else (index,)
    return [
        AvailableModes(
            custom_mode=modes[number - 1].custom_mode,
            properties=0 if modes[number - 1].by_sticks else _ADVANCED,
            number_modes=len(modes),
            mode_index=number,
            standard_mode=_STANDARD.get(modes[number - 1], 0),
            mode_name=_NAMES.get(modes[number - 1], b""),
        )
        for number in numbers
        if 1 <= number <= len(modes)
    ]
