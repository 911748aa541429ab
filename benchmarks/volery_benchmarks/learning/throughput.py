"""Measures decisions per second of 1,024 environments, and their resets."""

from __future__ import annotations

import statistics
import time
from dataclasses import replace

import numpy as np

from volery.learning.actions import RatesThrust, Velocity
from volery.learning.task import Task
from volery.learning.tasks import load_task
from volery.learning.terms import observations, rewards, terminations
from volery.learning.vector_env import TaskVectorEnv
from volery_benchmarks.learning.sensor_speed import depth_steps_per_s, lidar_steps_per_s
from volery_benchmarks.registry import Measured

_ENVS = 1_024
_THREADS = 2
_SECONDS = 5.0
"""Wall time of the rounds of one figure."""
_MIN_ROUNDS = 5
_ACTIONS = 16
"""Batches of random actions, drawn beforehand."""
_RESETS = 30


def measure_state() -> Measured:
    """Returns the figure of velocity actions at 50 Hz, goal and velocity observed."""
    task = replace(
        load_task("homing"),
        action=Velocity(2.0),
        rewards=(rewards.approach(0.1), rewards.alive(-0.01)),
        decision_rate_hz=50.0,
    )
    return Measured({"env_steps_per_s_state": steps_per_s(task)})


def measure_rotor() -> Measured:
    """Returns the figure of body rates and thrust at 100 Hz, the whole motion observed."""
    task = replace(
        load_task("hover"),
        action=RatesThrust(),
        observations=(
            observations.goal_body(1.0),
            observations.velocity_body(2.0),
            observations.rotation(),
            observations.rates(10.0),
        ),
        rewards=(rewards.nearness(1.0, 0.7), rewards.tilt(-0.2)),
        terminations=(terminations.out_of_range(5.0), terminations.crashed()),
    )
    return Measured({"env_steps_per_s_rotor": steps_per_s(task)})


def measure_lidar() -> Measured:
    """Returns the figure of 36 LIDAR beams in a forest of 400 trees, decisions at 10 Hz."""
    return Measured({"env_steps_per_s_lidar": lidar_steps_per_s()})


def measure_depth() -> Measured:
    """Returns the figure of depth images of 64 x 48 in that forest."""
    return Measured({"env_steps_per_s_depth": depth_steps_per_s()})


def measure_reset() -> Measured:
    """Returns the time of new episodes in all environments of the task `hover`, ms."""
    env = TaskVectorEnv(load_task("hover"), _ENVS, threads=_THREADS)
    env.reset(seed=1)
    times = []
    for _ in range(_RESETS):
        start = time.perf_counter()
        env.reset()
        times.append(time.perf_counter() - start)
    env.close()
    return Measured({"reset_ms_1024": 1e3 * statistics.median(times)})


def steps_per_s(task: Task, num_envs: int = _ENVS, *, seconds: float = _SECONDS) -> float:
    """Returns decisions per second of all environments together, the median of rounds.

    Actions are random; episodes that end begin anew within the step, as in a training.
    """
    env = TaskVectorEnv(task, num_envs, threads=_THREADS)
    env.reset(seed=1)
    env.action_space.seed(1)
    actions = [np.asarray(env.action_space.sample()) for _ in range(_ACTIONS)]
    for action in actions:
        env.step(action)
    rates: list[float] = []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(rates) < _MIN_ROUNDS:
        start = time.perf_counter()
        for action in actions:
            env.step(action)
        rates.append(num_envs * _ACTIONS / (time.perf_counter() - start))
    env.close()
    return statistics.median(rates)
