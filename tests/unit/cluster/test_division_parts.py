"""How a scenario is divided, and what of it travels to other machines."""

import shutil
from pathlib import Path

import pytest
from divided_pair import scenario_of

from volery.cluster.division.job import DivisionJob, files_of
from volery.cluster.division.partitioning import _groups, _shares, divided
from volery.core.errors import DataFileError, DivisionError, ScenarioError
from volery.graph.nodes.handles import NodeEndpoints
from volery.scenario.load import load_scenario, parse_scenario
from volery.vehicle import airframes

AIRFRAMES = Path(airframes.__path__[0])


def node(publishes=(), subscribes=(), serves=(), calls=()):
    return NodeEndpoints(*map(frozenset, (publishes, subscribes, serves, calls)))


def sizes(scenario, machines):
    return [len(share) for share in divided(scenario, machines)]


def test_uavs_are_divided_evenly_and_in_fleet_order():
    scenario = scenario_of(7)
    assert sizes(scenario, 2) == [4, 3]
    assert sizes(scenario, 3) == [2, 3, 2]
    assert divided(scenario, 2)[1] == {"uav5", "uav6", "uav7"}


def test_uavs_are_divided_by_the_cost_of_their_sensors():
    camera = {"kind": "camera", "name": "wide", "width": 320, "height": 240, "rate_hz": 60.0}
    scenario = scenario_of(9)
    types = scenario.data()["types"]
    heavy = types["weaver"] | {"sensors": [*types["weaver"]["sensors"], camera]}
    rows = [
        {"type": kind, "count": count, "position_m": [0.0, y], "last_position_m": [9.0, y]}
        for kind, count, y in (("weaver", 8, 0.0), ("heavy", 2, 5.0))
    ]
    mixed = scenario.with_(types=types | {"heavy": heavy}, uavs=rows)
    first, second = divided(mixed, 2)
    assert "uav10" in second
    assert len(first) >= 8


def test_shares_have_nearly_the_same_cost():
    assert _shares([1.0] * 8, 2, 0.0, first_is_used=False) == [[0, 1, 2, 3], [4, 5, 6, 7]]
    assert _shares([9.0, 1.0, 1.0], 3, 0.0, first_is_used=False) == [[0], [1], [2]]
    assert _shares([1.0, 1.0, 9.0], 3, 0.0, first_is_used=False) == [[0], [1], [2]]
    assert _shares([2.0, 2.0, 2.0], 2, 5.0, first_is_used=True) == [[], [0, 1, 2]]
    assert _shares([1.0, 5.0, 1.0, 1.0], 2, 0.0, first_is_used=False) == [[0, 1], [2, 3]]


def test_too_few_uavs_are_refused():
    with pytest.raises(DivisionError, match=r"weaving has 2 UAVs .* too few for 2 workers"):
        divided(scenario_of(2), 3)


def test_uavs_whose_nodes_share_a_topic_stay_together():
    nodes = {
        "/a/seer": node(publishes=["/a/map"]),
        "/b/pilot": node(subscribes=["/a/map"]),
        "/c/pilot": node(subscribes=["/c/odom"]),
    }
    assert _groups(["a", "b", "c"], nodes) == ([["a", "b"], ["c"]], [])


def test_uavs_whose_nodes_use_those_of_the_system_are_the_leaders():
    nodes = {
        "/task_manager": node(serves=["/task_manager/join"]),
        "/a/pilot": node(calls=["/task_manager/join"], publishes=["/rosout"]),
        "/b/pilot": node(subscribes=["/rosout"]),
    }
    assert _groups(["a", "b"], nodes) == ([["b"]], ["a"])


def test_a_radio_network_is_refused():
    with pytest.raises(DivisionError, match="forest_search has a radio network"):
        divided(load_scenario("forest_search"), 2)


@pytest.fixture
def own(tmp_path):
    folder = tmp_path / "own"
    (folder / "frames").mkdir(parents=True)
    shutil.copy(AIRFRAMES / "f450.toml", folder / "frames" / "mine.toml")
    text = """
name = "own"
[types.a]
airframe = "frames/mine.toml"
[[uavs]]
type = "a"
position_m = [0.0, 0.0]
"""
    (folder / "own.toml").write_text(text)
    return load_scenario(folder / "own.toml")


def job_of(scenario, **changes):
    content = scenario.model_dump(exclude_unset=True, mode="json")
    parts = {"content": content, "files": files_of(scenario), "uavs": ("uav1",)}
    return DivisionJob(**{**parts, **changes})


def test_files_that_a_scenario_names_travel(own, tmp_path):
    folder = tmp_path / "there"
    folder.mkdir()
    there = job_of(own).scenario(folder, trust=False)
    assert there.model_dump(mode="json") == own.model_dump(mode="json")
    assert there.access.find_file("frames/mine.toml").parent == folder / "frames"


def test_a_worker_reads_no_other_files_for_its_leader(own, tmp_path):
    there = job_of(own, files={}).scenario(tmp_path, trust=False)
    with pytest.raises(DataFileError):
        there.access.find_file("/etc/hostname")


def test_files_outside_of_the_folder_do_not_travel(own, tmp_path):
    (tmp_path / "mine.toml").write_text("")
    outside = parse_scenario(
        {**own.model_dump(exclude_unset=True, mode="json"), "name": "own"}, access=own.access
    )
    content = outside.model_dump(exclude_unset=True, mode="json")
    content["types"]["a"]["airframe"] = "../mine.toml"
    with pytest.raises(DivisionError, match=r"'\.\./mine\.toml' lies outside"):
        files_of(parse_scenario(content, access=own.access))


def test_a_leader_writes_only_into_the_workers_folder(own, tmp_path):
    for name in ("../evil.toml", "/evil.toml", "a/../../evil.toml"):
        with pytest.raises(DivisionError, match="lies outside of its folder"):
            job_of(own, files={name: b""}).scenario(tmp_path, trust=False)


def test_a_broken_scenario_is_named(own, tmp_path):
    with pytest.raises(ScenarioError, match="the leader's scenario 'own'"):
        job_of(own, content={"name": "own", "uavs": 3}).scenario(tmp_path, trust=False)
