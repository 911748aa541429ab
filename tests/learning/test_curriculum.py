"""Levels of a task rise with the success of each environment."""

from dataclasses import replace

import numpy as np
import pytest

from volery.core.errors import ScenarioError
from volery.learning.curriculum import Curriculum, Levels
from volery.learning.episodes import Episodes
from volery.learning.task import Termination
from volery.learning.tasks import load_task

EASY = Curriculum(({"radius_m": 1.0}, {"radius_m": 2.0}, {}), threshold=0.6, episodes=3)
PARAMETERS = {"radius_m": 5.0, "speed_m_s": 2.0}


def test_a_level_rises_after_enough_success_of_its_own_episodes():
    levels = Levels(EASY, PARAMETERS, 2)
    one, other = np.array([0]), np.array([1])

    def play(envs, results):
        for result in results:
            levels.record(envs, np.array([result]))
            levels.begin(envs)
        return levels.values["radius_m"].tolist()

    assert play(one, [True, True]) == [1.0, 1.0]
    assert play(one, [False]) == [2.0, 1.0]
    assert play(one, [True, False]) == [2.0, 1.0]
    assert play(one, [False, True, True]) == [5.0, 1.0]
    assert play(one, [True] * 5) == [5.0, 1.0]
    assert play(other, [False] * 9) == [5.0, 1.0]
    assert levels.values["speed_m_s"].tolist() == [2.0, 2.0]
    kept = levels.get_state()
    play(other, [True] * 3)
    levels.set_state(kept)
    assert levels.level.tolist() == [2, 0]
    assert play(other, [True, True]) == [5.0, 2.0]


def test_without_a_curriculum_the_parameters_are_those_of_the_task():
    levels = Levels(None, PARAMETERS, 3)
    levels.record(np.arange(3), np.ones(3, np.bool_))
    levels.begin(np.arange(3))
    assert levels.values["radius_m"].tolist() == [5.0] * 3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Curriculum(()), "at least one level"),
        (lambda: Curriculum(({},), threshold=0.0), "threshold = 0"),
        (lambda: Curriculum(({},), episodes=0), "episodes = 0"),
        (lambda: Levels(Curriculum(({"wind": 1.0},)), PARAMETERS, 1), "no parameter 'wind'; known"),
    ],
)
def test_impossible_curricula_are_refused(make, message):
    with pytest.raises(ScenarioError, match=message):
        make()


def test_each_episode_counts_once_and_changes_the_next_one():
    begun = []

    def begin(flight, envs):
        begun.append(flight.parameters["radius_m"][envs].tolist())
        return task.begin(flight, envs)

    task = load_task("homing")
    soon = Termination("soon", lambda flight: flight.decisions >= 2, is_success=True)
    episodes = Episodes(
        replace(task, begin=begin, terminations=(soon,), parameters=PARAMETERS, curriculum=EASY),
        2,
        threads=1,
    )
    everyone = np.arange(2)
    episodes.begin(everyone)
    for _ in range(3):
        for _ in range(4):
            episodes.decide(np.zeros((2, 1, 1)))
        episodes.begin(everyone)
    assert begun == [[1.0] * 2, [1.0] * 2, [1.0] * 2, [2.0] * 2]
    episodes.close()
