"""Changes types of UAVs as plain data: their airframe, their sensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_DEFAULT_AIRFRAME = "f450"


def with_airframe(data: Mapping[str, Any], airframe: str) -> dict[str, Any]:
    """Returns a type, as plain data, with another airframe and new rotors."""
    if airframe == data.get("airframe", _DEFAULT_AIRFRAME):
        return dict(data)
    changed = {**data, "airframe": airframe}
    changed.pop("wear", None)  # the wear of the previous airframe's rotors
    return changed
