"""What a misspelt name may have meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def near_miss(name: object, known: Iterable[str]) -> str:
    """Returns "; did you mean 'imu'?" for a name near a known one, else a full stop."""
    near = difflib.get_close_matches(str(name).strip().lower(), list(known), n=1)
    return f"; did you mean '{near[0]}'?" if near else "."
