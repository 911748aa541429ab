"""Evaluations count each episode once, on seeds of their own."""

import numpy as np
import pytest

from volery.learning.tasks import load_task
from volery.learning.training.evaluation import (
    TEST_SEEDS,
    VALIDATION_SEEDS,
    Evaluator,
    evaluate_actions,
    wilson_interval,
)


def hover(observation):
    return np.zeros(len(observation), np.int64)


def towards_the_goal(observation):
    """Fly along the axis on which the goal is farthest."""
    goal = observation[:, :3]
    axis = np.abs(goal).argmax(axis=1)
    is_negative = goal[np.arange(len(goal)), axis] < 0
    return 1 + 2 * axis + is_negative


@pytest.mark.parametrize(
    ("fraction", "count", "low", "high"),
    [  # Brown, Cai and DasGupta 2001, and by hand
        (0.5, 10, 0.2366, 0.7634),
        (0.0, 10, 0.0, 0.2775),
        (1.0, 200, 0.9812, 1.0),
    ],
)
def test_wilson_interval(fraction, count, low, high):
    assert wilson_interval(fraction, count) == pytest.approx((low, high), abs=1e-4)


def test_hovering_never_arrives():
    found = evaluate_actions(load_task("homing"), hover, 5, threads=1)
    assert found.episodes == 5
    assert found.success <= 0.2
    assert found.mean_length_s == pytest.approx(15.0, abs=3.0)
    assert sum(found.ends.values()) == pytest.approx(1.0)
    assert sum(found.reward_terms.values()) == pytest.approx(found.mean_return, abs=6.0)
    assert found.success_low <= found.success <= found.success_high


def test_flying_to_the_goal_arrives():
    found = evaluate_actions(load_task("homing"), towards_the_goal, 6, threads=1)
    assert found.success > 0.6
    assert found.ends["arrived"] == found.success


def test_seed_and_repetition_decide_the_result():
    task = load_task("homing")
    evaluator = Evaluator(task, 4, seed=7, threads=1)
    first, second = (evaluator.run(towards_the_goal) for _ in range(2))
    assert first == second
    evaluator.close()
    other = Evaluator(task, 4, seed=8, threads=1)
    assert other.run(towards_the_goal) != first
    other.close()


def test_each_environment_runs_its_part(monkeypatch):
    monkeypatch.setattr("volery.learning.training.evaluation._MAX_ENVS", 3)
    counts = []
    found = evaluate_actions(
        load_task("homing"), towards_the_goal, 7, threads=1, on_decision=counts.append
    )
    assert found.episodes == counts[-1] == 7
    assert counts == sorted(counts)


def test_seeds_are_apart_from_those_of_training():
    from volery.learning.training.configuration import TrainingConfiguration
    from volery.learning.training.trainer import SEED_SPACING

    limit = next(
        m.lt for m in TrainingConfiguration.model_fields["seed"].metadata if hasattr(m, "lt")
    )
    assert limit * SEED_SPACING <= VALIDATION_SEEDS
    assert VALIDATION_SEEDS + (1 << 30) < TEST_SEEDS
