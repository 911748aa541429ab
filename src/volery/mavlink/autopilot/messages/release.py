"""Versions that an autopilot reports.

Clients ask for PX4's version to know its features; the reported version is that of the protocol
that this autopilot follows. This package's own version is in PX4's field for a vendor's version.
"""

from __future__ import annotations

import re
from functools import cache
from importlib.metadata import version

_FOLLOWED = (1, 18, 0)
"""PX4's release whose protocol this autopilot follows."""
_RELEASED = 255
"""Value of FIRMWARE_VERSION_TYPE."""


def flight_version() -> int:
    """Returns major, minor, patch and type of release, a byte each."""
    major, minor, patch = _FOLLOWED
    return major << 24 | minor << 16 | patch << 8 | _RELEASED


@cache
def own_version() -> str:
    """Returns Volery's version."""
    return version("volery")


@cache
def custom_version() -> tuple[int, ...]:
    """Returns eight bytes: this package's patch, minor and major, then zeros for PX4's commit."""
    numbers = [int(part) for part in re.findall(r"\d+", own_version())[:3]]
    major, minor, patch = [*numbers, 0, 0, 0][:3]
    return patch, minor, major, 0, 0, 0, 0, 0
