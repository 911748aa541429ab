"""The whole forest search while something goes wrong: a UAV says what, stops, and goes on."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest

from volery.autonomy.mapping.map_files import write_map
from volery.autonomy.mapping.merging import encode_cells
from volery.engine.events import EventKind
from volery.graph.messages import Odometry, header, message_type, stamp_of
from volery.runtime import Simulation
from volery.scenario.load import load_scenario, parse_scenario

S = 1_000_000_000
IN_FLIGHT_S = 14.0
FAULT_S = 3.0
MODERATE_M_S = 1.7
CONTACTS = {EventKind.COLLISION, EventKind.IMPACT}


def search(uavs: int, odometry: str = "slam/odom", folder: str = "") -> Any:
    """The scenario without its cameras, in the corner of the forest where the first UAV begins."""
    scenario = load_scenario("forest_search")
    data = scenario.model_dump(exclude_unset=True)
    data["world"]["forest"]["region_m"] = [0.0, 230.0, 120.0, 330.0]
    data["world"]["meshes"] = []
    data["uavs"][0].update(count=uavs, last_position_m=[24.0, 300.0])
    kind = data["types"]["searcher"]
    kind["sensors"] = [sensor for sensor in kind["sensors"] if sensor["kind"] != "camera"]
    kind["nodes"] = [node for node in kind["nodes"] if "target_detection" not in node["node"]]
    for node in kind["nodes"]:
        parameters = node.setdefault("parameters", {})
        if "odometry" in parameters:
            parameters["odometry"] = odometry
        if node["node"] == "mapping":
            parameters["folder"] = folder
    return parse_scenario(data, access=scenario.access)


class Relay:
    """Stands between the SLAM and the other nodes, and may spoil what passes."""

    def __init__(self, simulation: Simulation) -> None:
        self.spoil = "nothing"
        self._count = 0
        self._last: Odometry | None = None
        self._out = simulation.graph.advertise("/uav1/relayed/odom", Odometry)
        simulation.graph.subscribe("/uav1/slam/odom", lambda p: self._pass(p.message))

    def _pass(self, message: Odometry) -> None:
        self._count += 1
        if self.spoil == "stuck" and self._last is not None:
            message = dataclasses.replace(self._last, header=message.header)
        self._last = message
        shift = {"forwards": 5 * S, "backwards": -5 * S}.get(self.spoil, 0)
        if shift:
            stamped = header(stamp_of(message) + shift, message.header.frame_id)
            message = dataclasses.replace(message, header=stamped)
        elif self.spoil == "no numbers":
            pose = message.pose.pose
            position = dataclasses.replace(pose.position, x=math.nan)
            pose = dataclasses.replace(
                message.pose, pose=dataclasses.replace(pose, position=position)
            )
            message = dataclasses.replace(message, pose=pose)
        if self.spoil == "silent" or (self.spoil == "some lost" and self._count % 3):
            return
        self._out.publish(message)
        if self.spoil == "twice":
            self._out.publish(message)


class Flight:
    """A UAV in flight; each test restores that state."""

    def __init__(self, folder: str) -> None:
        self.simulation = Simulation(search(1, "relayed/odom", folder))
        self.relay = Relay(self.simulation)
        self.status: list[dict[str, Any]] = []
        self.simulation.graph.subscribe(
            "/uav1/planning/status", lambda p: self.status.append(json.loads(p.message.data))
        )
        self.simulation.run(IN_FLIGHT_S)
        assert self.status[-1]["state"] == "flying"
        self._kept = self.simulation.snapshot()

    def begin(self) -> None:
        self.relay.spoil = "nothing"
        self.simulation.restore(self._kept)
        self.status.clear()

    def distance_m(self, seconds: float) -> float:
        """How far it comes in some time."""
        uav, before = self.simulation.uavs["uav1"], self.simulation.uavs["uav1"].position_map
        self.simulation.run(seconds)
        return float(np.linalg.norm(uav.position_map - before))

    def goes_on(self) -> None:
        """All is well again."""
        assert self.distance_m(5.0) > 1.5
        assert self.status[-1]["state"] in ("flying", "turning")
        assert self.status[-1]["problems"] == []
        assert not [e for e in self.simulation.diagnostics.events if e.kind in CONTACTS]


@pytest.fixture(name="folder", scope="module")
def _folder(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return tmp_path_factory.mktemp("maps")


@pytest.fixture(name="flown", scope="module")
def _flown(folder: Any) -> Any:
    flight = Flight(str(folder))
    yield flight
    flight.simulation.close()


@pytest.fixture(name="flight")
def _flight(flown: Flight) -> Flight:
    flown.begin()
    return flown


@pytest.mark.parametrize(
    ("sensor", "effect", "problem"),
    [
        ("horizontal", "dropped", "the level LIDAR is silent"),
        pytest.param(
            "horizontal", "stuck", "the level LIDAR repeats itself", marks=pytest.mark.slow
        ),
        ("nodding", "stuck", "the nodding LIDAR repeats itself"),
    ],
)
def test_it_stops_while_a_sensor_fails(
    flight: Flight, sensor: str, effect: str, problem: str
) -> None:
    """From a moderate speed: scans that repeat while it brakes hard mislead the SLAM's velocity."""
    uav = flight.simulation.uavs["uav1"]
    flight.simulation.run_until(
        lambda: float(np.linalg.norm(uav.velocity_map)) < MODERATE_M_S, timeout_s=20.0
    )
    now = flight.simulation.time_s
    fault = {"kind": "sensor", "uav": "uav1", "sensor": sensor, "effect": effect}
    flight.simulation.faults.inject({**fault, "at_s": now, "until_s": now + FAULT_S})
    flight.simulation.run(FAULT_S - 0.5)
    assert flight.status[-1]["state"] == "holding"
    assert problem in flight.status[-1]["problems"]
    assert flight.distance_m(0.5) < 0.2
    flight.goes_on()


