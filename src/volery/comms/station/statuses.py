"""What a SLAM's status says, in words for a table."""

from __future__ import annotations

import json


def slam_gist(text: str) -> str:
    """State of a SLAM and what is wrong, of its status (JSON); `?` where it is none."""
    try:
        told = json.loads(text)
        state, problems = str(told["state"]), [str(each) for each in told.get("problems", ())]
    except (ValueError, TypeError, KeyError, AttributeError):
        return "?"
    return ": ".join([state, ", ".join(problems)]) if problems else state


def mission_gist(phase: str, sector: int) -> str:
    """Phase of a mission, and its sector where it has one."""
    return f"{phase} {sector}" if sector >= 0 else phase
