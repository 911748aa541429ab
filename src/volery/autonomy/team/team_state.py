"""A UAV's state of its team, from the reports that it receives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.team.assignment import Worker
from volery.autonomy.team.sectors import from_bits
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.graph.messages import stamp_of

Mask = NDArray[np.bool_]

TYPE = "volery_interfaces/msg/TeamReport"


class MissionPhase(StrEnum):
    """Phase of a UAV in its mission."""

    WAIT = "wait"
    """On the ground; waits for its team's reports."""
    RISE = "rise"
    SEARCH = "search"
    IDLE = "idle"
    """Airborne without a sector to search."""
    RETURN = "return"
    LAND = "land"
    HOLD = "hold"
    """Held or controlled by an operator."""
    DONE = "done"
    """Has landed."""
    DOWN = "down"
    """Fell, or failed to take off."""


AT_WORK = frozenset({MissionPhase.WAIT, MissionPhase.RISE, MissionPhase.SEARCH, MissionPhase.IDLE})
"""Searches, or will."""
ALOFT = frozenset({MissionPhase.SEARCH, MissionPhase.IDLE, MissionPhase.RETURN, MissionPhase.HOLD})


@dataclass
class TeamMate:
    """Another UAV by its newest report. Times are ns of the receiver's clock, except `sent_ns`."""

    phase: MissionPhase
    sent_ns: int
    received_ns: int
    worker: Worker
    position: Array
    """(3,) m, map."""


@dataclass
class TeamState:
    """The other UAVs; `sectors` is the number of sectors in the area."""

    sectors: int
    mates: dict[str, TeamMate] = field(default_factory=dict)
    foreign_uavs: set[str] = field(default_factory=set)
    """Names of UAVs that search another area, or report unknown phases."""

    def on_report(self, report: Any, now_ns: int) -> bool:
        """Adds a report; returns False if it is old, repeated or of another search."""
        known = self.mates.get(report.name)
        sent_ns = stamp_of(report)
        if report.sectors != self.sectors or report.phase not in set(MissionPhase):
            self.foreign_uavs.add(report.name)
            return False
        restarted = known is not None and now_ns - known.received_ns > 10 * NS_PER_S
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
        position = np.array([p.x, p.y, p.z])
        self.mates[report.name] = TeamMate(
            MissionPhase(report.phase), sent_ns, now_ns, worker, position
        )
        return True

    def recent(self, now_ns: int, timeout_s: float) -> Iterator[tuple[str, TeamMate]]:
        """Yields the UAVs with recent reports, by name."""
        for name, mate in sorted(self.mates.items()):
            if 0 <= now_ns - mate.received_ns <= timeout_s * NS_PER_S:
                yield name, mate

    def workers(self, now_ns: int, timeout_s: float) -> dict[str, Worker]:
        """Returns the UAVs with recent reports that search, or will."""
        return {n: m.worker for n, m in self.recent(now_ns, timeout_s) if m.phase in AT_WORK}
