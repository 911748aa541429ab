"""Every task keeps the rules of Gymnasium, and each environment equals a single one."""

import itertools
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from volery.core.errors import CommandError, ScenarioError
from volery.learning.conformance import ConformanceError, check_task
from volery.learning.registration import register_tasks
from volery.learning.single_env import TaskEnv
from volery.learning.tasks import TASKS, load_task
from volery.learning.vector_env import TaskVectorEnv
from volery.runtime.environment_start import EnvironmentStart

pytestmark = pytest.mark.filterwarnings("error")
every_task = pytest.mark.parametrize("name", TASKS)
tasks_of_one_uav = pytest.mark.parametrize(
    "name", [name for name in TASKS if load_task(name).num_agents == 1]
)
small_tasks = pytest.mark.parametrize("name", ["hover", "homing"])


@pytest.fixture
def make():
    """Make vector environments that are closed at the end of the test."""
    made = []

    def build(name, count=3, **options):
        made.append(TaskVectorEnv(load_task(name), count, **options))
        return made[-1]

    yield build
    for env in made:
        env.close()


def play(env, decisions, seed=5):
    """Returns what random actions bring: observations, rewards, ends and infos."""
    env.action_space.seed(seed)
    observation, _ = env.reset(seed=seed)
    steps = [(observation, None, None, None, {})]
    for _ in range(decisions):
        steps.append(env.step(env.action_space.sample()))
    return steps


def in_few_worlds(name):
    """A task in two of its worlds, which are built in no time."""
    task = load_task(name)
    return replace(task, worlds=task.worlds[:2]).made_by(in_few_worlds, name)


@every_task
def test_every_task_keeps_the_rules(name):
    try:
        check_task(in_few_worlds(name))
    except ConformanceError as error:
        pytest.fail(str(error))


@tasks_of_one_uav
def test_gymnasium_finds_nothing_wrong(name):
    register_tasks()
    env = gymnasium.make(f"volery/{name.title().replace('_', '')}-v0")
    check_env(env.unwrapped)
    env.close()


@every_task
def test_make_vec_gives_the_native_environment(name):
    register_tasks()
    env = gymnasium.make_vec(f"volery/{name.title().replace('_', '')}-v0", num_envs=2)
    assert isinstance(env.unwrapped, TaskVectorEnv)
    assert env.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    env.close()


@small_tasks
def test_each_environment_equals_a_single_one(make, name):
    decisions, seed = 150, 5
    steps = play(make(name), decisions, seed)
    actions = gymnasium.vector.utils.batch_space(TaskEnv(load_task(name)).action_space, 3)
    actions.seed(seed)
    taken = [actions.sample() for _ in range(decisions)]
    ended = 0
    for k in range(3):
        single = TaskEnv(load_task(name))
        observation, _ = single.reset(seed=seed + k)
        np.testing.assert_array_equal(observation, steps[0][0][k])
        for i, (seen, reward, terminated, truncated, info) in enumerate(steps[1:]):
            own = single.step(taken[i][k])
            assert own[1:4] == (reward[k], terminated[k], truncated[k])
            observation = own[0]
            if terminated[k] or truncated[k]:
                np.testing.assert_array_equal(observation, info["final_obs"][k])
                assert own[4]["success"] == info["success"][k]
                observation, _ = single.reset()
                ended += 1
            np.testing.assert_array_equal(observation, seen[k])
        single.close()
    assert ended


@small_tasks
def test_the_step_after_the_end_resets_in_next_step_mode(make, name):
    env, same = make(name, autoreset_mode="NextStep"), make(name)
    steps, others = play(env, 150), play(same, 150)
    resets = 0
    for before, after in itertools.pairwise(steps[1:]):
        over = before[2] | before[3]
        assert (after[1][over] == 0.0).all()
        assert not (after[2] | after[3])[over].any()
        resets += over.sum()
    assert resets
    first = next(i for i, step in enumerate(others[1:], 1) if (step[2] | step[3]).any())
    over = others[first][2] | others[first][3]
    np.testing.assert_array_equal(steps[first][0][over], others[first][4]["final_obs"][over])
    np.testing.assert_array_equal(steps[first + 1][0][over], others[first][0][over])


