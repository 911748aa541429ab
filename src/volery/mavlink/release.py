"""The version that an autopilot tells: this package's."""

from __future__ import annotations

import re
from functools import cache
from importlib.metadata import version

_RELEASED, _DEVELOPMENT = 255, 0
"""FIRMWARE_VERSION_TYPE."""


@cache
def flight_version() -> int:
    """Major, minor, patch and type of release, a byte each."""
    text = version("volery")
    numbers = [int(part) for part in re.findall(r"\d+", text)[:3]]
    major, minor, patch = [*numbers, 0, 0, 0][:3]
    kind = _DEVELOPMENT if re.search(r"[a-z]", text) else _RELEASED
    return major << 24 | minor << 16 | patch << 8 | kind
