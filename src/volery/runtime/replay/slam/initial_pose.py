"""Reads the UAV's pose at the start of a log that Volery recorded."""

from __future__ import annotations

from contextlib import closing

from volery.bridges.logs.recorded_flight import ORIGIN_TOPIC, RecordedScenario
from volery.core import rotations
from volery.core.clock import NS_PER_S
from volery.core.errors import VoleryError
from volery.graph.messages import frame_of
from volery.runtime.construction.fleet import place_fleet
from volery.runtime.construction.worlds import build_world
from volery.runtime.replay.scenario_record import scenario_of
from volery.runtime.replay.slam.extrinsics import ExtrinsicsLog

Pose = tuple[float, float, float, float]
"""x, y, z in m and yaw in rad, in the map frame."""

_STRING, _ODOMETRY = "std_msgs/msg/String", "nav_msgs/msg/Odometry"
_MAP = "map"
_BEGINNING_NS = NS_PER_S
"""Max time of the first scan, ns, for a log that starts with its scenario."""


def beginning_of(source: ExtrinsicsLog, uav: str, scan: str) -> Pose | None:
    """Returns the initial pose of `uav`; None if the log has none or is not of Volery.

    Sources in order: the ground truth in the log; for a log that starts with the flight, the
    scenario's start pose. `scan` is the topic of the mapped scans.
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
        if frame_of(message) != _MAP:
            return None
        p, q = message.pose.pose.position, message.pose.pose.orientation
        return p.x, p.y, p.z, float(rotations.yaw_of([q.x, q.y, q.z, q.w]))
    return None


def _scenario_pose(source: ExtrinsicsLog, uav: str) -> Pose | None:
    """Returns `{start_pose}` in the scenario of the log, whose world is built for that."""
    for _, _, message in source.messages({ORIGIN_TOPIC}):
        try:
            scenario = scenario_of(
                RecordedScenario.from_json(message.data), folder=source.path.parent
            )
            terrain, _, _, scene = build_world(scenario, 1)
            with closing(scene):
                starts = place_fleet(scenario, scene, terrain)
        except VoleryError:  # of another version, or its files are elsewhere
            return None
        for start in starts:
            if start.name == uav:
                x, y, z = start.position_map.tolist()
                return x, y, z, float(rotations.yaw_of(start.attitude))
        return None
    return None
