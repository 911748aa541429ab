"""Tracks the other UAVs nearby by their team reports, received over the radio."""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.autonomy.perception.map_frame import MapFrame
from volery.autonomy.planning.reciprocal_avoidance import Neighbour
from volery.core.clock import NS_PER_S
from volery.graph.messages import stamp_of

_RESTART_NS = 10 * NS_PER_S
"""Age of a report after which an older stamp is accepted: the sender's clock has restarted."""


class Neighbours:
    """Stores the last report of each UAV, in the map; its age is by the receiver's clock."""

    def __init__(self) -> None:
        self._reports: dict[str, Neighbour] = {}
        self._sent_ns: dict[str, int] = {}

    def on_report(self, report: Any, now_ns: int) -> None:
        """Adds a `TeamReport`; ignores one that is not finite, repeated or out of order."""
        p, v = report.position, report.velocity
        if not np.isfinite([p.x, p.y, p.z, v.x, v.y, v.z]).all():
            return
        sent_ns, known = stamp_of(report), self._reports.get(report.name)
        fresh = known is not None and now_ns - known.time_ns <= _RESTART_NS
        if fresh and sent_ns <= self._sent_ns[report.name]:
            return
        position, velocity = np.array([p.x, p.y, p.z]), np.array([v.x, v.y, v.z])
        self._reports[report.name] = Neighbour(position, velocity, now_ns)
        self._sent_ns[report.name] = sent_ns

    def in_odom(self, frame: MapFrame) -> list[Neighbour]:
        """Returns all neighbours, sorted by name, in the odometry frame."""
        moved = []
        for _, other in sorted(self._reports.items()):
            position = frame.to_odom(other.position)
            velocity = frame.to_odom(other.position + other.velocity) - position
            moved.append(Neighbour(position, velocity, other.time_ns))
        return moved
