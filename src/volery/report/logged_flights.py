"""Reads trajectories and trunk maps of the UAVs in a log, of a simulated or a real flight."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from volery.autonomy.perception.static_transforms import StaticTransforms
from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.recorded_flight import RecordedScenario
from volery.bridges.logs.records import LogRecord, LogWalk
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.errors import GraphError, RecordingError, VoleryError
from volery.graph.messages import stamp_of
from volery.report.logged_teams import FLOCK, FORMATION, MEMBER, EnergyMeter, LoggedTeam, TeamLog
from volery.report.trajectories import RecordedTrajectory
from volery.report.trunk_survey import LEVEL, NODDING, TrunkSurvey
from volery.verdicts.observing import ESTIMATES

TRUTH = "ground_truth/odom"
_BATTERY_TYPE = "sensor_msgs/msg/BatteryState"
_SCAN_TYPE, _JOINTS_TYPE = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/JointState"
_POSE_TYPES = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
)
_WISHES = ("goal", "setpoint", "target", "waypoint", "command")
"""Words in pose topics that are commands rather than measurements."""
_POSE_NS = 50_000_000


@dataclass(frozen=True)
class LoggedUav:
    """Data of one UAV in a log."""

    name: str
    truth: RecordedTrajectory | None
    estimate: RecordedTrajectory | None
    trunks: Array
    """(T, 3) m, by the estimated poses; detected three times or more."""
    is_founded: bool
    """Whether nodding scans confirm that the trunks reach the ground; else by shape alone."""
    energy_j: float = math.nan
    """Energy that its battery supplied; NaN if not in the log."""


@dataclass(frozen=True)
class LoggedFlight:
    """Data of a flight in a log."""

    uavs: list[LoggedUav]
    """Sorted by name."""
    scenario: str
    """Name, if recorded."""
    description: str
    lasts_s: float
    origin: RecordedScenario | None = None
    """The recorded scenario, if any."""
    problem: str = ""
    """Problem of the file: cut off, damaged chunks; empty for an intact one."""
    team: LoggedTeam | None = None
    """What the node of a formation or flock published, if any."""


@dataclass(frozen=True)
class LoggedTrajectory:
    """A trajectory of a log, and the problem of the file."""

    trajectory: RecordedTrajectory
    problem: str


@dataclass
class _Rows:
    poses: list[tuple[float, ...]] = field(default_factory=list)
    next_ns: int = 0

    def take(self, message: Any, time_ns: int) -> None:
        """Stores a pose, twenty a second."""
        if time_ns < self.next_ns:
            return
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        p, q = pose.position, pose.orientation
        numbers = (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
        if all(map(math.isfinite, numbers)):  # lost filters publish NaN
            self.next_ns = time_ns + _POSE_NS
            self.poses.append((time_ns * 1e-9, *numbers))

    def trajectory(self) -> RecordedTrajectory:
        """Returns the trajectory of all poses."""
        return RecordedTrajectory.of_rows(self.poses)


@dataclass
class _Log:
    """Data from a log's messages."""

    rows_of: dict[str, _Rows] = field(default_factory=dict)
    """By topic."""
    surveys: dict[str, TrunkSurvey] = field(default_factory=dict)
    """By UAV."""
    batteries: dict[str, EnergyMeter] = field(default_factory=dict)
    """By UAV."""
    team: TeamLog = field(default_factory=TeamLog)
    joints: StaticTransforms = field(default_factory=StaticTransforms)
    types: dict[str, str] = field(default_factory=dict)
    scenario: dict[str, Any] = field(default_factory=dict)
    origin: RecordedScenario | None = None
    problem: str = ""
    first_ns: int | None = None
    last_ns: int = 0

    def take(self, record: LogRecord, decoder: LogDecoder) -> None:
        """Processes a message. Raises GraphError if its type is unknown."""
        topic, time_ns = record.topic.topic, record.time_ns
        self.first_ns = time_ns if self.first_ns is None else self.first_ns
        self.last_ns = max(self.last_ns, time_ns)
        self.types.setdefault(topic, record.topic.msgtype)
        kind = decoder.type_of(record.topic)
        self.types[topic] = kind
        name, _, what = topic[1:].partition("/")
        if kind == _SCAN_TYPE and what in (LEVEL, NODDING):
            survey = self._survey(name)
            if survey.wants(what, time_ns):
                survey.add_scan(what, time_ns, decoder.decode(record).message)
        elif kind == _JOINTS_TYPE and what == "joint_states":
            self._survey(name).add_nods(decoder.decode(record).message)
        elif kind == _BATTERY_TYPE and what == "battery":
            meter = self.batteries.setdefault(name, EnergyMeter())
            meter.add(time_ns, decoder.decode(record).message)
        elif topic in (FORMATION, FLOCK) or what == MEMBER:
            self.team.add(topic, time_ns, decoder.decode(record).message)
        elif topic == "/tf_static":
            self.joints.add(decoder.decode(record).message)
        elif topic == "/volery/scenario":
            message = decoder.decode(record).message
            self.scenario, self.origin = _content(message), _origin(message)
        elif kind in _POSE_TYPES:
            message = decoder.decode(record).message
            self.rows_of.setdefault(topic, _Rows()).take(message, stamp_of(message) or time_ns)

    def _survey(self, name: str) -> TrunkSurvey:
        return self.surveys.setdefault(name, TrunkSurvey(self.joints))

    def uav(self, name: str) -> LoggedUav | None:
        """Returns one of the UAVs; None without poses."""
        truth = self.rows_of.get(f"/{name}/{TRUTH}")
        own = next((f"/{name}/{t}" for t in ESTIMATES if f"/{name}/{t}" in self.rows_of), None)
        if truth is None and own is None:
            return None
        trajectory = None if own is None else self.rows_of[own].trajectory()
        survey = self.surveys.get(name, TrunkSurvey())
        trunks = np.zeros((0, 3)) if trajectory is None else survey.trunks(trajectory).seen_often
        energy_j = self.batteries.get(name, EnergyMeter()).energy_j
        true = None if truth is None else truth.trajectory()
        return LoggedUav(name, true, trajectory, trunks, survey.is_founded, energy_j)


