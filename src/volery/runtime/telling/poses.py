"""`/ground_truth/tf`: where all UAVs and things truly are, in one message.

For pages and renderers. Autonomy must not read it: on a robot there is nothing like it.
"""

from __future__ import annotations

from typing import Any

from volery.engine.engine import Engine
from volery.graph.graph import Graph
from volery.graph.messages import (
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    header,
)
from volery.runtime.telling.present import Present

TOPIC = "/ground_truth/tf"
_PERIOD_S = 0.02
_LEAST_S = 0.05
"""Between two messages that are shown: smooth enough to the eye at a twentieth of real time."""


def tell_poses(graph: Graph, engine: Engine) -> Present:
    """Tell `map -> uavN/base_link` of every UAV in fleet order, then `map -> NAME` of things."""
    publisher = graph.advertise(TOPIC, TFMessage)
    return Present(
        publisher, lambda: _message(engine), lambda: _content(engine), _PERIOD_S, _LEAST_S
    )


def _message(engine: Engine) -> TFMessage:
    state = engine.fleet.state
    stamp = header(engine.time_ns, "map")
    frames = [f"{name}/base_link" for name in engine.names]
    transforms = _transforms(stamp, frames, state.position_map.tolist(), state.attitude.tolist())
    things = engine.things
    if things is not None:
        poses = things.poses_at(engine.time_ns)
        named = list(things.names)
        transforms += _transforms(stamp, named, poses[:, :3].tolist(), poses[:, 3:].tolist())
    return TFMessage(transforms)


def _transforms(
    stamp: Any, frames: list[str], places: list[list[float]], turns: list[list[float]]
) -> list[TransformStamped]:
    return [
        TransformStamped(stamp, frame, Transform(Vector3(*place), Quaternion(*turn)))
        for frame, place, turn in zip(frames, places, turns, strict=True)
    ]


def _content(engine: Engine) -> tuple[Any, ...]:
    state, things = engine.fleet.state, engine.things
    moving = b"" if things is None else things.poses_at(engine.time_ns).tobytes()
    return (
        engine.time_ns,
        engine.names,
        state.position_map.tobytes(),
        state.attitude.tobytes(),
        moving,
    )
