"""Builds the local grid and the ground plane of a vehicle's surroundings from its sensors."""

from __future__ import annotations

import math
from typing import Any

from volery.autonomy.perception.ground_plane import GroundPlane
from volery.autonomy.perception.motion_history import MotionHistory, NodHistory
from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.perception.scan_rays import Beams, RayMaker
from volery.autonomy.perception.stuck_sensors import RangeRepeats, ScanRepeats
from volery.autonomy.planning.clearance import Clearance, clearance_of
from volery.autonomy.planning.local_grid import LocalGrid
from volery.autonomy.planning.surface import Surface
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import JointState, LaserScan, Range, stamp_of

_SHAPE = (128, 128, 32)
_WINDOW = (96, 96, 24)
"""Cells of the grid, and of the planning window: 32 m and 24 m wide at 0.25 m."""
_BUBBLE_M = 0.9
"""Radius around the vehicle in which unknown cells are free."""
_SONAR_MEMORY_S = 0.5
_SILENT_S = 0.5
_JUMP_BACK_NS = NS_PER_S // 2


class Surroundings(SavedAttributes):
    """Processes scans, joint angles and ranges, in the frame of the odometry."""

    def __init__(self, mounts: dict[str, Any], cell_m: float, scan_rate_hz: float) -> None:
        self.motion, self._nod = MotionHistory(), NodHistory()
        self._grid = LocalGrid(cell_m, _SHAPE)
        self._makers = {name: RayMaker(mount, Beams()) for name, mount in mounts.items()}
        self._period_ns = round(NS_PER_S / scan_rate_hz)
        self._repeats = {name: ScanRepeats() for name in mounts}
        self._stuck: set[str] = set()
        """Names of LIDARs that repeat their scans."""
        self._received_ns: dict[str, int] = {}
        """Stamp of the newest new scan of each LIDAR, ns."""
        self._accepted_ns: dict[str, int] = {}
        self._seen_ns: dict[str, int] = {}
        self._ground = GroundPlane()
        self._range: tuple[int, float] | None = None
        self._range_repeats = RangeRepeats()
        self._is_sonar_stuck = False
        self._upright_cells = math.ceil(0.75 / cell_m)

    PARTS = ("_grid",)
    STATE = (
        "motion",
        "_nod",
        "_repeats",
        "_stuck",
        "_received_ns",
        "_accepted_ns",
        "_seen_ns",
        "_ground",
        "_range",
        "_range_repeats",
        "_is_sonar_stuck",
    )

    def on_joint(self, message: JointState) -> None:
        """Stores the angle of the nodding mount."""
        self._nod.add_message(message)

    def on_range(self, message: Range, now_ns: int) -> None:
        """Stores the range to the ground below."""
        if not math.isfinite(message.range):
            return
        self._is_sonar_stuck = self._range_repeats.are_reported_by(float(message.range))
        self._range = None if self._is_sonar_stuck else (now_ns, float(message.range))

    def on_scan(self, name: str, scan: LaserScan, now_ns: int) -> None:
        """Adds a scan of LIDAR `name`."""
        stamp = stamp_of(scan)
        received_ns = self._received_ns.get(name)
        if received_ns is not None and received_ns - _JUMP_BACK_NS <= stamp <= received_ns:
            return  # repeated message
        if self._repeats[name].are_reported_by(scan):
            self._stuck.add(name)
            return
        self._stuck.discard(name)
        self._received_ns[name] = stamp
        accepted_ns = self._accepted_ns.get(name)
        due = 0 if accepted_ns is None else accepted_ns + self._period_ns - NS_PER_S // 200
        is_due = accepted_ns is None or not accepted_ns <= stamp < due
        if not is_due and name != "nodding":
            return
        newest = self.motion.newest
        if newest is None:
            return
        if is_due:
            self._accepted_ns[name] = stamp
        rays = self._makers[name].rays(scan, self.motion, self._nod if name == "nodding" else None)
        if rays is None or len(rays.hits) == 0:
            return
        if rays.hits.any():
            self._seen_ns[name] = stamp
        self._grid.move_to(newest.position)
        # A nodding LIDAR sees thin obstacles in few of its scans: the hits of all scans count.
        self._grid.add(rays, clears=is_due)
        self._ground.add(rays.ends, now_ns, rays.hits)

    def problems(self, now_ns: int) -> list[str]:
        """Returns the problems that prevent planning, as text."""
        found = []
        newest = self.motion.newest
        if newest is None or not self._is_fresh(newest.time_ns, now_ns):
            found.append("no odometry")
        for name in self._makers:
            if not self._is_fresh(self._received_ns.get(name), now_ns):
                what = "repeats itself" if name in self._stuck else "is silent"
                found.append(f"the {name} LIDAR {what}")
        if not any(self._is_fresh(self._seen_ns.get(name), now_ns) for name in self._makers):
            found.append("no LIDAR has returns")
        return found

    def warnings(self) -> list[str]:
        """Returns the problems that do not prevent planning, as text.

        Without a sonar, the ground comes from the LIDARs.
        """
        return ["the sonar repeats itself"] if self._is_sonar_stuck else []

    def height_above_ground(self, pose: OdometrySample, now_ns: int) -> float:
        """Returns the height above ground, m, by the sonar and the LIDARs' ground returns."""
        below = None
        if self._range is not None and self._is_fresh(self._range[0], now_ns):
            below = float(pose.position[2]) - self._range[1]
        self._ground.fit(pose.position, below, now_ns)
        return float(pose.position[2]) - float(self._ground.height_at(pose.position[:2]))

    def surface(self, height_m: float) -> Surface:
        """Returns the surface `height_m` above the last fitted ground."""
        ground = self._ground
        level = ground.height - float(ground.slope @ ground.anchor) + height_m
        return Surface(level, ground.slope.copy())

    def clearance(self, position: Array) -> Clearance:
        """Returns the distances to obstacles around `position` (3,) m."""
        self._grid.move_to(position)
        self._grid.clear_around(position, _BUBBLE_M)
        scores, low = self._grid.window(position, _WINDOW)
        return clearance_of(scores, low, self._grid.cell_m, self._upright_cells)

    @staticmethod
    def _is_fresh(time_ns: int | None, now_ns: int) -> bool:
        return (
            time_ns is not None
            and -_SILENT_S * NS_PER_S <= now_ns - time_ns <= _SILENT_S * NS_PER_S
        )
