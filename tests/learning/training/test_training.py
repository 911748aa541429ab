"""Trainings that are interrupted and resumed equal those that are not, to the byte."""

from dataclasses import replace

import numpy as np
import pytest

from volery.core.errors import VoleryError
from volery.learning.tasks import load_task
from volery.learning.training import train
from volery.learning.training.checkpoint import read_checkpoint
from volery.learning.training.trainer import Trainer


class Stopper:
    """Interrupt a training at a number of steps."""

    def __init__(self, steps):
        self.steps = steps
        self.evaluations = []

    def on_update(self, trainer):
        trainer.is_interrupted = trainer.steps >= self.steps

    def on_evaluation(self, trainer, evaluation):
        self.evaluations.append((trainer.steps, evaluation))

    def close(self):
        self.steps = -1


def trained(task, configuration, path=None, stop=10**9, resume=None):
    """Return the result and the weights and optimizer at the end."""
    monitor = Stopper(stop)
    trainer = Trainer(task, configuration, checkpoint=path, monitors=[monitor])
    try:
        if resume:
            trainer.resume(resume)
        result = trainer.run()
        return result, trainer.algorithm.get_parameters(), monitor
    finally:
        trainer.close()


def assert_equal(one, other):
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            assert_equal(one[key], other[key])
    elif isinstance(one, list | tuple):
        assert len(one) == len(other)
        for pair in zip(one, other, strict=True):
            assert_equal(*pair)
    elif hasattr(one, "detach"):
        assert one.numpy().tobytes() == other.numpy().tobytes()
    else:
        assert one == other


@pytest.mark.parametrize(
    ("name", "algorithm"),
    [
        ("hover", "ppo"),
        ("homing", "dqn"),
        pytest.param("hover", "sac", marks=pytest.mark.slow),
    ],
)
def test_a_resumed_training_equals_one_without_interruption(tmp_path, tiny, name, algorithm):
    task = replace(load_task(name), episode_s=0.8 if name == "hover" else 4.0)
    configuration = tiny(algorithm=algorithm, steps=384, evaluation_period=128)
    whole, weights, _ = trained(task, configuration)
    path = tmp_path / "checkpoint"
    first, before, _ = trained(task, configuration, path, stop=200)
    assert first.ending == "interrupted"
    assert first.steps < whole.steps
    second, after, _ = trained(task, configuration, path, resume=path)
    assert_equal(weights, after)
    with pytest.raises(AssertionError):
        assert_equal(before, after)
    points = [(p.steps, p.success, p.mean_return) for p in whole.curve]
    assert points == [(p.steps, p.success, p.mean_return) for p in second.curve]
    assert_equal(*(dict_of(r.policy.network.arrays) for r in (whole, second)))
    last = read_checkpoint(path)
    assert last.task == name
    assert last.state["algorithm"]["counters"]["num_timesteps"] == whole.steps


def dict_of(arrays):
    return {name: array.tolist() for name, array in arrays.items()}


def test_training_ends_at_the_target(tiny):
    configuration = tiny(algorithm="dqn", steps=640, target_success=0.0)
    result, _, monitor = trained(load_task("homing"), configuration)
    assert result.ending == "target"
    assert result.steps == monitor.evaluations[0][0] == 64
    assert result.policy.description.training.steps == 64


def test_training_ends_at_the_limits(tiny):
    configuration = tiny(algorithm="dqn", steps=100)
    result, _, _ = trained(load_task("homing"), configuration)
    assert (result.ending, result.steps) == ("steps", 100)
    configuration = tiny(algorithm="dqn", steps=10**6, seconds=1e-6)
    result, _, _ = trained(load_task("homing"), configuration)
    assert result.ending == "seconds"
    assert result.steps == 0


def test_the_best_policy_is_kept(tiny):
    task = replace(load_task("homing"), episode_s=4.0)
    configuration = tiny(algorithm="dqn", steps=320)
    result, _, monitor = trained(task, configuration)
    best = max((e.success, e.mean_return) for _, e in monitor.evaluations)
    point = next(p for p in result.curve if (p.success, p.mean_return) == best)
    assert result.success == best[0]
    assert result.policy.description.training.steps == point.steps


def test_a_checkpoint_of_another_training_is_refused(tmp_path, tiny):
    path = tmp_path / "checkpoint"
    trained(load_task("homing"), tiny(algorithm="dqn", steps=8), path)
    for name, options, reason in (
        ("hover", {"algorithm": "ppo"}, "is of task 'homing', not 'hover'"),
        ("homing", {"algorithm": "ppo"}, "is of algorithm 'dqn', not 'ppo'"),
        ("homing", {"algorithm": "dqn", "num_envs": 5}, "is of other environments"),
        ("homing", {"algorithm": "dqn", "hidden": (9,)}, "is of other networks"),
    ):
        with pytest.raises(VoleryError, match=reason) as caught:
            trained(load_task(name), tiny(**options), resume=path)
        assert "\n" not in str(caught.value)


def test_algorithms_that_do_not_fit_the_actions_are_refused(tiny):
    with pytest.raises(VoleryError, match="dqn needs discrete actions"):
        train("hover", configuration=tiny(algorithm="dqn"))
    with pytest.raises(VoleryError, match="sac needs continuous actions"):
        train("homing", configuration=tiny(algorithm="sac"))


def test_values_at_time_limits_are_added_once(tiny):
    """An episode that the time limit ends is worth what its last observation promises."""
    task = replace(load_task("homing"), episode_s=3.0)
    configuration = tiny(algorithm="ppo", steps=4 * 80, gamma=0.5)
    configuration = configuration.changed(ppo={"rollout_steps": 80, "minibatch": 16, "epochs": 1})
    trainer = Trainer(task, configuration)
    seen = []
    step = trainer.env.step_wait

    def record():
        result = step()
        seen.append((result[1].copy(), result[1], trainer.env.last_truncated))
        return result

    trainer.env.step_wait = record
    trainer.run()
    checked = 0
    for before, after, truncated in seen:
        rows = np.flatnonzero(truncated)
        others = np.setdiff1d(np.arange(4), rows)
        np.testing.assert_array_equal(before[others], after[others])
        checked += len(rows)
        assert (before[rows] != after[rows]).all()
    assert checked
    trainer.close()
