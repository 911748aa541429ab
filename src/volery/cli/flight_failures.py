"""What makes a flight fail for `volery run --fail-on`."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from volery.core.errors import ScenarioError

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation

FAILED = 1
"""Exit code of a flight that went through, but failed."""
_KINDS = ("crash", "contact")
_CONTACTS = ("impact", "collision")


def parse_failures(texts: Sequence[str]) -> frozenset[str]:
    """Returns the kinds in texts such as `crash,contact`. Raises `ScenarioError` for others."""
    kinds = [kind.strip() for text in texts for kind in text.split(",")]
    for kind in kinds:
        if kind not in _KINDS:
            raise ScenarioError(f"--fail-on: crash or contact, not '{kind}'")
    return frozenset(kinds)


def failures_of(simulation: Simulation, kinds: Collection[str]) -> list[str]:
    """Returns what has failed in a flight, a line each."""
    lines = []
    if "crash" in kinds:
        lines += [f"{name} has crashed" for name, uav in simulation.uavs.items() if uav.crashed]
    if "contact" in kinds:
        contacts = (e for e in simulation.diagnostics.events if str(e.kind) in _CONTACTS)
        first = next(contacts, None)
        lines += [] if first is None else [f"first contact: {first.describe()}"]
    return lines
