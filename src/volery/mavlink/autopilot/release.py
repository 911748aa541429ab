"""The versions that an autopilot tells.

Clients ask which PX4 they talk to, to know what it can do: that is the one whose protocol is
followed. This package's own version stands where PX4 has that of a vendor.
"""

from __future__ import annotations

import re
from functools import cache
from importlib.metadata import version

_FOLLOWED = (1, 18, 0)
"""PX4's release whose protocol this is."""
_RELEASED = 255
"""FIRMWARE_VERSION_TYPE."""


def flight_version() -> int:
    """Major, minor, patch and type of release, a byte each."""
    major, minor, patch = _FOLLOWED
    return major << 24 | minor << 16 | patch << 8 | _RELEASED


@cache
def own_version() -> str:
    """Volery's version."""
    return version("volery")


@cache
def custom_version() -> tuple[int, ...]:
    """Eight bytes: this package's patch, minor and major, then what is a commit's in PX4: 0."""
    numbers = [int(part) for part in re.findall(r"\d+", own_version())[:3]]
    major, minor, patch = [*numbers, 0, 0, 0][:3]
    return patch, minor, major, 0, 0, 0, 0, 0
