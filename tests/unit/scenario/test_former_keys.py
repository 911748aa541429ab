"""Scenario keys that recorded logs still hold are read, with a warning; today's keys win."""

from __future__ import annotations

import pytest

from volery.core.errors import ScenarioError
from volery.scenario.load import parse_scenario

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
