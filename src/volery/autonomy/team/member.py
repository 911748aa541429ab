"""One UAV of a team: what it knows by itself, what it hears from the others, what it tells them.

`task_manager.TaskManager` decides on top of it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.perception.map_frame import UNKNOWN_PLACE, MapFrame
from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.perception.stuck_sensors import is_stuck
from volery.autonomy.team.assignment import Worker
from volery.autonomy.team.sectors import Coverage, from_bits, to_bits
from volery.autonomy.team.settings import TeamSettings
from volery.autonomy.team.target_list import Detection, TargetList
from volery.autonomy.team.team_state import TYPE as REPORT_TYPE
from volery.autonomy.team.team_state import MissionPhase, TeamState
from volery.core.clock import NS_PER_S
from volery.core.saved_state import restore_attributes, save_attributes
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

Array = NDArray[np.float64]

POSE_S = 1.0
"""Without odometry for so long it does not know where it is. Modelling choice."""
_TARGETS_TYPE = "volery_interfaces/msg/Targets"
_STATUS_TYPE = "volery_interfaces/msg/MissionStatus"


class TeamMember(Node):
    """Hears odometry, battery, finds and `radio/team`; says `team`, `mission` and `targets`."""

    STATE: tuple[str, ...] = (
        "phase",
        "sector",
        "searched",
        "targets",
        "team",
        "problem",
        "_pose",
        "_pose_ns",
        "_frame",
        "_since_ns",
        "_given_up",
        "_coverage",
        "_news_ns",
        "_battery",
        "_heard_ns",
        "_reports",
    )
    """Everything that changes."""

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self.settings = settings = TeamSettings.declare(self)
        count = len(settings.sectors)
        self.phase = MissionPhase.WAIT
        self.sector = -1
        """The one that it searches, -1: none ..."""
        self._since_ns = 0
        """... since when ..."""
        self._coverage: Coverage | None = None
        """... and what of it has been in sight."""
        self._news_ns = 0
        """When something new was last seen, or home came nearer."""
        self.searched = np.zeros(count, np.bool_)
        """(S,) by anybody."""
        self._given_up = np.zeros(count, np.bool_)
        self.targets = TargetList(settings.gate_m)
        self.team = TeamState(count)
        self.problem = ""
        self._frame = MapFrame()
        self._pose: OdometrySample | None = None
        self._pose_ns = 0
        self._battery = math.nan
        self._heard_ns = 0
        """When anybody was heard."""
        self._reports = 0
        """How many have been sent."""

        self._report_type = message_type(REPORT_TYPE)
        self._targets_type = message_type(_TARGETS_TYPE)
        self._status_type = message_type(_STATUS_TYPE)
        self._report = self.create_publisher(self._report_type, "team", 1)
        self._found = self.create_publisher(self._targets_type, "targets", 1, latched=True)
        self._status = self.create_publisher(self._status_type, "mission", 1)
        self.create_subscription(Odometry, settings.odometry, self._on_odometry, 5)
        self.create_subscription(BatteryState, "battery", self._on_battery, 1)
        self.create_subscription(self._report_type, "radio/team", self._on_report, 20)
        self.create_subscription(self._targets_type, "target_detection/targets", self._on_finds, 5)
        if settings.corrected:
            self.create_subscription(TFMessage, "/tf", self._on_tf, 50)

    def get_state(self) -> dict[str, Any]:
        """What a snapshot keeps."""
        return save_attributes(self, self.STATE)

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a kept state."""
        restore_attributes(self, state)

    @property
    def now_ns(self) -> int:
        """Time of the node's clock."""
        return self.get_clock().now_ns()

    def as_worker(self) -> Worker:
        """What others see of this UAV's work."""
        assert self._pose is not None
        return Worker(self._pose.position[:2], self.sector, self._since_ns, self._given_up)

    # ------------------------------------------------------------------------------ what it hears

    def _on_tf(self, message: TFMessage) -> None:
        self._frame.on_tf(message)

    def _on_odometry(self, message: Odometry) -> None:
        pose = self._frame.pose_in_map(message)
        if not np.isfinite([*pose.position, *pose.velocity]).all() or is_stuck(pose, self._pose):
            return
        if self._frame.is_lost:
            return
        self._pose, self._pose_ns = pose, self.now_ns
        coverage = self._coverage
        if coverage is not None and coverage.look(pose.position[:2], self.settings.sight_m):
            self._news_ns = self._pose_ns

    def _on_battery(self, message: BatteryState) -> None:
        self._battery = float(message.percentage)

    def _on_report(self, report: Any) -> None:
        now = self.now_ns
        if report.name == self.settings.name or not self.team.hear(report, now):
            return
        self._heard_ns = now
        self.searched |= from_bits(report.searched, len(self.searched))
        if self.targets.take(map(Detection.from_message, report.targets)):
            self._tell_targets()

    def _on_finds(self, message: Any) -> None:
        known = len(self.targets.finds)
        finds = [Detection.from_message(each) for each in message.targets]
        if self.targets.take(f._replace(finder=self.settings.name) for f in finds):
            self._tell_targets()
        if len(self.targets.finds) > known:
            self.tell_team()  # at once: the others shall know within a second

    # -------------------------------------------------------------------------------- what it says

    def what_is_wrong(self, now: int) -> str:
        """What people should know, in words; empty: nothing."""
        wrong = []
        if now - self._pose_ns > POSE_S * NS_PER_S:
            wrong.append(UNKNOWN_PLACE if self._frame.is_lost else "no odometry")
        silent = sorted(
            name
            for name, mate in self.team.mates.items()
            if now - mate.heard_ns > self.settings.patience_s * NS_PER_S
            and mate.phase not in (MissionPhase.DONE, MissionPhase.DOWN)
        )
        if silent:
            wrong.append(f"silent: {', '.join(silent)}")
        if self._battery < self.settings.low_battery:
            wrong.append("low battery")
        if self.team.strangers:
            wrong.append(f"another search: {', '.join(sorted(self.team.strangers))}")
        return "; ".join(wrong)

    def tell_team(self) -> None:
        """Tell the others all that it knows."""
        pose, now = self._pose, self.now_ns
        if pose is None:
            return
        self._reports += 1
        self._report.publish(
            self._report_type(
                header(now, "map"),
                self.settings.name,
                str(self.phase),
                Point(*pose.position.tolist()),
                Vector3(*pose.velocity.tolist()),
                single(self._battery),
                len(self.searched),
                self.sector,
                time_from_ns(self._since_ns),
                to_bits(self.searched),
                to_bits(self._given_up),
                self.targets.to_tell(self._reports),
            )
        )

    def tell_status(self) -> None:
        """Tell whoever watches how the search fares."""
        now = self.now_ns
        heard = [name for name, _ in self.team.heard(now, self.settings.patience_s)]
        self._status.publish(
            self._status_type(
                header(now, "map"),
                str(self.phase),
                self.sector,
                int(self.searched.sum()),
                len(self.searched),
                heard,
                len(self.targets.targets()),
                self.problem,
            )
        )

    def _tell_targets(self) -> None:
        found = [find.message() for find in self.targets.targets()]
        self._found.publish(self._targets_type(header(self.now_ns, "map"), found))
