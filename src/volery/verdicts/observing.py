"""Records messages during a flight: estimated trajectories, and topics that expectations name."""

from __future__ import annotations

import json
from bisect import bisect_left
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from volery.core.arrays import Array
from volery.core.clock import s_from_ns
from volery.graph.messages import Published, stamp_of
from volery.graph.nodes.logger import ROSOUT
from volery.scenario.expectations import (
    Expectation,
    LogMessageExpectation,
    PredicateExpectation,
    TopicRateExpectation,
    TopicValueExpectation,
)

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation

ESTIMATES = ("slam/pose", "slam/odom", "odom")
"""Topics of a UAV's estimated pose, the best one first."""
MISSING = object()
"""Value of a field that a message does not have."""
_WHOLE = "*"


class Estimate(NamedTuple):
    """A UAV's own estimate of its trajectory, M poses."""

    times_s: Array
    """(M,) simulated time, s."""
    position: Array
    """(M, 3) m, in the frame of the estimate."""
    attitude: Array
    """(M, 4) quaternions x y z w, of the body in that frame."""
    covariance: Array
    """(M, 3, 3) m^2; nan without one."""


Estimates = Mapping[str, Estimate]
"""Estimated trajectories by UAV."""


@dataclass
class TopicRecord:
    """The messages of a topic, or some fields of them."""

    times_s: list[float] = field(default_factory=list)
    """Simulated times, s."""
    values: dict[str, list[Any]] = field(default_factory=dict)
    """Values of fields at these times, by the paths of the fields; `MISSING` without one."""
    messages: list[Any] | None = None
    """The messages at these times; None: only fields are kept."""

    def add(self, time_s: float, message: Any) -> None:
        """Adds a message; drops those of a flight that a reset or a snapshot has undone."""
        if self.times_s and self.times_s[-1] > time_s:
            kept = bisect_left(self.times_s, time_s)
            for column in (self.times_s, self.messages or [], *self.values.values()):
                del column[kept:]
        self.times_s.append(time_s)
        if self.messages is not None:
            self.messages.append(message)
        for path, column in self.values.items():
            column.append(value_at(message, path))


class FlightObserver:
    """Records what expectations need of the messages of a simulation, from now on.

    estimates: whether poses that UAVs estimate are recorded. It changes no results.
    """

    def __init__(
        self, simulation: Simulation, expectations: Sequence[Expectation], *, estimates: bool
    ) -> None:
        self.topics: dict[str, TopicRecord] = {}
        """Records by topic."""
        for topic, path in _asked(expectations, tuple(simulation.uavs)):
            record = self.topics.setdefault(topic, TopicRecord())
            if path == _WHOLE:
                record.messages = []
            elif path:
                record.values.setdefault(path, [])
        self._poses: dict[str, list[Array]] = {}
        self._subscriptions = []
        if self.topics:
            graph = simulation.graph
            asked = self.topics.__contains__
            self._subscriptions.append(graph.subscribe_all(self._on_message, asked))
        if estimates:
            self._subscribe_to_poses(simulation)

    def _on_message(self, published: Published) -> None:
        self.topics[published.topic].add(s_from_ns(published.time_ns), published.message)

    def _subscribe_to_poses(self, simulation: Simulation) -> None:
        """Subscribes to the best estimate of each UAV."""
        topics = {info.name: info.msgtype for info in simulation.graph.topics()}
        for name in simulation.uavs:
            found = [f"/{name}/{end}" for end in ESTIMATES if f"/{name}/{end}" in topics]
            if found:
                rows = self._poses.setdefault(name, [])
                subscribe = simulation.graph.subscribe
                self._subscriptions.append(
                    subscribe(found[0], _pose_receiver(rows), topics[found[0]])
                )

    def estimates(self) -> dict[str, Estimate]:
        """Returns the estimated trajectories by UAV."""
        found = {}
        for name, rows in self._poses.items():
            table = np.array(rows, np.float64).reshape(-1, 17)
            covariance = table[:, 8:].reshape(-1, 3, 3)
            found[name] = Estimate(table[:, 0], table[:, 1:4], table[:, 4:8], covariance)
        return found

    def close(self) -> None:
        """Ends the recording."""
        for subscription in self._subscriptions:
            subscription.cancel()


def topics_of(topic: str, uavs: Collection[str]) -> tuple[str, ...]:
    """Returns the absolute names of a topic: itself, or below the namespaces of UAVs."""
    return (topic,) if topic.startswith("/") else tuple(f"/{uav}/{topic}" for uav in uavs)


def value_at(message: Any, path: str) -> Any:
    """Returns a field of a message, also inside text that is JSON; `MISSING` without one."""
    found = message
    for key in path.split("."):
        if isinstance(found, str):
            try:
                found = json.loads(found)
            except ValueError:
                return MISSING
        if isinstance(found, Mapping):
            found = found.get(key, MISSING)
        elif isinstance(found, Sequence | np.ndarray) and key.isdigit():
            found = found[int(key)] if int(key) < len(found) else MISSING
        else:
            found = getattr(found, key, MISSING)
        if found is MISSING:
            return MISSING
    return found


def _asked(expectations: Sequence[Expectation], uavs: tuple[str, ...]) -> list[tuple[str, str]]:
    """Returns topics and paths of fields that expectations need.

    An empty path: the times alone; `_WHOLE`: whole messages.
    """
    found = []
    for each in expectations:
        if isinstance(each, TopicRateExpectation | TopicValueExpectation):
            path = each.field if isinstance(each, TopicValueExpectation) else ""
            found += [(topic, path) for topic in topics_of(each.topic, each.uavs or uavs)]
        elif isinstance(each, PredicateExpectation):
            topics = (topics_of(topic, each.uavs or uavs) for topic in each.topics)
            found += [(topic, _WHOLE) for named in topics for topic in named]
        elif isinstance(each, LogMessageExpectation):
            found += [(ROSOUT, path) for path in ("level", "name", "msg")]
    return found


def _pose_receiver(rows: list[Array]) -> Any:
    def receive(published: Published) -> None:
        message = published.message
        has_covariance = hasattr(message.pose, "pose")
        pose = message.pose.pose if has_covariance else message.pose
        time_s = (stamp_of(message) or published.time_ns) * 1e-9
        row, turn = np.full(17, np.nan), pose.orientation
        row[:4] = time_s, pose.position.x, pose.position.y, pose.position.z
        row[4:8] = turn.x, turn.y, turn.z, turn.w
        if has_covariance:
            row[8:] = np.reshape(message.pose.covariance, (6, 6))[:3, :3].ravel()
        if not np.isfinite(row[:8]).all() or (rows and time_s == rows[-1][0]):
            return
        while rows and rows[-1][0] > time_s:  # of a flight that a reset or a snapshot has undone
            rows.pop()
        rows.append(row)

    return receive
