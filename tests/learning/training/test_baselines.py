"""Shipped policies of single UAVs in open air do what the documentation says."""

from dataclasses import replace

import pytest

from volery.autonomy.policy.shipped_policies import load_policy
from volery.learning.tasks import load_task
from volery.learning.training import evaluate
from volery.learning.training.configuration import load_configuration


@pytest.mark.parametrize(("name", "min_success"), [("hover", 0.95), ("homing", 0.95)])
def test_a_baseline_succeeds_on_unseen_seeds(name, min_success):
    assert evaluate(name, episodes=60, seed=10_000, threads=1).success >= min_success


@pytest.mark.slow
@pytest.mark.parametrize(("name", "min_success"), [("tracking", 0.95), ("gates", 0.9)])
def test_a_longer_baseline_succeeds_on_unseen_seeds(name, min_success):
    assert evaluate(name, episodes=30, seed=20_000, threads=1).success >= min_success


@pytest.mark.slow
def test_the_baseline_of_late_hover_survives_20_ms_and_that_of_hover_does_not():
    late = {"action_latency_s": 0.02}
    task = replace(load_task("late_hover"), **late)
    assert evaluate("late_hover", task=task, episodes=30, seed=5, threads=1).success >= 0.95
    task = replace(load_task("hover"), **late)
    assert evaluate("hover", task=task, episodes=30, seed=5, threads=1).success <= 0.2


@pytest.mark.parametrize("name", ["hover", "late_hover", "homing", "tracking", "gates"])
def test_a_baseline_is_made_by_the_shipped_configuration(name):
    description, configuration = load_policy(name).description, load_configuration(name)
    assert description.training.algorithm == configuration.algorithm
    assert description.network.activation == configuration.activation
    assert description.training.success >= configuration.target_success
