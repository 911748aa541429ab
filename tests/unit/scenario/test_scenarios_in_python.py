"""Scenarios from classes: the same checks as for files, and errors with the key."""

import numpy as np
import pytest

from volery import ScenarioError
from volery.graph.nodes.node import Node
from volery.scenario import (
    FlatTerrain,
    ImuSensor,
    LidarSensor,
    MotorFault,
    Nodding,
    NodeEntry,
    ProceduralForest,
    Scenario,
    UavGroup,
    UavType,
    WaypointActor,
    Wind,
    World,
    at_positions,
    circle,
    grid,
    parse_scenario,
)
from volery.scenario.access import ScenarioAccess

SCOUT = UavType(sensors=(LidarSensor(nodding=Nodding(period_s=1.0)), ImuSensor(rate_hz=100.0)))
GROUP = UavGroup(type="scout", position_m=(1.0, 2.0))


class Idle(Node):
    """A node at the top level of a module."""


def small(**keys):
    return Scenario(**{"name": "small", "types": {"scout": SCOUT}, "uavs": [GROUP], **keys})


def test_classes_and_tables_make_equal_scenarios():
    forest = ProceduralForest(region_m=(0, 0, 9, 9), trees=3, species={"palm": 1.0})
    made = small(
        world=World(terrain=FlatTerrain(extent_m=50.0), forest=forest),
        faults=[MotorFault(uav="uav1", rotor=2, at_s=3.0)],
        nodes=[NodeEntry(node="coverage", latency_s=0.1)],
    )
    table = {
        "name": "small",
        "world": {
            "terrain": {"kind": "flat", "extent_m": 50.0},
            "forest": {
                "kind": "procedural",
                "region_m": [0, 0, 9, 9],
                "trees": 3,
                "species": {"palm": 1.0},
            },
        },
        "types": {
            "scout": {
                "sensors": [
                    {"kind": "lidar", "nodding": {"period_s": 1.0}},
                    {"kind": "imu", "rate_hz": 100.0},
                ]
            }
        },
        "uavs": [{"type": "scout", "position_m": [1.0, 2.0]}],
        "faults": [{"kind": "motor", "uav": "uav1", "rotor": 2, "at_s": 3.0}],
        "nodes": [{"node": "coverage", "latency_s": 0.1}],
    }
    read = parse_scenario(table)
    assert made == read
    assert made.data() == read.data()
    assert parse_scenario(made.data()) == made


def test_equal_scenarios_have_equal_values_and_hashes():
    read = parse_scenario(small().data(), access=ScenarioAccess(is_confined=True))
    assert (read == small(), read.access == small().access) == (True, False)
    assert len({read, small()}) == 1
    assert read != small(seed=2)
    assert read != read.data()


def test_a_class_can_be_a_node():
    assert NodeEntry(node=Idle).node == f"{__name__}:Idle"

    class Local(Node):
        pass

    with pytest.raises(ScenarioError, match=r"key 'node': class .*Local is inside a function"):
        NodeEntry(node=Local)


def test_arrays_may_stand_for_lists():
    wind = Wind(velocity_m_s=np.array([1.0, 2.0, 0.0], dtype=np.float32))
    assert wind == Wind(velocity_m_s=(1.0, 2.0, 0.0))
    route = np.array([[0.0, 1.0], [2.0, 3.0]])
    assert WaypointActor(waypoints_m=route, speed_m_s=np.float64(1.0)).waypoints_m[1] == (2.0, 3.0)
    assert NodeEntry(node="slam", parameters={"route": route}).parameters["route"][0] == [0.0, 1.0]
    assert UavGroup(type="a", count=np.int64(1), position_m=route[0]).position_m == (0.0, 1.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: LidarSensor(nam="a"), r"^LidarSensor: unknown key 'nam'; did you mean 'name'\?"),
        (lambda: ImuSensor(rate_hz=-1), r"^ImuSensor: key 'rate_hz': .*above 0 .*found -1"),
        (lambda: World(wind={"turbulence": "mild"}), r"^World: key 'wind\.turbulence': .*'light'"),
        (lambda: Wind(velocity_m_s=(99.0, 0, 0)), r"^Wind: velocity_m_s components must lie"),
        (lambda: UavGroup(position_m=(0, 0)), r"^UavGroup: key 'type' is missing"),
        (lambda: small(uavs=[]), r"^Scenario: key 'uavs'"),
        (lambda: small(types={"other": SCOUT}), r"'scout' is not defined; known: other"),
        (lambda: LidarSensor(position_m=(9e3, 0, 0)), r"key 'position_m': .* given in mm\?"),
        (lambda: LidarSensor(kind="imu"), r"^LidarSensor: key 'kind'"),
    ],
)
def test_invalid_values_are_refused_with_the_key(make, message):
    with pytest.raises(ScenarioError, match=message):
        make()


# ------------------------------------------------------------------------------------- formations


def test_a_circle():
    groups = circle("scout", 4, radius_m=2.0, centre_m=(10.0, 0.0, 5.0), heading="in")
    assert [g.position_m for g in groups] == [(12, 0, 5), (10, 2, 5), (8, 0, 5), (10, -2, 5)]
    assert [abs(g.yaw_deg) for g in groups] == [180.0, 90.0, 0.0, 90.0]
    assert [g.yaw_deg for g in circle("scout", 4, radius_m=2.0)] == [0.0, 90.0, -180.0, -90.0]
    along = circle("scout", 2, radius_m=1.0, heading="along", on_start="wait")
    assert [(g.yaw_deg, g.on_start) for g in along] == [(90.0, "wait"), (-90.0, "wait")]


def test_a_grid():
    groups = grid("scout", 2, 3, spacing_m=1.5, corner_m=(1.0, 1.0))
    assert [g.position_m for g in groups[:4]] == [(1.0, 1.0), (2.5, 1.0), (4.0, 1.0), (1.0, 2.5)]
    assert small(uavs=groups).uav_count == 6


def test_positions_and_headings():
    groups = at_positions("scout", np.arange(6.0).reshape(2, 3), yaw_deg=[10.0, 20.0])
    assert [g.position_m for g in groups] == [(0.0, 1.0, 2.0), (3.0, 4.0, 5.0)]
    assert [g.yaw_deg for g in groups] == [10.0, 20.0]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: at_positions("a", [1.0, 2.0]), r"shape \(N, 2\) or \(N, 3\), not \(2,\)"),
        (lambda: at_positions("a", [["x", "y"]]), "positions are numbers"),
        (lambda: at_positions("a", np.zeros((3, 2)), yaw_deg=[1, 2]), r"give one number or 3"),
        (lambda: circle("a", 0, radius_m=1.0), "at least 1 UAV"),
        (lambda: circle("a", 1, radius_m=1.0, centre_m=(0,)), r"shape \(N, 2\)"),
        (lambda: grid("a", 0, 1, spacing_m=1.0), "a grid needs rows and columns"),
    ],
)
def test_impossible_formations_are_refused(make, message):
    with pytest.raises(ScenarioError, match=message):
        make()
