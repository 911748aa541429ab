"""Latency, noise, bias and history of observations and actions; estimates instead of truth."""

from dataclasses import replace

import numpy as np
import pytest

from volery.core.errors import ScenarioError
from volery.learning.actions import Velocity
from volery.learning.episodes import Episodes
from volery.learning.randomization import noise_scale
from volery.learning.task import Observation
from volery.learning.tasks import load_task
from volery.learning.terms import observations
from volery.runtime.environment_start import EnvironmentStart
from volery.scenario.load import parse_scenario

DECISION_S = 0.1


def clock(**options):
    """An observation of the decision's time, s, with the position of the UAV beside it."""

    def now(flight):
        return flight.envs.age_s[:, None, None] + np.zeros((flight.num_envs, 1, 1))

    return Observation("clock", now, 1, "s", limit=1e3, **options)


@pytest.fixture
def run():
    """Return the observations (decisions + 1, K, D) of a task like homing at 10 Hz."""
    made = []

    def play(parts, decisions=6, count=3, action=None, **options):
        task = replace(
            load_task("homing"),
            observations=tuple(parts),
            action=Velocity(2.0),
            decision_rate_hz=10.0,
            terminations=(),
            **options,
        )
        episodes = Episodes(task, count, threads=1)
        made.append(episodes)
        everyone = np.arange(count)
        episodes.begin(everyone)
        seen = [episodes.observe(everyone)[:, 0]]
        for _ in range(decisions):
            episodes.decide(np.zeros((count, 1, 4)) if action is None else action)
            seen.append(episodes.observe(everyone)[:, 0])
        return np.array(seen), episodes

    yield play
    for episodes in made:
        episodes.close()


@pytest.mark.parametrize("latency", [0.1, 0.2, 0.034, 0.152])
def test_numbers_are_as_old_as_the_latency_says(run, latency):
    seen, _ = run([clock(latency_s=latency)])
    expected = np.maximum(np.arange(7) * DECISION_S - latency, 0.0)
    np.testing.assert_allclose(seen[:, :, 0], np.tile(expected[:, None], 3), atol=1e-6)


def test_latencies_are_drawn_for_each_episode_and_do_not_depend_on_others(run):
    seen, episodes = run([clock(latency_s=(0.0, 0.25))], decisions=5)
    age = 0.5 - seen[-1, :, 0]
    assert ((age >= -1e-6) & (age <= 0.25 + 1e-6)).all()
    assert len(set(age.tolist())) == 3
    alone, _ = run([clock(latency_s=(0.0, 0.25))], decisions=5, count=1)
    np.testing.assert_array_equal(alone[:, 0], seen[:, 0])
    episodes.begin(np.array([1]))
    episodes.observe(np.array([1]))
    for _ in range(5):
        episodes.decide(np.zeros((3, 1, 4)))
        again = episodes.observe(np.arange(3))[:, 0, 0]
    assert abs((0.5 - again[1]) - age[1]) > 1e-6
    np.testing.assert_allclose(1.0 - again[[0, 2]], age[[0, 2]], atol=1e-5)


