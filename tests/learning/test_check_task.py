"""The checks of tasks find what they are for."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from volery.learning.conformance import ConformanceError, check_task
from volery.learning.episodes import Episodes
from volery.learning.single_env import TaskEnv
from volery.learning.task import Observation, Reward
from volery.learning.tasks import load_task
from volery.learning.vector_env import TaskVectorEnv


def observing(function):
    """Return homing with another part of the observation."""
    task = load_task("homing")
    part = Observation("own", function, 1, "1", limit=1e6)
    return replace(task, observations=(*task.observations, part))


def zeros(flight):
    return np.zeros((flight.num_envs, 1, 1))


def test_numbers_that_are_no_numbers():
    with pytest.raises(ConformanceError, match="the observation of step 0 is not in its space"):
        check_task(observing(lambda f: zeros(f) + np.nan), checks=("spaces",))


def test_state_outside_of_the_environment():
    counter = itertools.count()
    with pytest.raises(ConformanceError, match=r"task 'homing': .*: observation of step 0"):
        check_task(observing(lambda f: zeros(f) + next(counter)), checks=("seeds",))
    own = itertools.count()
    with pytest.raises(ConformanceError, match="a restored state goes on differently"):
        check_task(observing(lambda f: zeros(f) + next(own)), checks=("states",))


def test_the_same_episode_for_every_seed():
    task = load_task("homing")

    def begin(flight, envs):
        flight.values["goal_map"][envs] = [3.0, 0.0, 10.0]

    with pytest.raises(ConformanceError, match="another seed gives the same episode"):
        check_task(replace(task, begin=begin), checks=("seeds",))


def test_environments_that_depend_on_others():
    with pytest.raises(ConformanceError, match="environment 0 begins unlike one"):
        check_task(observing(lambda f: zeros(f) + f.num_envs), checks=("singles",))


def test_a_single_environment_of_its_own(monkeypatch):
    step = TaskEnv.step
    monkeypatch.setattr(TaskEnv, "step", lambda self, a: (step(self, a)[0] * 2, *step(self, a)[1:]))
    with pytest.raises(ConformanceError, match="the single environment differs in step 1"):
        check_task(load_task("homing"), checks=("singles",))


def test_wrong_automatic_resets(monkeypatch):
    def too_late(self, over, info):
        info.update(_final_obs=over, final_obs=self._seen())
        self._is_over = np.zeros_like(over)

    monkeypatch.setattr(TaskVectorEnv, "_begin_at_once", too_late)
    with pytest.raises(ConformanceError, match="NextStep: wrong first observation"):
        check_task(load_task("homing"), checks=("autoreset",))


def test_rewards_that_no_term_explains(monkeypatch):
    decide = Episodes.decide

    def more(self, action):
        outcome = decide(self, action)
        self.returns += 0.5
        return outcome._replace(reward=outcome.reward + 0.5)

    monkeypatch.setattr(Episodes, "decide", more)
    with pytest.raises(ConformanceError, match="the terms of the reward do not sum"):
        check_task(load_task("homing"), checks=("infos",))


def test_rewards_that_a_term_explains():
    asked, kept = [], np.zeros((3, 1))

    def own(fleet):
        asked.append(fleet)
        return kept + 1.0

    task = load_task("homing")
    try:
        check_task(replace(task, rewards=(Reward("own", own, 1.0),)), checks=("infos",))
    except ConformanceError as error:
        pytest.fail(str(error))
    assert asked


def test_shared_buffers(monkeypatch):
    monkeypatch.setattr(
        TaskVectorEnv, "_seen", lambda self: self._observation.reshape(self.num_envs, -1)
    )
    with pytest.raises(ConformanceError, match="step"):
        check_task(load_task("homing"), checks=("buffers",))


def test_states_that_lack_something(monkeypatch):
    get_state = Episodes.get_state

    def without_goal(self):
        state = get_state(self)
        state["values"] = {}
        return state

    monkeypatch.setattr(Episodes, "get_state", without_goal)
    with pytest.raises(ConformanceError, match="a restored state goes on differently"):
        check_task(load_task("homing"), checks=("states",))
    with pytest.raises(ConformanceError, match="a pickled environment differs"):
        check_task(load_task("homing"), checks=("pickles",))


def test_impossible_actions_that_are_taken(monkeypatch):
    monkeypatch.setattr(TaskVectorEnv, "_checked", lambda self, a: np.zeros((self.num_envs, 1, 1)))
    with pytest.raises(ConformanceError, match="actions: too few rows is not refused"):
        check_task(load_task("homing"), checks=("refusals",))


def made():
    return load_task("hover")


def test_a_task_may_be_given_by_its_function():
    check_task(made, checks=("pickles",))
    with pytest.raises(KeyError):
        check_task(made, checks=("style",))
