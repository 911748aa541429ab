"""Warns before a recording of the disk space that images take."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from volery.cli.error_reporting import warn

_NOTABLE_MB_PER_MIN = 100.0
_MAX_NAMED = 3


def warn_of_size(rates: Mapping[str, float], matches: Callable[[str], bool]) -> None:
    """Warns of images that fill a disk.

    rates: bytes per simulated second, by topic. matches: whether a topic is recorded.
    """
    recorded = {topic: rate * 60e-6 for topic, rate in rates.items() if matches(topic)}
    total = sum(recorded.values())
    if total < _NOTABLE_MB_PER_MIN:
        return
    largest = sorted(recorded, key=lambda topic: -recorded[topic])[:_MAX_NAMED]
    named = ", ".join(f"{topic} {recorded[topic]:.0f}" for topic in largest)
    warn(
        f"the log grows by about {total:.0f} MB per minute of the flight, from images alone "
        f"({named}); --exclude '{largest[0]}' leaves one out, --topics chooses"
    )
