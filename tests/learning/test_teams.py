"""Tasks of teams: rows of vector environments, PettingZoo's interface, and what ends episodes."""

import re
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from volery.core.errors import CommandError, ScenarioError
from volery.learning.episodes import Episodes
from volery.learning.reference_policies import formation_field, straight_chase
from volery.learning.registration import register_tasks
from volery.learning.single_env import TaskEnv
from volery.learning.tasks import TASKS, load_task
from volery.learning.tasks.pursuit import EVADER
from volery.learning.terms.posts import BEFORE, POSTS, clearance
from volery.learning.vector_env import TaskVectorEnv
from volery.runtime.environment_start import EnvironmentStart

pytestmark = pytest.mark.filterwarnings("error")
TEAMS = [name for name in TASKS if load_task(name).num_agents > 1]
every_team = pytest.mark.parametrize("name", TEAMS)


@pytest.fixture
def make():
    """Make vector environments that are closed at the end of the test."""
    made = []

    def build(task, count=2, **options):
        task = load_task(task) if isinstance(task, str) else task
        made.append(TaskVectorEnv(task, count, threads=1, **options))
        return made[-1]

    yield build
    for env in made:
        env.close()


@pytest.fixture
def team():
    """Make a PettingZoo environment by the name of its task."""
    pytest.importorskip("pettingzoo")
    from volery.learning.team_env import parallel_env

    made = []

    def build(name):
        made.append(parallel_env(name))
        return made[-1]

    yield build
    for env in made:
        env.close()


def short(name, decisions=12):
    """Returns the task with a time limit of a few decisions."""
    task = load_task(name)
    return replace(task, episode_s=decisions / task.decision_rate_hz)


def test_both_tasks_are_there():
    assert {"formation", "pursuit"} <= set(TEAMS)


@every_team
def test_pettingzoo_finds_nothing_wrong(team, name):
    from pettingzoo.test import parallel_api_test, parallel_seed_test

    parallel_api_test(team(name), num_cycles=30)
    parallel_seed_test(lambda: team(name), num_cycles=10)


@every_team
def test_agents_are_the_uavs_that_the_policy_flies(team, name):
    env = team(name)
    task = load_task(name)
    observations, infos = env.reset(seed=3)
    assert list(observations) == list(infos) == env.agents == env.possible_agents
    assert len(env.agents) == task.num_agents
    for agent in env.agents:
        assert env.observation_space(agent).contains(observations[agent])
        assert env.observation_space(agent) is env.observation_space(agent)


@every_team
def test_an_episode_ends_for_all_agents(team, name):
    env = team(name)
    env.reset(seed=3)
    down = np.array([0.0, 0.0, -1.0], np.float32)  # the first UAV leaves or lands; the others hover
    first, *others = env.agents
    actions = {first: down, **dict.fromkeys(others, 0.0 * down)}
    for _ in range(300):
        _, rewards, terminated, truncated, infos = env.step(actions)
        if not env.agents:
            break
    assert [agent for agent in terminated if terminated[agent]] == [first]
    assert [agent for agent in truncated if truncated[agent]] == others
    assert rewards[first] < min(rewards[agent] for agent in others) - 4.0
    assert {info["success"] for info in infos.values()} == {False}
    with pytest.raises(CommandError, match=r"no episode is running; call reset\(\)"):
        env.step(actions)


def test_actions_of_other_agents_are_refused(team):
    env = team("pursuit")
    env.reset(seed=0)
    with pytest.raises(CommandError, match="actions of uav1, uav2, uav3 are needed, not of uav1"):
        env.step({"uav1": np.zeros(3)})
    with pytest.raises(CommandError, match=r"action of uav1 has shape \(3,\), not \(2,\)"):
        env.step({agent: np.zeros(2) for agent in env.agents})


