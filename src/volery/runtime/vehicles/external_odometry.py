"""Passes odometry that nodes estimate from sensors to the estimators of their UAVs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any

import numpy as np

from volery.control.flight_modes import FlightMode
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.vectors import norm
from volery.engine.engine import Engine
from volery.engine.events import EventKind
from volery.graph.graph import Graph
from volery.graph.messages import Odometry, Published, stamp_of
from volery.runtime.services.results import Close
from volery.scenario.schema import EstimateSensor, ExternalOdometrySource, Sensor

_LOOK_S = 0.1
_SILENT_S, _REPORTED_S = 2.0, 5.0
"""Times without poses, s: after the first the estimate of a landed UAV is kept at rest, after the
second an event is logged. Modelling choices."""


class ExternalOdometry:
    """Subscribes estimators to external odometry; `start` monitors the topics.

    Without odometry, the estimate of a landed UAV is constrained to zero motion, as it would drift
    otherwise. In flight nothing compensates, so missing odometry is logged as an event.
    """

    def __init__(self, graph: Graph, engine: Engine) -> None:
        self._graph = graph
        self._engine = engine
        self._watched: dict[str, tuple[str, int]] = {}
        """Topic of each UAV, and the time of its subscription, ns."""

    def start(self, every: Callable[..., None]) -> None:
        """Starts to check the topics each `_LOOK_S` of simulated time."""
        every(_LOOK_S, self._look, wanted=lambda: bool(self._watched))

    def open(self, uav_name: str, sensors: Iterable[Sensor]) -> Iterator[Close]:
        """Feeds the estimator of a UAV with the odometry that its "estimate" sensor names.

        Yields the functions that end this.
        """
        aids = [
            s.external_odometry
            for s in sensors
            if isinstance(s, EstimateSensor) and s.external_odometry is not None
        ]
        for aid in aids:
            topic = f"/{uav_name}/{aid.topic}"
            self._watched[uav_name] = aid.topic, self._engine.time_ns
            yield partial(self._forget, uav_name)
            take = _taker(self._engine, uav_name, aid)
            yield self._graph.subscribe(topic, take, Odometry).cancel

    def _forget(self, uav_name: str) -> None:
        self._watched.pop(uav_name, None)

    def _look(self) -> None:
        engine, estimation = self._engine, self._engine.estimation
        if estimation is None:
            return
        now = engine.time_ns
        for uav_name, (topic, since_ns) in self._watched.items():
            row = engine.names.index(uav_name)
            since = max(estimation.pose_ns(row), since_ns if since_ns <= now else 0)
            silent_s = (now - since) / NS_PER_S
            if silent_s >= _SILENT_S and engine.fleet.mode(row) is FlightMode.LANDED:
                estimation.stand_still(row, now)
            if _REPORTED_S <= silent_s < _REPORTED_S + _LOOK_S:  # once, without state to save
                engine.note(
                    row, EventKind.FAULT, f"receives no poses on {topic}: its estimate drifts"
                )


def _taker(
    engine: Engine, uav_name: str, aid: ExternalOdometrySource
) -> Callable[[Published], None]:
    gap_ns = round(NS_PER_S / aid.rate_hz)
    sigma_rad = math.radians(aid.sigma_deg)

    def take(published: Published) -> None:
        from volery.engine.estimation import (
            PoseMeasurement,  # late: its kernels compile for seconds
        )

        stamp_ns = stamp_of(published.message)
        position, turn = _read(published.message)
        readable = np.isfinite(position).all() and 0.9 < norm(turn) < 1.1
        if not readable or stamp_ns > engine.time_ns or engine.estimation is None:
            return
        pose = PoseMeasurement(stamp_ns, position, turn, aid.sigma_m, sigma_rad)
        engine.estimation.take_pose(engine.names.index(uav_name), pose, gap_ns=gap_ns)

    return take


def _read(message: Any) -> tuple[Array, Array]:
    p, q = message.pose.pose.position, message.pose.pose.orientation
    return np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])
