"""What a UAV knows of its team: who was heard when, saying what."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.team.assignment import Worker
from volery.autonomy.team.sectors import from_bits
from volery.core.clock import NS_PER_S
from volery.graph.messages import stamp_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

TYPE = "volery_interfaces/msg/TeamReport"


class MissionPhase(StrEnum):
    """Where in its mission a UAV is."""

    WAIT = "wait"
    """On the ground; listens for its team."""
    RISE = "rise"
    SEARCH = "search"
    IDLE = "idle"
    """Aloft with nothing to search at the moment."""
    RETURN = "return"
    LAND = "land"
    HOLD = "hold"
    """An operator has it wait where it is, or flies it."""
    DONE = "done"
    """Has landed."""
    DOWN = "down"
    """Came down against its will, or never came up."""


AT_WORK = frozenset({MissionPhase.WAIT, MissionPhase.RISE, MissionPhase.SEARCH, MissionPhase.IDLE})
"""Searches, or will."""
ALOFT = frozenset({MissionPhase.SEARCH, MissionPhase.IDLE, MissionPhase.RETURN, MissionPhase.HOLD})


@dataclass
class TeamMate:
    """Another UAV by its newest report. Times are ns of the hearer's clock, but for `sent_ns`."""

    phase: MissionPhase
    sent_ns: int
    heard_ns: int
    worker: Worker
    position: Array
    """(3,) m, map"""


@dataclass
class TeamState:
    """The other UAVs; `sectors` is how many the area has here."""

    sectors: int
    mates: dict[str, TeamMate] = field(default_factory=dict)
    strangers: set[str] = field(default_factory=set)
    """Who searches another area, or speaks of phases that are not known here."""

    def hear(self, report: Any, now_ns: int) -> bool:
        """Take a report in; False for one that is old, repeated or of another search."""
        known = self.mates.get(report.name)
        sent_ns = stamp_of(report)
        if report.sectors != self.sectors or report.phase not in set(MissionPhase):
            self.strangers.add(report.name)
            return False
        restarted = known is not None and now_ns - known.heard_ns > 10 * NS_PER_S
        if known is not None and sent_ns <= known.sent_ns and not restarted:
            return False
        p = report.position
        if not np.isfinite([p.x, p.y, p.z]).all():
            return False
        since_ns = report.since.sec * NS_PER_S + report.since.nanosec
        worker = Worker(
            np.array([p.x, p.y]),
            int(report.sector),
            since_ns,
            from_bits(report.given_up, self.sectors),
        )
        place = np.array([p.x, p.y, p.z])
        self.mates[report.name] = TeamMate(
            MissionPhase(report.phase), sent_ns, now_ns, worker, place
        )
        return True

    def heard(self, now_ns: int, patience_s: float) -> Iterator[tuple[str, TeamMate]]:
        """Those who were heard lately, by name."""
        for name, mate in sorted(self.mates.items()):
            if 0 <= now_ns - mate.heard_ns <= patience_s * NS_PER_S:
                yield name, mate

    def workers(self, now_ns: int, patience_s: float) -> dict[str, Worker]:
        """Those who were heard lately and search, or will."""
        return {n: m.worker for n, m in self.heard(now_ns, patience_s) if m.phase in AT_WORK}
