"""The tag that a UAV has seen last, carried on by the UAV's own motion, in every environment.

An image is taken at each decision; its detection arrives at the next one. Velocity and attitude are
the UAV's estimates: they have an error that stays the same during an episode.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.policy.tag_terms import TAG_SIZE, tag_from_uav, tag_observation
from volery.core import rotations
from volery.core.arrays import Array
from volery.learning.flight import Flight
from volery.learning.tags.camera import TagCamera
from volery.learning.tags.detections import TagDetections
from volery.learning.task import Observation
from volery.learning.terms.observations import GOAL

TAG_YAW, TO_TAG, SEEN_YAW, AGE = "tag_yaw", "to_tag", "tag_seen_yaw", "tag_age_s"
_NEXT, _VELOCITY_ERROR, _TILT_ERROR = "tag_next", "velocity_error", "tilt_error"
_NOISE_KEY = "tag_noise_key"
VALUES: dict[str, tuple[int, ...]] = {
    GOAL: (1, 3),
    TAG_YAW: (1,),
    TO_TAG: (3,),
    SEEN_YAW: (1,),
    AGE: (1,),
    _NEXT: (5,),
    _VELOCITY_ERROR: (3,),
    _TILT_ERROR: (2,),
    _NOISE_KEY: (1,),
}
"""Values of a flight: pose of the tag (`GOAL` and yaw, rad), last seen vector from the UAV to it
(map axes) and yaw, its age, s (inf: never seen), the detection that arrives next (whether there is
one, vector, yaw), errors of the estimates, and the key of the episode's detection noise."""
_VELOCITY_SIGMA_M_S = 0.05
_TILT_SIGMA_RAD = 0.01
"""Standard deviations of the estimates' errors: modelling choices, after the estimator's own on the
F450 in flight."""

Detect = Callable[[Flight, Array, Array, Array, Array], TagDetections]
"""Returns detections (K,) of a flight: positions (K, 3) and attitudes (K, 4) of the UAVs, positions
(K, 3) and yaws (K,) of the tags."""


def tag(range_m: float = 3.0, memory_s: float = 3.0, *, camera: TagCamera) -> Observation:
    """Returns the tag as last seen; see `tag_terms.tag_observation`."""

    def observe(flight: Flight) -> Array:
        values, attitude = flight.values, flight.state.attitude[:, 0]
        numbers = tag_observation(
            values[TO_TAG],
            values[SEEN_YAW][:, 0],
            values[AGE][:, 0],
            attitude,
            range_m=range_m,
            memory_s=memory_s,
        )
        return numbers[:, None]

    parameters = {
        "range_m": range_m,
        "memory_s": memory_s,
        "tag_id": camera.tag_id,
        "tag_size_m": camera.tag_size_m,
        "mount_m": list(camera.mount_m),
        "mount_rpy_deg": list(camera.mount_rpy_deg),
    }
    return Observation("tag", observe, TAG_SIZE, "1", parameters=parameters)


def forget(flight: Flight, envs: NDArray[np.int64], tag_position: Array, tag_yaw: Array) -> None:
    """Begins episodes of `envs` (R,) with an unseen tag at (R, 3) m, map, and yaws (R,), rad."""
    values = flight.values
    values[GOAL][envs, 0], values[TAG_YAW][envs, 0] = tag_position, tag_yaw
    values[AGE][envs] = np.inf
    for name in (TO_TAG, SEEN_YAW, _NEXT):
        values[name][envs] = 0.0
    draws = flight.draws
    values[_VELOCITY_ERROR][envs] = draws.normal(envs, _VELOCITY_SIGMA_M_S, (3,))
    values[_TILT_ERROR][envs] = draws.normal(envs, _TILT_SIGMA_RAD, (2,))
    values[_NOISE_KEY][envs, 0] = draws.uniform(envs)


def noise_keys(flight: Flight) -> NDArray[np.uint64]:
    """Returns the keys (K,) of the noise of the present episodes' detections.

    Detections take no numbers from `flight.draws`: episodes would depend on what happens between
    their end and the next one.
    """
    return np.ascontiguousarray(flight.values[_NOISE_KEY][:, 0]).view(np.uint64)


@dataclass(frozen=True)
class TagTracking:
    """Detects the tag after each decision, and carries on what was seen; for `Task.advance`."""

    camera: TagCamera
    detect: Detect

    def __call__(self, flight: Flight) -> None:
        """Advances the values of a flight by one decision."""
        values, state = flight.values, flight.state
        dt = 1.0 / flight.decision_rate_hz
        moved = dt * (state.velocity_map[:, 0] + values[_VELOCITY_ERROR])
        values[TO_TAG] -= moved
        values[AGE] += dt
        self._receive(values, moved, dt)
        position, attitude = state.position_map[:, 0], state.attitude[:, 0]
        found = self.detect(flight, position, attitude, values[GOAL][:, 0], values[TAG_YAW][:, 0])
        roll, pitch = values[_TILT_ERROR].T
        believed = rotations.multiply(attitude, rotations.from_rpy(roll, pitch, 0.0 * roll))
        camera = self.camera
        vector, yaw = tag_from_uav(
            found.position_optical,
            found.attitude_optical,
            believed,
            camera.mount_m,
            camera.mount_rpy_deg,
        )
        values[_NEXT][:] = np.column_stack([found.is_detected, vector, yaw])

    def _receive(self, values: dict[str, Array], moved: Array, dt: float) -> None:
        """Takes over the detection of the previous decision's image."""
        arrived = values[_NEXT][:, 0] > 0.0
        values[TO_TAG][arrived] = (values[_NEXT][:, 1:4] - moved)[arrived]
        values[SEEN_YAW][arrived] = values[_NEXT][arrived, 4:]
        values[AGE][arrived] = dt
