"""One UAV of a team: its own state, the others' states by radio, and the reports it publishes.

`task_manager.TaskManager` decides what the UAV does.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from volery.autonomy.perception.map_frame import UNKNOWN_POSE, MapFrame
from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.perception.stuck_sensors import is_stuck
from volery.autonomy.team.assignment import Worker
from volery.autonomy.team.sectors import Coverage, from_bits, to_bits
from volery.autonomy.team.settings import TeamSettings
from volery.autonomy.team.target_list import Detection, TargetList
from volery.autonomy.team.team_state import TYPE as REPORT_TYPE
from volery.autonomy.team.team_state import MissionPhase, TeamState
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import (
    BatteryState,
    Odometry,
    Point,
    TFMessage,
    Vector3,
    header,
    message_type,
    single,
    time_from_ns,
)
from volery.graph.nodes.node import Node

POSE_TIMEOUT_S = 1.0
"""Age of the newest pose from which on the position counts as unknown. Modelling choice."""
_TARGETS_TYPE = "volery_interfaces/msg/Targets"
_STATUS_TYPE = "volery_interfaces/msg/MissionStatus"
"""All attributes that change."""


class TeamMember(SavedAttributes):
    """Publishes `team`, `mission` and `targets` through its node.

    Subscribes to odometry, battery, detections and `radio/team`.
    """

    STATE = (
        "phase",
        "sector",
        "since_ns",
        "coverage",
        "progress_ns",
        "searched",
        "given_up",
        "targets",
        "team",
        "pose",
        "pose_ns",
        "battery",
        "received_ns",
        "_frame",
        "_num_reports",
    )

    def __init__(self, node: Node, settings: TeamSettings) -> None:
        self._node, self._settings = node, settings
        count = len(settings.sectors)
        self.phase = MissionPhase.WAIT
        self.sector = -1
        """Index of the sector that the UAV searches; -1: none."""
        self.since_ns = 0
        """Time at which it took the sector."""
        self.coverage: Coverage | None = None
        """Cells of the sector that have been in sight."""
        self.progress_ns = 0
        """Time of the last progress: new cells in sight, or a shorter distance to home."""
        self.searched = np.zeros(count, np.bool_)
        """(S,) sectors searched by any UAV."""
        self.given_up = np.zeros(count, np.bool_)
        """(S,) sectors that this UAV has given up."""
        self.targets = TargetList(settings.gate_m)
        self.team = TeamState(count)
        self.pose: OdometrySample | None = None
        """In the map."""
        self.pose_ns = 0
        self.battery = math.nan
        """Charge, 0 to 1; NaN: unknown."""
        self.received_ns = 0
        """Time of the last report of another UAV."""
        self._frame = MapFrame()
        self._num_reports = 0

        self._report_type = message_type(REPORT_TYPE)
        self._targets_type = message_type(_TARGETS_TYPE)
        self._status_type = message_type(_STATUS_TYPE)
        self._report = node.create_publisher(self._report_type, "team", 1)
        self._found = node.create_publisher(self._targets_type, "targets", 1, latched=True)
        self._status = node.create_publisher(self._status_type, "mission", 1)
        node.create_subscription(Odometry, settings.odometry, self._on_odometry, 5)
        node.create_subscription(BatteryState, "battery", self._on_battery, 1)
        node.create_subscription(self._report_type, "radio/team", self._on_report, 20)
        node.create_subscription(
            self._targets_type, "target_detection/targets", self._on_detections, 5
        )
        if settings.use_map_tf:
            node.create_subscription(TFMessage, "/tf", self._on_tf, 50)

    def workers(self) -> dict[str, Worker]:
        """Returns the UAVs that share the search, by name: itself and those with recent reports."""
        assert self.pose is not None
        workers = self.other_workers()
        workers[self._settings.name] = Worker(
            self.pose.position[:2], self.sector, self.since_ns, self.given_up
        )
        return workers

    def other_workers(self) -> dict[str, Worker]:
        """Returns the other UAVs that share the search, by name."""
        return self.team.workers(self._now_ns, self._settings.timeout_s)

    def take_sector(self, sector: int, coverage: Coverage) -> None:
        """Claims a sector from now on."""
        self.sector, self.coverage = sector, coverage
        self.since_ns = self.progress_ns = self._now_ns

    def leave_sector(self) -> None:
        """Leaves the sector to others."""
        self.sector, self.coverage = -1, None

    def problems(self) -> str:
        """Returns what an operator should know, in words; empty: nothing."""
        now, found = self._now_ns, []
        if now - self.pose_ns > POSE_TIMEOUT_S * NS_PER_S:
            found.append(UNKNOWN_POSE if self._frame.is_lost else "no odometry")
        silent = sorted(
            name
            for name, mate in self.team.mates.items()
            if now - mate.received_ns > self._settings.timeout_s * NS_PER_S
            and mate.phase not in (MissionPhase.DONE, MissionPhase.DOWN)
        )
        if silent:
            found.append(f"silent: {', '.join(silent)}")
        if self.battery < self._settings.low_battery_fraction:
            found.append("low battery")
        if self.team.foreign_uavs:
            found.append(f"another search: {', '.join(sorted(self.team.foreign_uavs))}")
        return "; ".join(found)

    def publish_report(self) -> None:
        """Publishes this UAV's state for the team."""
        pose, now = self.pose, self._now_ns
        if pose is None:
            return
        self._num_reports += 1
        self._report.publish(
            self._report_type(
                header(now, "map"),
                self._settings.name,
                str(self.phase),
                Point(*pose.position.tolist()),
                Vector3(*pose.velocity.tolist()),
                single(self.battery),
                len(self.searched),
                self.sector,
                time_from_ns(self.since_ns),
                to_bits(self.searched),
                to_bits(self.given_up),
                self.targets.changed(self._num_reports),
            )
        )

    def publish_status(self, problem: str) -> None:
        """Publishes the state of the search for operators."""
        now = self._now_ns
        teammates = [name for name, _ in self.team.recent(now, self._settings.timeout_s)]
        self._status.publish(
            self._status_type(
                header(now, "map"),
                str(self.phase),
                self.sector,
                int(self.searched.sum()),
                len(self.searched),
                teammates,
                len(self.targets.targets()),
                problem,
            )
        )

    @property
    def _now_ns(self) -> int:
        return self._node.get_clock().now_ns()

    def _on_odometry(self, message: Odometry) -> None:
        pose = self._frame.pose_in_map(message)
        if not np.isfinite([*pose.position, *pose.velocity]).all() or is_stuck(pose, self.pose):
            return
        if self._frame.is_lost:
            return
        self.pose, self.pose_ns = pose, self._now_ns
        coverage = self.coverage
        if coverage is not None and coverage.look(pose.position[:2], self._settings.view_radius_m):
            self.progress_ns = self.pose_ns

    def _on_tf(self, message: TFMessage) -> None:
        self._frame.on_tf(message)  # a restored state has another frame

    def _on_battery(self, message: BatteryState) -> None:
        self.battery = float(message.percentage)

    def _on_report(self, report: Any) -> None:
        now = self._now_ns
        if report.name == self._settings.name or not self.team.on_report(report, now):
            return
        self.received_ns = now
        self.searched |= from_bits(report.searched, len(self.searched))
        if self.targets.take(map(Detection.from_message, report.targets)):
            self._publish_targets()

    def _on_detections(self, message: Any) -> None:
        known = len(self.targets.detections)
        detections = [Detection.from_message(each) for each in message.targets]
        if self.targets.take(d._replace(finder=self._settings.name) for d in detections):
            self._publish_targets()
        if len(self.targets.detections) > known:
            self.publish_report()  # at once: the team needs it within a second

    def _publish_targets(self) -> None:
        found = [detection.message() for detection in self.targets.targets()]
        self._found.publish(self._targets_type(header(self._now_ns, "map"), found))
