"""Scenario keys that recorded logs still hold are read, with a warning; today's keys win."""

from __future__ import annotations

import importlib
import inspect
import re

import pytest

from volery.core.errors import ScenarioError
from volery.scenario.city import Streets
from volery.scenario.former_parameters import all_former_parameters
from volery.scenario.load import parse_scenario
from volery.scenario.node_names import node_path
from volery.scenario.schema import NodeEntry

CAR = {"name": "van", "shape": "car", "motion": {"kind": "outside", "position_m": [30.0, 0.0]}}
ESTIMATE = {"kind": "estimate", "flies": False, "pose": {"topic": "slam/odom"}}
IMU = {"kind": "imu"}


def test_actors_were_things(flat_data):
    flat_data["world"] = {"things": [CAR]}
    with pytest.warns(DeprecationWarning, match="'actors'|'external'"):
        (actor,) = parse_scenario(flat_data).world.actors
    assert (actor.name, actor.motion.kind) == ("van", "external")


def test_an_estimate_had_other_keys(flat_data):
    (name,) = flat_data["types"]
    flat_data["types"][name]["sensors"] = [IMU, ESTIMATE]
    with pytest.warns(DeprecationWarning, match="'used_for_control'|'external_odometry'"):
        scenario = parse_scenario(flat_data)
    estimate = scenario.types[name].sensors[-1]
    assert not estimate.used_for_control
    assert estimate.external_odometry.topic == "slam/odom"


def test_a_key_and_its_former_name_are_refused(flat_data):
    flat_data["world"] = {"things": [], "actors": []}
    with (
        pytest.warns(DeprecationWarning, match="named"),
        pytest.raises(ScenarioError, match="keys 'things' and 'actors' are the same"),
    ):
        parse_scenario(flat_data)


def test_a_scenario_is_written_with_the_new_keys(flat_data):
    flat_data["world"] = {"things": [CAR]}
    with pytest.warns(DeprecationWarning, match="named"):
        scenario = parse_scenario(flat_data)
    data = scenario.model_dump(exclude_unset=True)
    assert "things" not in data["world"]
    assert parse_scenario(data).world.actors == scenario.world.actors


@pytest.mark.parametrize(
    ("old", "new"), [("widest_m", "max_width_m"), ("tree_share", "tree_fraction")]
)
def test_streets_had_other_keys(old, new):
    value = getattr(Streets(), new)
    with pytest.warns(DeprecationWarning, match=f"key '{old}' .* '{new}'"):
        assert Streets.model_validate({old: value}) == Streets()


@pytest.mark.parametrize(
    ("node", "old", "new"),
    [
        (node, *names)
        for node, former in all_former_parameters().items()
        for names in former.items()
    ],
)
def test_nodes_had_other_parameters(node, old, new):
    with pytest.warns(DeprecationWarning, match=f"{node}: parameter '{old}' .* '{new}'"):
        entry = NodeEntry(node=node, parameters={old: 1.5})
    assert entry.parameters == {new: 1.5}
    module, name = node_path(node).split(":")
    declared = inspect.getdoc(getattr(importlib.import_module(module), name))
    assert re.search(rf"\b{new}\b", declared)


def test_parameters_of_a_node_with_its_former_path_are_renamed():
    path = "volery.autonomy.task_manager:TaskManager"
    with pytest.warns(DeprecationWarning, match="'timeout_s'"):
        entry = NodeEntry(node=path, parameters={"patience_s": 3.0, "odometry": "odom"})
    assert entry.parameters == {"timeout_s": 3.0, "odometry": "odom"}


def test_a_parameter_and_its_former_name_are_refused(flat_data):
    flat_data["nodes"] = [
        {"node": "coverage", "parameters": {"over_m": 1.0, "crossing_height_m": 1}}
    ]
    with (
        pytest.warns(DeprecationWarning, match="named"),
        pytest.raises(ScenarioError, match="parameters 'over_m' and 'crossing_height_m' are"),
    ):
        parse_scenario(flat_data)


def test_parameters_of_other_nodes_keep_their_names():
    parameters = {"patience_s": 3.0}
    assert NodeEntry(node="my_package.nodes:Mine", parameters=parameters).parameters == parameters
