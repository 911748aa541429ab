"""Land on an AprilTag, from the detections of a camera below alone, in wind.

Observed are the tag as last seen, carried on by the UAV's own motion, the velocity and the last
action. `servoing` models detections by geometry, for training; `servoing_images` renders the images
and runs the detector, for evaluation.
"""

from __future__ import annotations

import math
import weakref
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.arrays import Array
from volery.learning import randomization
from volery.learning.actions import Velocity
from volery.learning.flight import Flight
from volery.learning.tags.camera import TagCamera
from volery.learning.tags.detection_model import model_detections
from volery.learning.tags.detections import TagDetections
from volery.learning.tags.memory import VALUES, Detect, TagTracking, forget, noise_keys, tag
from volery.learning.tags.setup import RATE_HZ, downward_camera
from volery.learning.task import Task
from volery.learning.terms import landing, observations, rewards, starts, terminations
from volery.learning.worlds import open_air
from volery.runtime.environment_start import EnvironmentStart

_HEIGHT_M = (2.5, 4.5)
_ASIDE = 0.45
"""Largest horizontal distance of the tag at the start, by the height: inside the image or at its
edge."""
_LARGEST_ASIDE_M = 3.0
_TAG_AREA_M = 5.0


def servoing() -> Task:
    """Returns the task with detections by geometry."""
    camera = downward_camera()
    return _task(camera, partial(_model, camera))


def servoing_images() -> Task:
    """Returns the task with detections in rendered images. Needs OpenCV (extra `vision`)."""
    camera = downward_camera()
    return replace(_task(camera, _InImages(camera)), name="servoing_images")


def _task(camera: TagCamera, detect: Detect) -> Task:
    tracking = TagTracking(camera, detect)

    def advance(flight: Flight) -> None:
        tracking(flight)
        landing.store_motion(flight)

    return Task(
        "servoing",
        "Land on an AprilTag, seen by a camera below, in wind",
        scenario=lambda: open_air("f450", physics_hz=500, guidance_hz=100),
        action=Velocity(1.5, 1.0),
        observations=(
            tag(camera=camera),
            replace(observations.velocity_heading(1.5, noise=0.03), bias=0.05),
            observations.last_action(4),
        ),
        rewards=(
            landing.horizontal_approach(2.0),
            landing.descent(1.0),
            landing.touchdown_nearness(8.0, 0.3),
            landing.touchdown_speed(-3.0),
            rewards.action_change(-0.05),
            rewards.alive(-0.05),
        ),
        terminations=(
            landing.landed(0.3, 0.7, reward=5.0),
            terminations.crashed(-1.0),
            terminations.out_of_range(7.0, -8.0),
        ),
        begin=_begin,
        decision_rate_hz=RATE_HZ,
        episode_s=20.0,
        randomization=(
            randomization.wind(0.0, 5.0),
            randomization.turbulence(0.0, 7.7),
            randomization.mass(0.9, 1.1),
        ),
        values={**VALUES, landing.MOTION: (1, 12)},
        advance=advance,
    )


def _begin(flight: Flight, envs: NDArray[np.int64]) -> EnvironmentStart:
    draws = flight.draws
    area, turn = [_TAG_AREA_M, _TAG_AREA_M], math.pi
    tags = np.zeros((len(envs), 3))
    tags[:, :2] = draws.uniform(envs, np.negative(area), area, (2,))
    forget(flight, envs, tags, draws.uniform(envs, -turn, turn))
    height = draws.uniform(envs, *_HEIGHT_M)
    aside = np.sqrt(draws.uniform(envs)) * np.minimum(_ASIDE * height, _LARGEST_ASIDE_M)
    angle, yaw = draws.uniform(envs, -turn, turn), draws.uniform(envs, -turn, turn)
    offset = np.column_stack([aside * np.cos(angle), aside * np.sin(angle), height])
    position = (tags + offset)[:, None]
    velocity = starts.vectors_in_ball(flight, envs, 0.5)
    landing.begin_motion(flight, envs, -offset[:, None], velocity)
    attitude = rotations.from_rpy(0.0 * yaw, 0.0 * yaw, yaw)[:, None]
    return EnvironmentStart(position, attitude, velocity)


def _model(
    camera: TagCamera,
    flight: Flight,
    position: Array,
    attitude: Array,
    tag_position: Array,
    tag_yaw: Array,
) -> TagDetections:
    view = camera.view(position, attitude, tag_position, tag_yaw)
    return model_detections(camera, view, noise_keys(flight), flight.decisions)


class _InImages:
    """Detects tags in rendered images; a renderer for each flight, which closes with it."""

    def __init__(self, camera: TagCamera) -> None:
        self._camera = camera
        self._made: weakref.WeakKeyDictionary[Flight, object] = weakref.WeakKeyDictionary()

    def __call__(
        self,
        flight: Flight,
        position: Array,
        attitude: Array,
        tag_position: Array,
        tag_yaw: Array,
    ) -> TagDetections:
        from volery.learning.tags.images import TagImages

        images = self._made.get(flight)
        if not isinstance(images, TagImages):
            images = TagImages(self._camera, flight.airframe, flight.num_envs)
            self._made[flight] = images
            weakref.finalize(flight, images.close)
        envs = np.arange(flight.num_envs)
        rendered = images.render(
            envs,
            position,
            attitude,
            tag_position,
            tag_yaw,
            keys=noise_keys(flight),
            number=flight.decisions,
        )
        return images.detect(rendered)
