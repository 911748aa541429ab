"""Odometry that nodes make of their own sensors, on its way to the estimators of their UAVs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.clock import NS_PER_S
from volery.engine.engine import Engine
from volery.graph.graph import Graph
from volery.graph.messages import Odometry, Published, stamp_of
from volery.runtime.services.offering import Close
from volery.scenario.schema import EstimateSensor, PoseAid, Sensor

Array = NDArray[np.float64]


def open_pose_aids(
    graph: Graph, engine: Engine, uav_name: str, sensors: Iterable[Sensor]
) -> list[Close]:
    """Feed the estimator of a UAV with the odometry that its sensor "estimate" names."""
    return [
        graph.subscribe(
            f"/{uav_name}/{sensor.pose.topic}", _taker(engine, uav_name, sensor.pose), Odometry
        ).cancel
        for sensor in sensors
        if isinstance(sensor, EstimateSensor) and sensor.pose is not None
    ]


def _taker(engine: Engine, uav_name: str, aid: PoseAid) -> Callable[[Published], None]:
    gap_ns = round(NS_PER_S / aid.rate_hz)
    sigma_rad = math.radians(aid.sigma_deg)

    def take(published: Published) -> None:
        from volery.engine.estimation import Pose  # late: its kernels compile for seconds

        stamp_ns = stamp_of(published.message)
        place, turn = _read(published.message)
        readable = np.isfinite(place).all() and 0.9 < float(np.linalg.norm(turn)) < 1.1
        if not readable or stamp_ns > engine.time_ns or engine.estimation is None:
            return
        pose = Pose(stamp_ns, place, turn, aid.sigma_m, sigma_rad)
        engine.estimation.take_pose(engine.names.index(uav_name), pose, gap_ns=gap_ns)

    return take


def _read(message: Any) -> tuple[Array, Array]:
    p, q = message.pose.pose.position, message.pose.pose.orientation
    return np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])
