"""Finished runs of made-up flights."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from volery.engine.events import Event, EventKind
from volery.results import FlightResult
from volery.scenario.load import parse_scenario
from volery.verdicts.finished_run import FinishedRun

SCENARIO = {
    "name": "made_up",
    "types": {"bird": {"airframe": "f450"}},
    "uavs": [{"type": "bird", "position_m": [0.0, 0.0]}],
}
RADIUS_M = 0.4


def flight_of(positions: Any, *, rate_hz: float = 10.0, **arrays: Any) -> FlightResult:
    """Returns a flight through positions (n, T, 3), at `rate_hz` samples per second."""
    position = np.asarray(positions, np.float64)
    n, t = position.shape[:2]
    states = {
        "velocity_map": np.gradient(position, 1.0 / rate_hz, axis=1) if t > 1 else position * 0.0,
        "attitude": np.tile([0.0, 0.0, 0.0, 1.0], (n, t, 1)),
        "omega_body": np.zeros((n, t, 3)),
        "battery_charge": np.ones((n, t)),
        "mode": np.where(np.isnan(position[:, :, 0]), -1, 2).astype(np.int8),
        "events": (),
    }
    return FlightResult(
        "made_up",
        1,
        tuple(f"uav{k + 1}" for k in range(n)),
        np.arange(t) / rate_hz,
        position,
        **{**states, **arrays},
    )


def run_of(flight: FlightResult, *expectations: dict[str, Any], **parts: Any) -> FinishedRun:
    """Returns a finished run of a flight, in a world without obstacles."""
    scenario = parse_scenario({**SCENARIO, "expect": list(expectations)}, where="test")
    body = SimpleNamespace(collision_radius_m=RADIUS_M)
    airframes = {name: SimpleNamespace(body=body) for name in flight.uavs}
    scene = parts.pop("scene", Posts([]))
    return FinishedRun(flight, scenario, airframes, scene, **{"wall_s": 1.0, **parts})


class Posts:
    """A scene of endless vertical posts without thickness; counts the points of its queries."""

    def __init__(self, posts: Any) -> None:
        self._posts = np.reshape(np.asarray(posts, np.float64), (-1, 2))
        self.asked = 0

    def clearance(self, points: Any, reach_m: float, include_terrain: bool = True) -> Any:
        """Returns distances (P,), inf beyond the radius."""
        assert not include_terrain
        self.asked += len(points)
        offset = np.asarray(points)[:, None, :2] - self._posts
        distance = np.linalg.norm(offset, axis=2).min(axis=1, initial=np.inf)
        return SimpleNamespace(distance=np.where(distance > reach_m, np.inf, distance))


def line(start: Any, end: Any, samples: int) -> Any:
    """Returns positions (samples, 3) from one position to another."""
    return np.linspace(start, end, samples)


def event_of(time_s: float, uav: str, kind: str, **keys: Any) -> Event:
    """Returns an event at the origin."""
    values = {"position_map": (0.0, 0.0, 0.0), "speed_m_s": 0.0, **keys}
    return Event(round(time_s * 1e9), uav, EventKind(kind), **values)
