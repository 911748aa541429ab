"""What a misspelt name may have meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_OTHER_NAMES = {"gps": "gnss", "fix": "gnss", "baro": "barometer", "mag": "magnetometer"}
"""Names by which others know kinds of sensors."""


def near_miss(name: object, known: Iterable[str]) -> str:
    """Returns "; did you mean 'imu'?" for a name near a known one, else a full stop."""
    wanted = str(name).strip().lower()
    near = difflib.get_close_matches(_OTHER_NAMES.get(wanted, wanted), list(known), n=1)
    return f"; did you mean '{near[0]}'?" if near else "."
