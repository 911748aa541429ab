"""Measures environments per second with LIDARs and depth cameras, in a forest of 400 trees."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from volery.learning.task import Observation, Task
from volery.learning.tasks.forest import forest, forest_scenario
from volery.learning.terms.sensor_observations import depth_image, lidar_sectors
from volery.learning.vector_env import TaskVectorEnv
from volery.scenario.camera import CameraSensor
from volery.scenario.schema import Scenario
from volery.scenario.sensors import LidarSensor

_WIDTH, _HEIGHT = 64, 48
_WARM_UP = 10


def lidar_steps_per_s(num_envs: int = 1024, *, threads: int = 2, decisions: int = 60) -> float:
    """Returns environment steps per second with 36 beams and decisions at 10 Hz."""
    sensor = LidarSensor(model="planar_36", phase_s=0.09, position_m=(0.0, 0.0, 0.1))
    return _steps_per_s(sensor, lidar_sectors(sectors=36), num_envs, threads, decisions)


def depth_steps_per_s(num_envs: int = 256, *, threads: int = 2, decisions: int = 20) -> float:
    """Returns environment steps per second with 64 x 48 depth images and decisions at 10 Hz."""
    sensor = CameraSensor(model="depth_64", position_m=(0.12, 0.0, 0.0))
    part = depth_image(width=_WIDTH, height=_HEIGHT)
    return _steps_per_s(sensor, part, num_envs, threads, decisions)


def _steps_per_s(
    sensor: Any, part: Observation, num_envs: int, threads: int, decisions: int
) -> float:
    """Returns the speed of the task `forest` in one world, with random actions."""
    envs = TaskVectorEnv(_with_sensor(sensor, part), num_envs, threads=threads)
    draw = np.random.default_rng(0)
    try:
        envs.reset(seed=0)
        for _ in range(_WARM_UP):
            envs.step(draw.uniform(-1.0, 1.0, (num_envs, 2)))
        start = time.perf_counter()
        for _ in range(decisions):
            envs.step(draw.uniform(-1.0, 1.0, (num_envs, 2)))
        return num_envs * decisions / (time.perf_counter() - start)
    finally:
        envs.close()


def _with_sensor(sensor: Any, part: Observation) -> Task:
    """Returns the task `forest` in one world with another sensor and its part of observations."""

    def scenario() -> Scenario:
        made = forest_scenario()
        scout = made.types["scout"].model_copy(update={"sensors": (sensor,)})
        return made.model_copy(update={"types": {"scout": scout}})

    task = forest()
    return replace(
        task,
        scenario=scenario,
        observations=(part, *task.observations[1:]),
        rewards=task.rewards[:2],
        action_latency_s=0.0,
        worlds=task.worlds[:1],
    )
