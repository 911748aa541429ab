"""Policies in the full simulation: by their node, with estimator, noise and latency."""

from dataclasses import replace

import pytest
from policy_making import chasing_policy

from volery.autonomy.policy.policy_file import write_policy
from volery.core.errors import ScenarioError
from volery.learning.tasks import load_task
from volery.learning.transfer import fly_transfer, transfer_scenario


@pytest.fixture(scope="module")
def policy(tmp_path_factory):
    path = tmp_path_factory.mktemp("policy") / "chasing.npz"
    write_policy(path, chasing_policy())
    return path


def test_episodes_end_as_those_of_the_task(policy):
    outcomes = []
    result = fly_transfer(
        policy, load_task("homing"), episodes=2, on_episode=lambda *news: outcomes.append(news)
    )
    assert result.ends == {"arrived": 2}
    assert result.success == 1.0
    assert outcomes == [(1, True), (2, True)]


def test_the_policy_sees_an_estimate_late(policy):
    kind = next(iter(transfer_scenario(load_task("homing"), policy).types.values()))
    assert {sensor.kind for sensor in kind.sensors} == {
        *("imu", "gnss", "barometer", "magnetometer", "estimate")
    }
    (node,) = kind.nodes
    assert (node.node, node.latency_s) == ("policy", 0.02)


def test_teams_are_refused(policy):
    with pytest.raises(ScenarioError, match="one UAV"):
        fly_transfer(policy, replace(load_task("homing"), num_agents=2))


def test_tags_lie_in_the_full_simulation_and_a_node_detects_them():
    scenario = transfer_scenario(load_task("servoing"), "servoing")
    (tag,) = scenario.world.actors
    kind = next(iter(scenario.types.values()))
    (camera,) = [sensor for sensor in kind.sensors if sensor.kind == "camera"]
    assert [node.node for node in kind.nodes] == ["tag_detection", "policy"]
    assert kind.nodes[0].parameters["size_m"] == tag.tag.size_m
    assert (camera.width, camera.rpy_deg) == (320, (0.0, 90.0, 0.0))


@pytest.mark.slow
def test_the_servoing_policy_lands_in_the_full_simulation():
    pytest.importorskip("cv2")
    result = fly_transfer("servoing", load_task("servoing"), episodes=2)
    assert result.ends == {"landed": 2}