@pytest.mark.parametrize("name", TEAMS)
def test_no_agents_act_after_an_episode(team, name):
    """Wrappers such as SuperSuit's black_death step on with the agents that are left, none."""
    env = team(name)
    with pytest.raises(CommandError, match="call reset"):
        env.step({})
    env.reset(seed=0)
    while env.agents:
        env.step({agent: env.action_space(agent).sample() for agent in env.agents})
    assert env.step({}) == ({}, {}, {}, {}, {})
    with pytest.raises(CommandError, match="call reset"):
        env.step({agent: env.action_space(agent).sample() for agent in env.possible_agents})


def test_the_action_of_a_wrong_shape_is_named(team):
    env = team("formation")
    env.reset(seed=0)
    actions = {agent: np.zeros(3) for agent in env.agents} | {"uav2": np.zeros(2)}
    with pytest.raises(CommandError, match=r"action of uav2 has shape \(3,\), not \(2,\)"):
        env.step(actions)
    with pytest.warns(UserWarning, match="do not render"):
        assert env.render() is None


def test_the_code_of_the_documentation_runs():
    pytest.importorskip("pettingzoo")
    text = (Path(__file__).parents[2] / "docs" / "learning_teams.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert len(blocks) == 2
    for number, block in enumerate(blocks):
        exec(compile(block, f"docs/learning_teams.md, block {number}", "exec"), {})


@every_team
def test_each_environment_equals_a_team_of_its_seed(make, team, name):
    rows, agents = make(name), load_task(name).num_agents
    observation, _ = rows.reset(seed=5)
    assert observation.shape[0] == rows.num_envs == 2 * agents
    single = team(name)
    own, _ = single.reset(seed=6)
    np.testing.assert_array_equal(np.array(list(own.values())), observation[agents:])
    rows.action_space.seed(1)
    for _ in range(8):
        actions = rows.action_space.sample()
        observation, reward, *_ = rows.step(actions)
        own, rewards, *_ = single.step(dict(zip(single.agents, actions[agents:], strict=True)))
        np.testing.assert_array_equal(np.array(list(own.values())), observation[agents:])
        np.testing.assert_array_equal(list(rewards.values()), reward[agents:])


@every_team
def test_all_rows_of_an_environment_end_together(make, name):
    agents = load_task(name).num_agents
    env = make(short(name))
    env.reset(seed=1)
    env.step(np.zeros((env.num_envs, 3)))
    env.reset(options={"reset_mask": np.repeat([True, False], agents)})  # now out of phase
    ended = []
    for _ in range(13):
        _, _, terminated, truncated, info = env.step(np.zeros((env.num_envs, 3)))
        over = terminated | truncated
        if over.any():
            ended.append(over.tolist())
            assert info["_end"].tolist() == info["_final_obs"].tolist() == over.tolist()
            assert info["episode_length"][over].tolist() == [12] * agents
    assert ended == [[False] * agents + [True] * agents, [True] * agents + [False] * agents]
    with pytest.raises(CommandError, match=f"the {agents} rows of an environment reset together"):
        env.reset(options={"reset_mask": np.arange(env.num_envs) == 0})


def test_gymnasium_has_rows_of_teams_and_no_single_environment():
    register_tasks()
    envs = gymnasium.make_vec("volery/Formation-v0", num_envs=2)
    assert envs.num_envs == 8
    envs.close()
    with pytest.raises(
        ScenarioError, match=r'use volery.learning.team_env.parallel_env\("pursuit"'
    ):
        TaskEnv(load_task("pursuit"))


@pytest.mark.parametrize("agents", [0, 3, 5])
def test_each_uav_needs_a_policy_or_a_script(agents):
    task = replace(load_task("formation"), num_agents=agents)
    with pytest.raises(ScenarioError, match=f"has 4 UAVs and num_agents = {agents} without a scri"):
        Episodes(task, 1, threads=1)


# ------------------------------------------------------------------------------------- formation


def posed(episodes, positions, posts):
    """Starts UAVs at positions (n, 3) with posts (P, 3) in the only environment."""
    flight = episodes.flight
    episodes.begin(np.arange(1))
    flight.envs.reset(start=EnvironmentStart(np.array(positions)))
    flight.refresh()
    for name in (BEFORE, "position_present_map"):
        flight.values[name][0] = positions
    flight.values[POSTS][:] = 0.0
    flight.values[POSTS][0, : len(posts)] = np.reshape(posts, (-1, 3))
    return flight


def test_a_touch_between_decisions_is_found():
    episodes = Episodes(load_task("formation"), 1, threads=1)
    radius = episodes.flight.airframe.body.collision_radius_m
    start = [[0.0, 0.0, 10.0], [0.0, 20.0, 10.0], [0.0, 40.0, 10.0], [0.0, 60.0, 10.0]]
    flight = posed(episodes, start, [[3.0, 1.0, 0.3], [-4.0, 20.0, 0.5]])
    flight.values[BEFORE][0, 0, 0] = 6.0  # it flew from x = 6 m to 0, past the post at 3 m
    gaps = clearance(flight)[0] + radius
    np.testing.assert_allclose(gaps[:2], [1.0 - 0.3, 4.0 - 0.5], atol=1e-6)
    posed(episodes, start, [])
    assert np.isinf(clearance(flight)).all()
    episodes.close()


def test_posts_are_apart_and_new_in_each_episode():
    episodes = Episodes(replace(load_task("formation"), curriculum=None), 4, threads=1)
    episodes.begin(np.arange(4))
    first = episodes.flight.values[POSTS].copy()
    episodes.begin(np.arange(4))
    second = episodes.flight.values[POSTS]
    assert (first != second).any(axis=(1, 2)).all()
    assert ((second[..., 2] > 0.0).sum(axis=1) >= 6).all()
    for field in second:
        there = field[field[:, 2] > 0.0]
        apart = np.linalg.norm(there[:, None, :2] - there[None, :, :2], axis=-1)
        gaps = (apart - there[:, None, 2] - there[None, :, 2])[~np.eye(len(there), dtype=bool)]
        assert gaps.min() >= 1.6 - 1e-9
    episodes.close()


def success_of(name, policy, count):
    """Returns the fraction of the first episodes of `count` environments that succeed."""
    env = TaskVectorEnv(replace(load_task(name), curriculum=None), count)
    env.reset(seed=10_000)
    agents = env.task.num_agents
    succeeded = np.full(count, -1)
    while (succeeded < 0).any():
        info = env.step(policy(env.episodes.flight).reshape(env.num_envs, 3))[4]
        if "_end" in info:
            new = info["_end"][::agents] & (succeeded < 0)
            succeeded[new] = info["success"][::agents][new]
    env.close()
    return succeeded.mean()


@pytest.mark.slow
def test_a_potential_field_keeps_most_formations():
    assert success_of("formation", formation_field, 24) >= 0.7


@pytest.mark.slow
@pytest.mark.parametrize("name", TEAMS)
def test_baselines_succeed_on_unseen_seeds(name):
    pytest.importorskip("torch")
    from volery.learning.training import evaluate

    assert evaluate(name, episodes=40, seed=10_000, threads=1).success >= 0.8


def test_without_steering_formations_fail():
    def straight(flight):
        return np.zeros((flight.num_envs, flight.num_uavs, 3))

    assert success_of("formation", straight, 4) == 0.0


# --------------------------------------------------------------------------------------- pursuit


@pytest.mark.slow
def test_a_straight_chase_catches_some_evaders():
    assert 0.2 <= success_of("pursuit", straight_chase, 24) <= 0.8


def test_the_evader_flees_and_stays_inside():
    env = TaskVectorEnv(load_task("pursuit"), 8)
    env.reset(seed=0)
    flight, fastest, max_distance = env.episodes.flight, 0.0, 0.0
    for _ in range(150):
        env.step(straight_chase(flight).reshape(env.num_envs, 3))
        own = flight.state.position_map[:, EVADER]
        max_distance = max(max_distance, np.linalg.norm(own[:, :2], axis=1).max())
        velocity = flight.state.velocity_map[:, EVADER]
        fastest = max(fastest, np.linalg.norm(velocity, axis=1).max())
        assert (np.abs(own[:, 2] - 10.0) < 1.0).all()
    assert max_distance < 13.5
    assert 3.4 < fastest < 4.2
    env.close()
