"""Formats SLAM and mission statuses for a table."""

from __future__ import annotations

import json


def slam_gist(text: str) -> str:
    """Returns state and problems of a SLAM status (JSON); `?` if it is invalid."""
    try:
        status = json.loads(text)
        state, problems = str(status["state"]), [str(each) for each in status.get("problems", ())]
    except (ValueError, TypeError, KeyError, AttributeError):
        return "?"
    return ": ".join([state, ", ".join(problems)]) if problems else state


def mission_gist(phase: str, sector: int) -> str:
    """Returns the phase of a mission, and its sector if it has one."""
    return f"{phase} {sector}" if sector >= 0 else phase
