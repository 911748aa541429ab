"""Publishes `map -> uavN/base_link` on `/tf` for UAVs with sensors or nodes but without odometry.

A UAV's odometry publishes its transform. Without odometry the autopilot flies on the true pose, so
that pose is the transform, and scans and images have a position in the map. The simulation leaves
the UAV's frames to others, such as a localization of the user's own, once these publish them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from volery.engine.engine import Engine
from volery.graph.graph import Graph
from volery.graph.messages import Published, TFMessage
from volery.graph.topics import Subscription
from volery.publishing.transforms import transforms_in_map
from volery.runtime.services.results import Close
from volery.scenario.schema import EstimateSensor, OdometrySensor, UavType

_TOPIC = "/tf"
_PERIOD_S = 0.02
"""Period, s: that of odometry by default."""


class PoseTransforms:
    """Publishes the transforms of an engine's UAVs; `start` schedules them."""

    def __init__(self, graph: Graph, engine: Engine) -> None:
        self._graph = graph
        self._engine = engine
        self._publisher = graph.advertise(_TOPIC, TFMessage)
        self._without_odometry: set[str] = set()
        self._located_by_others: set[str] = set()
        """Those of them whose frames others publish."""
        self._watch: Subscription | None = None
        """Receives the transforms of others, while there are UAVs without odometry."""
        self._sent: TFMessage | None = None

    def start(self, every: Callable[..., None]) -> None:
        """Publishes each `_PERIOD_S` of simulated time from now on."""
        every(_PERIOD_S, self._publish, wanted=self._is_wanted)

    def open(self, uav_name: str, uav_type: UavType) -> Iterator[Close]:
        """Adds a UAV if its pose is needed and no sensor publishes it.

        Yields the function that removes it.
        """
        sensors = uav_type.sensors
        has_odometry = any(isinstance(s, OdometrySensor | EstimateSensor) for s in sensors)
        if has_odometry or not (sensors or uav_type.nodes):
            return
        if self._watch is None:
            self._watch = self._graph.subscribe(_TOPIC, self._receive, TFMessage)
        self._without_odometry.add(uav_name)

        def close() -> None:
            self._without_odometry.discard(uav_name)
            self._located_by_others.discard(uav_name)
            if not self._without_odometry and self._watch is not None:
                self._watch.cancel()
                self._watch = None

        yield close

    def get_state(self) -> frozenset[str]:
        """Returns the state for a snapshot."""
        return frozenset(self._located_by_others)

    def set_state(self, state: frozenset[str]) -> None:
        """Restores a saved state."""
        self._located_by_others = set(state)

    def _is_wanted(self) -> bool:
        """Returns whether there is a UAV to publish, and a receiver besides `_watch`."""
        if self._without_odometry <= self._located_by_others:
            return False
        return self._graph.subscribers(_TOPIC) > 1 or self._graph.is_recorded(_TOPIC)

    def _receive(self, published: Published) -> None:
        if published.message is self._sent:
            return
        for transform in published.message.transforms:
            uav_name, _, frame = transform.child_frame_id.lstrip("/").partition("/")
            if frame in ("base_link", "odom") and uav_name in self._without_odometry:
                self._located_by_others.add(uav_name)

    def _publish(self) -> None:
        engine = self._engine
        meant = self._without_odometry - self._located_by_others
        rows = [row for row, name in enumerate(engine.names) if name in meant]
        frames = [f"{engine.names[row]}/base_link" for row in rows]
        state = engine.fleet.state
        poses = np.hstack([state.position_map[rows], state.attitude[rows]])
        self._sent = transforms_in_map(engine.time_ns, frames, poses)
        self._publisher.publish(self._sent)
