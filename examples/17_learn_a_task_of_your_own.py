"""A task of your own in one file: pass under a bar, in wind, with a mass that no one knows.

Train a policy with `volery train examples/17_learn_a_task_of_your_own.py:limbo`.
"""

import numpy as np

from volery.learning import randomization
from volery.learning.actions import Velocity
from volery.learning.conformance import check_task
from volery.learning.curriculum import Curriculum
from volery.learning.task import Observation, Reward, Task, Termination
from volery.learning.terms import observations, rewards, terminations
from volery.learning.vector_env import TaskVectorEnv
from volery.learning.worlds import open_air
from volery.runtime.environment_start import EnvironmentStart


def begin(flight, envs):
    """Places a bar of random height ahead, and the goal behind it; starts on this side."""
    bar = flight.draws.uniform(envs, flight.parameters["lowest_m"][envs], 4.0)
    flight.values["bar_m"][envs] = bar[:, None]
    flight.values["goal_map"][envs] = [8.0, 0.0, 3.0]
    side = flight.draws.uniform(envs, -1.0, 1.0)
    start = np.stack([0.0 * side, side, 3.0 + 0.0 * side], axis=-1)
    return EnvironmentStart(start[:, None])


def below(flight):
    """Returns by how much each UAV is below the bar (K, n), m."""
    return flight.values["bar_m"] - flight.state.position_map[..., 2]


def hits(flight):
    """Returns whether a UAV is at the bar, 4 m ahead, and above it."""
    at_bar = np.abs(flight.state.position_map[..., 0] - 4.0) < 0.3
    return (at_bar & (below(flight) < 0.2)).any(axis=1)


def limbo():
    """Returns the task."""
    return Task(
        "limbo",
        "Fly to a goal behind a bar",
        scenario=lambda: open_air("iris", physics_hz=500, guidance_hz=100),
        action=Velocity(speed_m_s=2.0),
        observations=(
            observations.goal_heading(8.0),
            observations.velocity_heading(2.0, noise=(0.0, 0.1)),
            Observation("below_bar", lambda f: below(f)[..., None], 1, "m", noise=0.02, history=2),
        ),
        rewards=(
            rewards.approach(0.1),
            Reward("margin", lambda f: np.minimum(below(f) - 0.3, 0.0), 0.2),
        ),
        terminations=(
            terminations.arrived(0.5, reward=5.0),
            terminations.crashed(-5.0),
            Termination("bar_hit", hits, reward=-5.0),
        ),
        begin=begin,
        decision_rate_hz=10.0,
        episode_s=12.0,
        action_latency_s=(0.0, 0.05),
        randomization=(randomization.wind(0.0, 4.0), randomization.mass(0.9, 1.1)),
        parameters={"lowest_m": 1.2},
        curriculum=Curriculum(({"lowest_m": 3.5}, {"lowest_m": 2.0}, {"lowest_m": 1.2})),
        values={"goal_map": (1, 3), "bar_m": (1,)},
    )


def careful(observation):
    """Returns the actions (K, 4) of a policy by hand: down first, then ahead."""
    room = observation[:, -1]
    action = np.zeros((len(observation), 4))
    action[:, :3] = np.clip(4.0 * observation[:, :3], -1.0, 1.0)
    before_bar = 8.0 * observation[:, 0] > 3.5
    action[:, 0] = np.where(before_bar & (room < 0.3), 0.0, action[:, 0])
    action[:, 2] = np.where(before_bar, np.clip(2.0 * (room - 0.5), -1.0, 1.0), action[:, 2])
    return action


if __name__ == "__main__":
    check_task(limbo)
    envs = TaskVectorEnv(limbo(), 32)
    observation, _ = envs.reset(seed=0)
    ends = []
    for _ in range(250):
        observation, _, _, _, info = envs.step(careful(observation))
        ends += info["end_name"][info["_end"]].tolist() if info else []
    print(f"{len(ends)} episodes:", {end: ends.count(end) for end in sorted(set(ends))})
    print("levels:", np.bincount(envs.episodes.levels.level).tolist())
    envs.close()
