"""Defines the error of a peer, which is reported beside the figures."""

from __future__ import annotations

from volery.core.errors import VoleryError


class PeerError(VoleryError):
    """Reports that a peer cannot be installed, started or driven, or that its results differ."""


def last_line(text: str) -> str:
    """Returns the last line that is not blank, shortened; "" if there is none."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1][:300] if lines else ""