@pytest.mark.parametrize(
    "spoil",
    [
        "forwards",
        pytest.param("backwards", marks=pytest.mark.slow),
        "no numbers",
        pytest.param("silent", marks=pytest.mark.slow),
        "stuck",
    ],
)
def test_it_stops_while_its_odometry_is_wrong(flight: Flight, spoil: str) -> None:
    flight.relay.spoil = spoil
    flight.simulation.run(FAULT_S - 0.5)
    assert flight.status[-1]["state"] == "holding"
    assert "no odometry" in flight.status[-1]["problems"]
    assert flight.distance_m(0.5) < 0.2
    flight.relay.spoil = "nothing"
    flight.goes_on()


def test_without_its_sonar_it_says_so_and_keeps_its_height(flight: Flight) -> None:
    now = flight.simulation.time_s
    fault = {"kind": "sensor", "uav": "uav1", "sensor": "range", "effect": "stuck"}
    flight.simulation.faults.inject({**fault, "at_s": now, "until_s": now + 12.0})
    heights = []
    for _ in range(10):
        assert flight.distance_m(1.0) > 0.1
        x, y, z = flight.simulation.uavs["uav1"].position_map
        heights.append(z - float(flight.simulation.world.terrain.height(x, y)))
    assert flight.status[-1]["problems"] == ["the sonar repeats itself"]
    assert min(heights) > 1.5
    assert max(heights) < 4.5
    flight.simulation.run(3.0)
    flight.goes_on()


@pytest.mark.slow
def test_a_kidnapped_uav_holds_relocalizes_and_flies_on(flight: Flight) -> None:
    simulation, statuses, poses = flight.simulation, [], []
    simulation.graph.subscribe("/uav1/slam/status", lambda p: statuses.append(p.message.data))
    simulation.graph.subscribe("/uav1/slam/pose", lambda p: poses.append(p.message))
    simulation.faults.inject({"kind": "displacement", "uav": "uav1", "offset_m": [0.0, 3.0, 0.0]})
    simulation.run(20.0)
    states = [json.loads(text)["state"] for text in statuses]
    assert "lost" in states
    assert states[-1] == "tracking"
    assert json.loads(statuses[-1])["closures"] >= 1
    position = poses[-1].pose.pose.position
    found = np.array([position.x, position.y, position.z]) - simulation.uavs["uav1"].position_map
    assert np.abs(found).max() < 0.5
    flight.goes_on()


@pytest.mark.parametrize("spoil", [pytest.param("twice", marks=pytest.mark.slow), "some lost"])
def test_messages_twice_or_lost_do_not_matter(flight: Flight, spoil: str) -> None:
    flight.relay.spoil = spoil
    flight.goes_on()
    assert all(not status["problems"] for status in flight.status)


def test_a_map_of_other_cells_is_refused_in_flight(flight: Flight, folder: Any) -> None:
    cells = encode_cells(np.arange(8, dtype=np.int64), np.ones(8, np.bool_))
    write_map(folder / "fine.bt", cells, 0.1)
    request = message_type("volery_interfaces/srv/ByName_Request")
    response = flight.simulation.graph.call("/uav1/mapping/load", request("fine.bt"))
    assert not response.success
    assert "cells are 0.1 m wide" in response.message
    flight.goes_on()


def test_a_uav_whose_messages_are_lost_is_named_until_they_return(simulate_search: Any) -> None:
    simulation, problems = simulate_search
    simulation.faults.inject({"kind": "radio", "uav": "uav2", "at_s": 8.0, "until_s": 16.0})
    simulation.run(7.5)
    assert problems == {"uav1": "", "uav2": ""}
    simulation.run(7.5)
    assert problems == {"uav1": "silent: uav2", "uav2": "silent: uav1"}
    simulation.run(2.0)
    assert problems == {"uav1": "", "uav2": ""}
    assert not [e for e in simulation.diagnostics.events if e.kind in CONTACTS]


@pytest.fixture(name="simulate_search")
def _simulate_search() -> Any:
    """Two UAVs, and what each says is wrong."""
    with Simulation(search(2)) as simulation:
        problems: dict[str, str] = {}
        for name in simulation.uavs:

            def on_mission(published: Any, name: str = name) -> None:
                problems[name] = published.message.problem

            simulation.graph.subscribe(f"/{name}/mission", on_mission)
        yield simulation, problems