def test_the_history_holds_the_last_decisions_the_oldest_first(run):
    seen, episodes = run([clock(history=3), clock()], decisions=4)
    assert episodes.task.observation_size == 4
    np.testing.assert_allclose(seen[0, 0], [0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(seen[1, 0], [0.0, 0.0, 0.1, 0.1], atol=1e-6)
    np.testing.assert_allclose(seen[4, 0], [0.2, 0.3, 0.4, 0.4], atol=1e-6)


def test_noise_is_white_and_a_bias_lasts_for_an_episode(run):
    noisy = clock(noise=0.3, bias=2.0)
    seen, episodes = run([noisy, clock()], decisions=60, count=8)
    error = seen[:, :, 0] - seen[:, :, 1]
    np.testing.assert_allclose(error.std(axis=0).mean(), 0.3, rtol=0.1)
    first = error.mean(axis=0)
    assert 0.8 < first.std() < 3.5
    episodes.begin(np.arange(8))
    later = episodes.observe(np.arange(8))[:, 0]
    assert np.abs(later[:, 0] - later[:, 1] - first).max() > 1.0


def test_a_variation_scales_the_noise_of_each_environment(run):
    seen, episodes = run([clock(noise=0.5), clock()], 80, 4, randomization=(noise_scale(0.1, 3.0),))
    spread = (seen[:, :, 0] - seen[:, :, 1]).std(axis=0)
    scale = episodes.flight.varied["noise_scale"][:, 0, 0]
    np.testing.assert_allclose(spread / scale, 0.5, rtol=0.35)


def speeds(run, decisions=3, **options):
    """Speeds ahead after each decision of full speed ahead."""
    ahead = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1, 1))
    speed = Observation("speed", lambda f: f.state.velocity_map[..., :1], 1, "m/s", limit=1e3)
    return run([speed], decisions, 2, ahead, **options)[0][:, :, 0]


def test_actions_act_after_their_latency(run):
    prompt = speeds(run)
    for latency in (0.1, 0.02, 0.12):
        late = speeds(run, action_latency_s=latency)
        assert (late[1] < prompt[1]).all()
        assert (late[3] > 0.0).all()
    np.testing.assert_allclose(speeds(run, 4, action_latency_s=0.1)[4], prompt[3], rtol=1e-3)
    one = speeds(run, action_latency_s=(0.0, 0.09))
    assert one[1, 0] != one[1, 1]


def test_actions_have_noise_and_bias(run):
    still = np.zeros((2, 1, 4))
    speed = Observation("speed", lambda f: f.state.velocity_map[..., :1], 1, "m/s", limit=1e3)
    steady, _ = run([speed], 4, 2, still)
    for options in ({"action_noise": 0.3}, {"action_bias": (0.2, 0.3)}):
        shaken, _ = run([speed], 4, 2, still, **options)
        assert (np.abs(shaken[-1]) > np.abs(steady[-1]) + 0.005).all()


def test_an_observation_may_use_the_odometry(run):
    data = {
        "name": "with_odometry",
        "physics": {"rate_hz": 500, "guidance_rate_hz": 100},
        "types": {"f450": {"sensors": [{"kind": "odometry", "rate_hz": 50.0}]}},
        "uavs": [{"type": "f450", "position_m": [0.0, 0.0, 10.0]}],
    }
    parts = [
        replace(observations.goal_heading(), source=source) for source in ("truth", "estimate")
    ]
    ahead = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1, 1))
    seen, episodes = run(parts, 10, 3, ahead, scenario=lambda: parse_scenario(data))
    truth, estimate = seen[..., :3], seen[..., 3:]
    np.testing.assert_allclose(estimate[0], truth[0], atol=1e-6)
    error = np.abs(estimate[-1] - truth[-1]).max()
    assert 1e-5 < error < 0.2
    episodes.envs.reset(start=EnvironmentStart([0.0, 0.0, 10.0]))
    with pytest.raises(ScenarioError, match="uav1 has no sensor 'odom'"):
        run(parts[1:], 1)


@pytest.mark.parametrize(
    ("part", "options", "message"),
    [
        (clock(history=0), {}, "observation 'clock': history = 0"),
        (clock(noise=-1.0), {}, "observation 'clock': noise = -1.0: a number from 0 on"),
        (clock(), {"action_latency_s": (2.0, 1.0)}, "task 'homing': action_latency_s"),
    ],
)
def test_impossible_signals_are_refused(run, part, options, message):
    with pytest.raises(ScenarioError, match=message):
        run([part], 1, **options)


def test_discrete_actions_have_no_noise():
    with pytest.raises(ScenarioError, match="discrete actions have no noise or bias"):
        Episodes(replace(load_task("homing"), action_noise=0.1), 1)
