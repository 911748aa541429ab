"""What a misspelt name may have meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def near_miss(name: object, known: Iterable[str]) -> str:
    """Returns " Did you mean 'imu'?" for a name near a known one, else an empty text."""
    near = difflib.get_close_matches(str(name).strip().lower(), list(known), n=1)
    return f" Did you mean '{near[0]}'?" if near else ""
