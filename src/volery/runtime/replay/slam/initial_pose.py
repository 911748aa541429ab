"""Where the UAV of a log of Volery's stood when the log begins."""

from __future__ import annotations

from contextlib import closing

from volery.bridges.logs.recorded_flight import ORIGIN_TOPIC, RecordedScenario
from volery.core import rotations
from volery.core.clock import NS_PER_S
from volery.core.errors import VoleryError
from volery.runtime.build.fleet import place
from volery.runtime.build.worlds import build_world
from volery.runtime.replay.scenario_record import scenario_of
from volery.runtime.replay.slam.extrinsics import ExtrinsicsLog

Pose = tuple[float, float, float, float]
"""x, y, z in m and yaw in rad, in the map."""

_STRING, _ODOMETRY = "std_msgs/msg/String", "nav_msgs/msg/Odometry"
_MAP = "map"
_BEGINNING_NS = NS_PER_S
"""A log whose first scan is later does not begin where the scenario does."""


def beginning_of(source: ExtrinsicsLog, uav: str, scan: str) -> Pose | None:
    """The pose of `uav`; None where the log is none of Volery's, or does not tell it.

    First counts the ground truth in the log, then, of a log that begins with the flight, the place
    at which its scenario puts the UAV. scan: topic of the scans that are mapped.
    """
    if source.topics.get(ORIGIN_TOPIC) != _STRING:
        return None
    truth = f"/{uav}/ground_truth/odom"
    if source.topics.get(truth) == _ODOMETRY:
        return _true_pose(source, truth)
    first = next(iter(source.messages({scan})), None)
    if first is None or first.time_ns > _BEGINNING_NS:
        return None
    return _scenario_pose(source, uav)


def _true_pose(source: ExtrinsicsLog, topic: str) -> Pose | None:
    for _, _, message in source.messages({topic}):
        if message.header.frame_id != _MAP:
            return None
        p, q = message.pose.pose.position, message.pose.pose.orientation
        return p.x, p.y, p.z, float(rotations.yaw_of([q.x, q.y, q.z, q.w]))
    return None


def _scenario_pose(source: ExtrinsicsLog, uav: str) -> Pose | None:
    """Where `{start_pose}` is in the scenario that was flown; its world is built for that."""
    for _, _, message in source.messages({ORIGIN_TOPIC}):
        try:
            scenario = scenario_of(
                RecordedScenario.from_json(message.data), folder=source.path.parent
            )
            terrain, _, _, scene = build_world(scenario, 1)
            with closing(scene):
                starts = place(scenario, scene, terrain)
        except VoleryError:  # of another version, or its files are elsewhere
            return None
        for start in starts:
            if start.name == uav:
                x, y, z = start.position_map.tolist()
                return x, y, z, float(rotations.yaw_of(start.attitude))
        return None
    return None
