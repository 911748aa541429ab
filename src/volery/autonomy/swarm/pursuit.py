"""Flies hostile UAVs: each pursues the UAV that is nearest to it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.status import publish_status
from volery.autonomy.swarm.behaviour import Surroundings, flock_within
from volery.autonomy.swarm.orca import Orca, OrcaSettings
from volery.autonomy.swarm.team_link import TeamLink, number
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import String
from volery.graph.nodes.node import Node

_PERIOD_S = 0.05
_STATUS_PERIODS = 4


class Pursuit(SavedAttributes, Node):
    """Flies `pursuers` after the nearest of `uavs`. Publishes `~/status` (JSON) at 5 Hz.

    A pursuer flies straight to the present position of its target, at its height, until the target
    is captured, silent or low; without a target it hovers. A capture only ends the pursuit of that
    UAV. Pursuers avoid each other, and nothing else. They are waited for until all have taken off.

    Parameters
    ----------
    pursuers: names of the hostile UAVs.
    uavs: names of the UAVs that they pursue; pursuers among them are left out.
    odometry: topic of the odometry, below a UAV's namespace; its frame must be fixed to the map.
    height_m: height at which pursuers hover, m in the map; UAVs below 0.4 of it count as landed.
    speed_m_s: speed of the pursuers.
    capture_m: distance at which a UAV is captured.

    """

    STATE = ("_is_flying", "_ticks", "_last_status", "_min_distance_m", "_captured")
    PARTS = ("_pursuers", "_pursued")
    WARMUP_TASKS = ("volery.autonomy.swarm.warmup:flocking",)

    def __init__(self, **options: Any) -> None:
        super().__init__("pursuit", **options)
        pursuers = self.declare_parameter("pursuers", ["uav1"]).value
        named = self.declare_parameter("uavs", ["uav2", "uav3"]).value
        odometry = str(self.declare_parameter("odometry", "odom").value)
        self._height = number(self, "height_m", 5.0, 0.5, 1000.0)
        self._speed = number(self, "speed_m_s", 4.0, 0.0, 100.0)
        self._capture_m = number(self, "capture_m", 1.0, 0.0, 100.0)
        self._avoidance = Orca(OrcaSettings(max_speed_m_s=self._speed))
        self._is_flying = False
        self._ticks = 0
        self._last_status = ""
        self._min_distance_m = math.inf
        """Minimum distance of a pursuer from a UAV so far, m."""
        self._captured: list[str] = []
        self._pursuers = TeamLink(self, pursuers, odometry, self._height)
        uavs = [name for name in named if name not in pursuers]
        self._pursued = TeamLink(self, uavs, odometry, self._height, is_commanded=False)
        self._status = self.create_publisher(String, "~/status", 1, latched=True)
        self.create_timer(_PERIOD_S, self._on_timer)

    def _on_timer(self) -> None:
        now_ns = self.get_clock().now_ns()
        self._is_flying = self._is_flying or self._pursuers.is_up()
        if not self._is_flying:
            return
        self._pursuers.drop_lost(now_ns)
        if not self._pursuers.members:
            return
        targets = self._targets(now_ns)
        position, velocity = self._pursuers.motion()
        wanted = np.zeros_like(position)
        heights = np.full(len(position), self._height)
        for k, row in enumerate(self._pursuers.members):
            if row in targets:
                target = targets[row][1]
                offset = target.position[:2] - position[k]
                wanted[k] = self._speed * offset / max(float(np.linalg.norm(offset)), 1e-9)
                heights[k] = target.position[2]
        flock = flock_within(position, velocity, self._avoidance.radius_m)
        wanted = self._avoidance.velocities(flock, wanted, Surroundings())
        for row, level, height in zip(self._pursuers.members, wanted, heights, strict=True):
            self._pursuers.command(row, level, float(height))
        self._ticks += 1
        if self._ticks % _STATUS_PERIODS == 0:
            self._publish_status(targets)

    def _targets(self, now_ns: int) -> dict[int, tuple[str, OdometrySample]]:
        """Returns name and odometry of the nearest UAV by row of the pursuer; records captures."""
        present = self._pursued.present(now_ns)
        pursued = {self._pursued.names[row]: sample for row, sample in present.items()}
        targets = {}
        for row, own in self._pursuers.present(now_ns).items():
            distances = {
                name: float(np.linalg.norm(sample.position - own.position))
                for name, sample in pursued.items()
                if name not in self._captured
            }
            self._min_distance_m = min(self._min_distance_m, *distances.values(), math.inf)
            self._captured += [name for name, m in distances.items() if m <= self._capture_m]
            left = [name for name in distances if name not in self._captured]
            if left:
                name = min(left, key=distances.__getitem__)
                targets[row] = name, pursued[name]
        return targets

    def _publish_status(self, targets: dict[int, tuple[str, OdometrySample]]) -> None:
        names = self._pursuers.names
        status = {
            "targets": {names[row]: name for row, (name, _) in targets.items()},
            "least_distance_m": None
            if math.isinf(self._min_distance_m)
            else round(self._min_distance_m, 3),
            "captured": self._captured,
        }
        self._last_status = publish_status(self._status, status, self._last_status)
