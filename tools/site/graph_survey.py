"""Finds out which topics and services each part of a simulation adds, by building simulations.

A part (a sensor, a node, a world feature) is built into the plainest simulation; what the graph
then has in addition is the part's. Names are those of `uav1`, written with `uavN`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import entry_points
from typing import Any

from volery import Simulation, load_scenario
from volery.core.errors import VoleryError
from volery.runtime.construction.sensor_suites import RESULT_OF
from volery.scenario import library
from volery.scenario.load import parse_scenario
from volery.scenario.schema import Scenario

_SENSORS: dict[str, tuple[dict[str, Any], ...]] = {
    "lidar": (
        {"kind": "lidar", "name": "horizontal", "model": "utm_30lx_ew"},
        {"kind": "lidar", "name": "nodding", "nodding": {"amplitude_deg": 45.0, "period_s": 1.0}},
        {"kind": "lidar", "name": "ring", "model": "vlp_16"},
    ),
    "camera": ({"kind": "camera", "name": "camera", "points": "xyzrgb"},),
    "sonar": ({"kind": "sonar", "rpy_deg": [0.0, 90.0, 0.0]},),
    "estimate": (
        *({"kind": kind} for kind in ("imu", "gnss", "barometer", "magnetometer")),
        {"kind": "estimate"},
    ),
}
"""Sensors that need more than their kind, or more than one entry to show all topics."""
_ACTOR = {
    "name": "walker",
    "shape": "person",
    "motion": {"kind": "external", "position_m": [20.0, 20.0]},
}
WORLDS: dict[str, dict[str, Any]] = {
    "A grid map (`[world.grid_map]`)": {"grid_map": {}},
    "Actors with motion of kind `external` (`[[world.actors]]`)": {"actors": [_ACTOR]},
}
_PARAMETERS: dict[str, dict[str, Any]] = {"radio": {"topics": ["TOPIC std_msgs/msg/String"]}}
"""Parameters without a default, of nodes that no shipped scenario has."""


@dataclass(frozen=True)
class SurveyedTopic:
    """A topic of a graph: its type, whether it is latched, its publishers and subscribers."""

    msgtype: str
    latched: bool
    publishers: int
    subscribers: int

    @property
    def used(self) -> bool:
        """Whether it has publishers or subscribers."""
        return bool(self.publishers or self.subscribers)

    def beyond(self, other: SurveyedTopic | None) -> SurveyedTopic:
        """Returns the topic with the publishers and subscribers that `other` lacks."""
        if other is None:
            return self
        publishers = max(self.publishers - other.publishers, 0)
        return replace(
            self, publishers=publishers, subscribers=max(self.subscribers - other.subscribers, 0)
        )


@dataclass(frozen=True)
class Surveyed:
    """Topics and services of a graph."""

    topics: dict[str, SurveyedTopic]
    services: dict[str, str]

    def without(self, other: Surveyed) -> Surveyed:
        """Returns what `other` lacks."""
        beyond = {name: topic.beyond(other.topics.get(name)) for name, topic in self.topics.items()}
        topics = {name: topic for name, topic in beyond.items() if topic.used}
        services = {k: v for k, v in self.services.items() if k not in other.services}
        return Surveyed(topics, services)


@cache
def base() -> Surveyed:
    """Returns what each simulation of one UAV without sensors and nodes has."""
    return _survey(_plain())


@cache
def sensors() -> tuple[tuple[str, Surveyed], ...]:
    """Returns each kind of sensor and what it adds."""
    return tuple((kind, _sensor(kind)) for kind in RESULT_OF)


def _sensor(kind: str) -> Surveyed:
    entries = _SENSORS.get(kind, ({"kind": kind},))
    others = [entry for entry in entries if entry["kind"] != kind]
    return _survey(_plain(sensors=list(entries))).without(_survey(_plain(sensors=others)))


@cache
def worlds() -> tuple[tuple[str, Surveyed], ...]:
    """Returns each feature of a world and what it adds."""
    return tuple((name, _survey(_plain(world)).without(base())) for name, world in WORLDS.items())


@cache
def nodes() -> tuple[tuple[str, str, Surveyed], ...]:
    """Returns each shipped node with a shipped scenario and what it adds to that scenario."""
    examples = _examples()
    names = sorted(entry.name for entry in entry_points(group="volery.nodes"))
    return tuple(_node(name, examples.get(name)) for name in names)


def _node(name: str, example: Scenario | None) -> tuple[str, str, Surveyed]:
    if example is None:
        return name, "", _survey(_with_node(name)).without(_survey(_with_node(None)))
    alone = _survey(_only(example, name))
    return name, example.name, alone.without(_survey(_only(example, None)))


def _plain(
    world: dict[str, Any] | None = None, sensors: list[dict[str, Any]] | None = None
) -> Scenario:
    return parse_scenario(
        {
            "name": "survey",
            "world": world or {},
            "types": {"f450": {"airframe": "f450", "sensors": sensors or []}},
            "uavs": [{"type": "f450", "position_m": [10.0, 10.0]}],
        }
    )


def _with_node(node: str | None) -> Scenario:
    scenario = load_scenario("forest_search")
    entries = [] if node is None else [{"node": node, "parameters": _PARAMETERS.get(node, {})}]
    (name,) = list(scenario.types)[:1]
    return scenario.with_(types={name: {"nodes": entries}}, nodes=[])


def _examples() -> dict[str, Scenario]:
    """Returns the first shipped scenario that has each node."""
    found: dict[str, Scenario] = {}
    for name in library.names():
        scenario = load_scenario(name)
        for entry in scenario.node_entries:
            found.setdefault(entry.node, scenario)
    return found


def _only(scenario: Scenario, node: str | None) -> Scenario:
    types = {
        name: {"nodes": [_data(entry) for entry in kind.nodes if entry.node == node]}
        for name, kind in scenario.types.items()
    }
    return scenario.with_(types=types, nodes=[_data(e) for e in scenario.nodes if e.node == node])


def _data(entry: Any) -> dict[str, Any]:
    return dict(entry.model_dump(exclude_unset=True))


def _survey(scenario: Scenario) -> Surveyed:
    try:
        with Simulation(scenario) as simulation:
            simulation.run(0.01)
            topics = {
                _general(t.name): SurveyedTopic(t.msgtype, t.latched, t.publishers, t.subscribers)
                for t in reversed(simulation.graph.topics())
            }
            services = {
                _general(name): kind for name, kind in reversed(simulation.graph.services().items())
            }
    except VoleryError as error:
        raise SystemExit(f"{scenario.name}: {error}") from None
    return Surveyed(dict(sorted(topics.items())), dict(sorted(services.items())))


def _general(name: str) -> str:
    """Writes `uavN` and `NAME` for the names of UAVs, LIDARs and actors."""
    name = re.sub(r"\buav\d+", "uavN", name)
    return re.sub(r"/(laser|actors)/\w+", r"/\1/NAME", name)