def read_flight(path: Path) -> LoggedFlight:
    """Returns the UAVs of a log by Volery's topic names.

    Raises RecordingError if the file is no log, VoleryError if it holds no UAV.
    """
    log = _read(path)
    names = sorted({topic.split("/")[1] for topic in log.rows_of if topic.count("/") > 1})
    uavs = [uav for name in names if (uav := log.uav(name)) is not None]
    if not uavs:
        what = f"; the file is {log.problem}" if log.problem else ""
        raise VoleryError(f"{path}: the log holds no UAV's poses (/NAME/{ESTIMATES[-1]}){what}")
    in_scenario = {word: str(log.scenario.get(word) or "") for word in ("name", "description")}
    lasts_s = (log.last_ns - (log.first_ns or 0)) / NS_PER_S
    texts, team = (in_scenario["name"], in_scenario["description"]), log.team.team(log.scenario)
    return LoggedFlight(uavs, *texts, lasts_s, log.origin, log.problem, team)


def read_trajectory(path: Path, topic: str | None = None) -> LoggedTrajectory:
    """Returns one trajectory of a log: that of `topic`, or of its only pose topic.

    Raises VoleryError, which lists the topics, if that is not possible.
    """
    log = _read(path)
    known = [name for name, rows in log.rows_of.items() if rows.poses and _is_trajectory(name)]
    if topic is None and len(known) == 1:
        return LoggedTrajectory(log.rows_of[known[0]].trajectory(), log.problem)
    if topic is None or topic not in log.rows_of:
        what = "the topic of the poses is ambiguous." if topic is None else f"there is no {topic}."
        if topic in log.types:
            what = f"{topic} holds no poses: it is a {log.types[topic]}."
        raise VoleryError(f"{path}: {what} Topics with poses: {', '.join(sorted(known)) or 'none'}")
    return LoggedTrajectory(log.rows_of[topic].trajectory(), log.problem)


def _is_trajectory(topic: str) -> bool:
    words = topic.lower()
    return not topic.endswith(TRUTH) and not any(wish in words for wish in _WISHES)


def _read(path: Path) -> _Log:
    decoder, log, walk = LogDecoder(), _Log(), LogWalk(path)
    for record in walk:
        try:
            log.take(record, decoder)
        except GraphError:
            continue  # unknown type
    log.problem = walk.problem
    return log


def _content(message: Any) -> dict[str, Any]:
    """Returns the scenario that a run recorded, empty if there is none."""
    try:
        status = json.loads(message.data)
        return dict(status["content"])
    except (AttributeError, KeyError, TypeError, ValueError):
        return {}


def _origin(message: Any) -> RecordedScenario | None:
    try:
        return RecordedScenario.from_json(message.data)
    except (AttributeError, RecordingError):
        return None
