"""Buffers the scans of one LIDAR for a map: decimates them, and waits for their motion."""

from __future__ import annotations

from collections import Counter, deque

from volery.autonomy.perception.motion_history import MotionHistory, NodHistory
from volery.autonomy.perception.scan_rays import RayMaker, Rays, has_return, is_usable, scan_times
from volery.autonomy.perception.stuck_sensors import ScanRepeats
from volery.core.clock import NS_PER_S
from volery.graph.messages import LaserScan, stamp_of

_WAITING = 8
"""Max number of scans that wait for odometry; the oldest ones are dropped."""
_JUMP_BACK_NS = NS_PER_S // 2
_EARLY_NS = NS_PER_S // 200
"""Time by which a scan may be early."""


class ScanBuffer:
    """Selects about `rate_hz` scans a second of one LIDAR, and returns their rays.

    `counts` counts scans: taken, repeated, unusable, dropped (their motion never became known),
    stuck (new ones with the ranges of the previous one).
    """

    def __init__(self, maker: RayMaker, rate_hz: float) -> None:
        self._maker = maker
        self._period_ns = round(NS_PER_S / rate_hz)
        self._waiting: deque[LaserScan] = deque()
        self._repeats = ScanRepeats()
        self._last_ns: int | None = None
        self._last_taken_ns: int | None = None
        self.counts: Counter[str] = Counter()
        self.seen_ns: int | None = None
        """Stamp of the newest scan with a return, ns."""
        self.stuck = False
        """Whether the LIDAR repeats its scans."""
        self.received_ns: int | None = None
        """Stamp of the newest scan, ns."""

    def add(self, scan: LaserScan) -> None:
        """Adds a scan."""
        stamp = stamp_of(scan)
        if self._last_ns is not None and stamp < self._last_ns - _JUMP_BACK_NS:
            self._waiting.clear()
            self._last_ns = self._last_taken_ns = self.seen_ns = None
        if self._last_ns is not None and stamp <= self._last_ns:
            self.counts["repeated"] += 1
            return
        self._last_ns = self.received_ns = stamp
        due = self._last_taken_ns
        if due is not None and stamp < due + self._period_ns - _EARLY_NS:
            return
        if not is_usable(scan):
            self.counts["unusable"] += 1
            return
        if has_return(scan):
            self.seen_ns = stamp
        self._last_taken_ns = stamp
        self.stuck = self._repeats.are_reported_by(scan)
        if self.stuck:
            self.counts["stuck"] += 1
            return
        self._waiting.append(scan)
        if len(self._waiting) > _WAITING:
            self._waiting.popleft()
            self.counts["dropped"] += 1

    def ready(self, motion: MotionHistory, nod: NodHistory | None) -> list[Rays]:
        """Returns the rays of the scans whose whole sweep the odometry covers."""
        newest = motion.newest
        found: list[Rays] = []
        while newest is not None and self._waiting:
            if scan_times(self._waiting[0])[1] > newest.time_ns:
                break
            rays = self._maker.rays(self._waiting.popleft(), motion, nod)
            if rays is None:
                self.counts["dropped"] += 1
            else:
                self.counts["taken"] += 1
                found.append(rays)
        return found
