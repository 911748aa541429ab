"""What goes wrong with a peer: reported beside the figures, never the end of the bench."""

from __future__ import annotations

from volery.core.errors import VoleryError


class PeerError(VoleryError):
    """A peer cannot be installed, started or driven, or computes something else than ours."""


def last_line(text: str) -> str:
    """The last line that is not blank, shortened; "" if there is none."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1][:300] if lines else ""