@small_tasks
def test_without_autoreset_a_mask_resets(make, name):
    env = make(name, autoreset_mode="Disabled")
    env.reset(seed=1)
    over = np.zeros(3, np.bool_)
    while not over.any():
        observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
        over = terminated | truncated
    with pytest.raises(CommandError, match="have ended; reset them"):
        env.step(env.action_space.sample())
    again, _ = env.reset(options={"reset_mask": over})
    np.testing.assert_array_equal(again[~over], observation[~over])
    assert (again[over] != observation[over]).any()
    env.step(env.action_space.sample())


@small_tasks
def test_reward_terms_and_ends_sum_to_the_return(make, name):
    task = load_task(name)
    ends = {0.0} | {end.reward for end in task.terminations}
    seen = 0
    for *_, info in play(make(name), 200)[1:]:
        for k in np.flatnonzero(info.get("_end", np.zeros(3))):
            terms = sum(sums[k] for sums in info["reward_terms"].values())
            extra = info["episode_return"][k] - terms
            assert min(abs(extra - end) for end in ends) < 1e-6
            assert 1 <= info["episode_length"][k] <= task.episode_decisions
            seen += 1
    assert seen


def test_impossible_actions_are_refused(make):
    env = make("hover")
    with pytest.raises(CommandError, match=r"call reset\(\) before the first step"):
        env.step(env.action_space.sample())
    env.reset(seed=0)
    for seed in (-1, "x"):
        with pytest.raises(CommandError, match="a whole number from 0 on, up to"):
            env.reset(seed=seed)
    with pytest.raises(CommandError, match=r"actions have shape \(3, 4\), not \(2, 4\)"):
        env.step(np.zeros((2, 4)))
    with pytest.raises(CommandError, match=r"action \[1, 2\] is nan; actions must be finite"):
        env.step(np.where(np.arange(12).reshape(3, 4) == 6, np.nan, 0.0))
    with pytest.raises(CommandError, match="numbers"):
        env.step([["up"] * 4] * 3)
    with pytest.raises(CommandError, match="2 seeds for 3 environments"):
        env.reset(seed=[1, 2])
    with pytest.raises(CommandError, match="reset_mask: 3 booleans"):
        env.reset(options={"reset_mask": [True]})
    homing = make("homing")
    homing.reset(seed=0)
    with pytest.raises(CommandError, match="whole numbers from 0 to 6"):
        homing.step(np.array([0, 7, 1]))
    with pytest.raises(ScenarioError, match="unknown task 'fly'; known: hover"):
        load_task("fly")


def test_closed_environments_say_so():
    env = TaskVectorEnv(load_task("homing"), 2)
    env.reset(seed=0)
    env.close()
    for use in (env.reset, lambda: env.step([0, 0])):
        with pytest.raises(CommandError, match="the environments are closed; make new ones"):
            use()


def test_the_zero_action_keeps_a_level_uav_at_its_height(make):
    env = make("hover")
    env.reset(seed=0)
    fleet = env.episodes.envs
    fleet.reset(start=EnvironmentStart([0.0, 0.0, 10.0]))
    env.episodes.flight.refresh()
    for _ in range(50):
        env.step(np.zeros((3, 4)))
    np.testing.assert_allclose(fleet.state().position_map[:, 0], [[0.0, 0.0, 10.0]] * 3, atol=0.02)


def test_actions_are_delayed(make):
    late = TaskVectorEnv(replace(load_task("homing"), action_latency_s=0.4), 1)
    late.reset(seed=0)
    positions = []
    for _ in range(4):
        late.step(np.array([1]))
        positions.append(late.episodes.flight.state.velocity_map[0, 0, 0])
    assert abs(positions[1]) < 0.05 < positions[3]
    late.close()
