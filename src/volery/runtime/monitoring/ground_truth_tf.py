"""Publishes `/ground_truth/tf`: the true poses of all UAVs and actors, in one message.

It is for pages and renderers. Autonomy must not subscribe: a real robot has no such topic.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.engine.engine import Engine
from volery.graph.graph import Graph
from volery.graph.messages import TFMessage
from volery.publishing.transforms import transforms_in_map
from volery.runtime.monitoring.live_topic import LiveTopic

TOPIC = "/ground_truth/tf"
_PERIOD_S = 0.02
_MIN_PERIOD_S = 0.05
"""Min wall time between two external messages, s: smooth at a twentieth of real time."""


def ground_truth_topic(graph: Graph, engine: Engine) -> LiveTopic:
    """Publishes `map -> uavN/base_link` of every UAV in order, then `map -> NAME` of actors."""
    publisher = graph.advertise(TOPIC, TFMessage)
    return LiveTopic(
        publisher, lambda: _message(engine), lambda: _content(engine), _PERIOD_S, _MIN_PERIOD_S
    )


def _message(engine: Engine) -> TFMessage:
    state, actors = engine.fleet.state, engine.actors
    frames = [f"{name}/base_link" for name in engine.names]
    poses = np.hstack([state.position_map, state.attitude])
    if actors is not None:
        frames += actors.names
        poses = np.vstack([poses, actors.poses_at(engine.time_ns)])
    return transforms_in_map(engine.time_ns, frames, poses)


def _content(engine: Engine) -> tuple[Any, ...]:
    state, actors = engine.fleet.state, engine.actors
    moving = b"" if actors is None else actors.poses_at(engine.time_ns).tobytes()
    return (
        engine.time_ns,
        engine.names,
        state.position_map.tobytes(),
        state.attitude.tobytes(),
        moving,
    )
