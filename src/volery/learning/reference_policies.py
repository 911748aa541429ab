"""Hand-written policies that learned ones are compared with.

Each returns actions of its task from the ground truth of a flight.
"""

from __future__ import annotations

import numpy as np

from volery.autonomy.policy import observation_terms
from volery.core.arrays import Array
from volery.learning.flight import Flight
from volery.learning.tasks.formation import COURSE
from volery.learning.tasks.pursuit import EVADER, PURSUERS
from volery.learning.terms.observations import GOAL
from volery.learning.terms.posts import POSTS


def formation_field(flight: Flight) -> Array:
    """Returns actions (K, n, 3) of the task formation by a potential field.

    A UAV flies with the frame and towards its slot. Near posts and teammates it loses the velocity
    towards them, turns aside, and is pushed away just before a touch.
    """
    state, values = flight.state, flight.values
    heading, speed = np.moveaxis(values[COURSE], -1, 0)
    frame = speed[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    to_slot = (values[GOAL] - state.position_map)[..., :2]
    wanted = frame[:, None] + 1.2 * to_slot
    own = state.position_map[..., :2]
    away = own[:, :, None] - values[POSTS][:, None, :, :2]
    radius = values[POSTS][:, None, :, 2]
    hull = np.where(radius > 0.0, radius + flight.airframe.body.collision_radius_m, -100.0)
    wanted = _around(wanted, away, hull, 1.2)
    apart = own[:, :, None] - own[:, None]
    wanted = _around(wanted, apart, np.full(apart.shape[:-1], 0.8), 0.8)
    size = np.linalg.norm(wanted, axis=-1, keepdims=True)
    wanted = wanted * np.minimum(1.0, 3.0 / np.maximum(size, 1e-6))
    climb = 1.2 * (values[GOAL] - state.position_map)[..., 2:]
    velocity = flight.to_heading(np.concatenate([wanted, climb], axis=-1))
    return velocity / 3.0


def _around(wanted: Array, away: Array, hull: Array, margin_m: float) -> Array:
    """Returns velocities (K, n, 2) without the part that closes in on near obstacles.

    away: (K, n, P, 2) from each obstacle to the UAV; hull: (K, n, P) distance of a contact, m.
    """
    distance = np.linalg.norm(away, axis=-1)
    gap = np.where(distance > 0.0, distance - hull, np.inf)
    normal = away / np.maximum(distance, 1e-6)[..., None]
    for k in range(away.shape[2]):
        near = np.clip(1.0 - gap[..., k] / margin_m, 0.0, 1.0)
        touching = np.clip(1.0 - gap[..., k] / 0.35, 0.0, 1.0)
        out = normal[..., k, :]
        closing = np.maximum(-np.sum(wanted * out, axis=-1), 0.0)
        side = np.stack([-out[..., 1], out[..., 0]], axis=-1)
        sign = np.where(np.sum(wanted * side, axis=-1) >= 0.0, 1.0, -1.0)
        wanted = wanted + (closing * near)[..., None] * (out + sign[..., None] * side)
        wanted = wanted + 1.5 * touching[..., None] * out
    return wanted


def straight_chase(flight: Flight) -> Array:
    """Returns actions (K, m, 3) of the task pursuit: all fly straight at the evader.

    They keep away from one another.
    """
    state = flight.state
    pursuers = state.position_map[:, :PURSUERS]
    to_evader = state.position_map[:, EVADER:] - pursuers
    direction = to_evader / np.maximum(np.linalg.norm(to_evader, axis=-1, keepdims=True), 1e-6)
    apart = pursuers[:, :, None] - pursuers[:, None]
    distance = np.maximum(np.linalg.norm(apart, axis=-1, keepdims=True), 1e-6)
    direction = direction + (2.0 * np.clip(1.0 - distance / 2.5, 0.0, 1.0) * apart / distance).sum(
        axis=2
    )
    return observation_terms.to_heading(state.attitude[:, :PURSUERS], direction)
