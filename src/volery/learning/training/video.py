"""Short videos of an episode, from a camera of the simulation, as animated GIF images."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from volery.learning.task import Task
from volery.learning.training.evaluation import VALIDATION_SEEDS, Act
from volery.learning.vector_env import TaskVectorEnv
from volery.scenario.load import parse_scenario
from volery.scenario.schema import Scenario

Frames = NDArray[np.uint8]
_COLOURS = 64
_CHASE: dict[str, Any] = {
    "kind": "camera",
    "name": "chase",
    "width": 160,
    "height": 120,
    "rate_hz": 5.0,
    "position_m": [-1.5, 0.0, 0.6],
    "rpy_deg": [0.0, 15.0, 0.0],
}
"""Camera behind and above the first UAV, for scenarios without one."""


def film_episode(task: Task, act: Act, *, max_frames: int = 60) -> tuple[Frames, float]:
    """Returns images (N, H, W, 3) of an episode on a validation seed, and their rate, Hz.

    They come from the scenario's first camera, or one behind the first UAV where it has none.
    """
    camera, rate_hz, scenario = _with_camera(task.scenario())
    filmed = replace(task, scenario=lambda: scenario, curriculum=None)
    env = TaskVectorEnv(filmed, 1, threads=1)
    observation, _ = env.reset(seed=VALIDATION_SEEDS)
    uav = env.episodes.envs.uav_names[0]
    per_frame = max(1, round(task.decision_rate_hz / rate_hz))
    frames: list[Frames] = []
    for decision in range(1, task.episode_decisions + 1):
        observation, _, terminated, truncated, _ = env.step(act(observation))
        sample = env.episodes.envs.sample(uav, camera)
        if (terminated | truncated).any() or len(frames) >= max_frames:
            break
        if sample is not None and decision % per_frame == 0:
            frames.append(sample["colour"][0])
    env.close()
    images = np.stack(frames) if frames else np.zeros((0, 1, 1, 3), np.uint8)
    return images, task.decision_rate_hz / per_frame


def gif_of(frames: Frames, rate_hz: float) -> bytes:
    """Returns images (N, H, W, 3), N at least 1, as an animated GIF."""
    images = [Image.fromarray(frame).quantize(_COLOURS) for frame in frames]
    buffer = io.BytesIO()
    images[0].save(
        buffer,
        "GIF",
        save_all=True,
        append_images=images[1:],
        duration=round(1e3 / rate_hz),
        loop=0,
    )
    return buffer.getvalue()


def _with_camera(scenario: Scenario) -> tuple[str, float, Scenario]:
    """Returns the name and rate, Hz, of a camera of the first UAV, and the scenario with it."""
    kind = scenario.uavs[0].type
    for sensor in scenario.types[kind].sensors:
        if sensor.kind == "camera":
            return sensor.name, sensor.rate_hz, scenario
    data = scenario.model_dump(mode="json", exclude_unset=True)
    sensors = [*data["types"][kind].get("sensors", []), _CHASE]
    data["types"][kind] = {**data["types"][kind], "sensors": sensors}
    return _CHASE["name"], _CHASE["rate_hz"], parse_scenario(data)
