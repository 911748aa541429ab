"""Reads the LIDARs' extrinsics of a log, from the first of several sources that has them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from volery.autonomy.perception.static_transforms import Mount, StaticTransforms
from volery.bridges.logs.recorded_flight import ORIGIN_TOPIC, RecordedScenario
from volery.core import rotations
from volery.core.errors import RecordingError, ScenarioError
from volery.graph.messages import frame_name, frame_of
from volery.runtime.replay.scenario_record import scenario_of
from volery.runtime.replay.slam.sources import SlamInput

_BODIES = ("base_link", "base_footprint", "base")
"""Last parts of names of body frames."""
_STRING = "std_msgs/msg/String"


class ExtrinsicsLog(Protocol):
    """Provides the messages of a log."""

    path: Path

    @property
    def topics(self) -> dict[str, str]:
        """Message types by topic."""

    def messages(self, wanted: set[str]) -> Iterator[SlamInput]:
        """Yields the messages of the topics `wanted` in the order of the file."""


def frames_of(source: ExtrinsicsLog, topics: dict[str, str]) -> dict[str, str]:
    """Returns the frames of LIDARs, given their topics by name, from their first messages.

    Names of topics without messages are missing.
    """
    names = {topic: name for name, topic in topics.items()}
    frames: dict[str, str] = {}
    for topic, _, message in source.messages(set(names)):
        frames.setdefault(names[topic], frame_of(message))
        if len(frames) == len(names):
            break
    return frames


def read_joints(source: ExtrinsicsLog, frames: set[str]) -> tuple[StaticTransforms, set[str]]:
    """Returns the transforms between LIDAR frames and the body, and the frames without any.

    Sources in order: `/tf_static`; `/tf`, of moving transforms the translation alone (their
    rotation is not the mount's); the scenario in the log.
    """
    joints = StaticTransforms()
    for _, _, message in source.messages({"/tf_static"} & set(source.topics)):
        joints.add(message)
    open_ = {frame for frame in frames if not _is_in_body(joints, frame)}
    if open_ and "/tf" in source.topics:
        _join_moving(source, joints, open_)
    unknown = {frame for frame in open_ if frame not in joints.joints}
    if unknown and source.topics.get(ORIGIN_TOPIC) == _STRING:
        _join_by_scenario(source, joints, unknown)
    return joints, {frame for frame in unknown if frame not in joints.joints}


def _chain(joints: StaticTransforms, frame: str) -> list[str]:
    """Returns the frame and its ancestors."""
    chain = [frame]
    while chain[-1] in joints.joints and len(chain) < 17:
        chain.append(joints.joints[chain[-1]][0])
    return chain


def _is_body(frame: str) -> bool:
    return frame.rpartition("/")[2] in _BODIES


def _is_in_body(joints: StaticTransforms, frame: str) -> bool:
    return any(map(_is_body, _chain(joints, frame)))


def _join_moving(source: ExtrinsicsLog, joints: StaticTransforms, frames: set[str]) -> None:
    """Adds the transforms of `/tf` for these frames and their ancestors.

    If no frame has the name of a body, only the transform of the frame itself counts: those of
    its ancestors may be the vehicle's own motion.
    """
    both = StaticTransforms()
    both.joints = dict(joints.joints)
    for _, _, message in source.messages({"/tf"}):
        for found in message.transforms:
            p, child = found.transform.translation, frame_name(found.child_frame_id)
            if (
                child not in both.joints
                and not _is_body(child)
                and np.isfinite([p.x, p.y, p.z]).all()
            ):
                mount = Mount(np.array([p.x, p.y, p.z]), rotations.IDENTITY)
                both.joints[child] = frame_of(found), mount
        if all(_is_in_body(both, frame) for frame in frames):
            break
    for frame in frames:
        names = _chain(both, frame) if _is_in_body(both, frame) else [frame]
        joints.joints |= {name: both.joints[name] for name in names if name in both.joints}


def _join_by_scenario(source: ExtrinsicsLog, joints: StaticTransforms, frames: set[str]) -> None:
    """Adds the mounts of the scenario in the log."""
    for _, _, message in source.messages({ORIGIN_TOPIC}):
        try:
            scenario = scenario_of(RecordedScenario.from_json(message.data))
        except (RecordingError, ScenarioError):  # of another version
            return
        kinds = [group.type for group in scenario.uavs for _ in range(group.count)]
        for number, kind in enumerate(kinds, 1):
            for sensor in scenario.types[kind].sensors:
                frame = f"uav{number}/laser_{sensor.name}"
                if sensor.kind == "lidar" and frame in frames:
                    joints.joints[frame] = f"uav{number}/base_link", _mount(sensor)
        return


def _mount(sensor: Any) -> Mount:
    turn = rotations.from_rpy(*(math.radians(angle) for angle in sensor.rpy_deg))
    return Mount(np.array(sensor.position_m, np.float64), turn)
