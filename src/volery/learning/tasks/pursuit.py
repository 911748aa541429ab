"""Three pursuers catch an evader that is faster than they are, within a round arena.

A script flies the evader: it flees at full speed in the direction that keeps it farthest from the
pursuers a second later, and stays inside. It is captured when a pursuer is within `CAPTURE_M`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.policy import action_terms, observation_terms
from volery.core.arrays import Array
from volery.learning.actions import LimitedVelocity
from volery.learning.flight import Flight
from volery.learning.task import Observation, Reward, Task, Termination
from volery.learning.terms import observations, rewards, team
from volery.learning.terms.observations import GOAL
from volery.learning.worlds import open_air
from volery.runtime.environment_start import EnvironmentStart

GAP = "gap"
"""Name of the distance (K, 1), m, of the nearest pursuer to the evader, among the values."""
CLOSED = "closed"
"""Name of the decrease (K, 1), m, of the gap in the last decision, among the values."""
PURSUERS = 3
EVADER = PURSUERS
"""Row of the evader."""
CAPTURE_M = 1.2
"""Distance of a capture, m."""
ARENA_M = 12.0
"""Radius of the arena, m."""
SPEED_M_S = 3.0
"""Speed limit of the pursuers."""
EVADER_SPEED_M_S = 3.6
"""Speed of the evader."""
_HEIGHT = 10.0
_CENTRE = np.array([0.0, 0.0, _HEIGHT])
_LOOKAHEAD_S = 1.0
_DIRECTIONS = np.array([[math.cos(a), math.sin(a)] for a in np.arange(24) * math.tau / 24])


@dataclass(frozen=True)
class _Velocity(LimitedVelocity):
    """The same, with a limit of its own for the evader."""

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        limits = np.full((PURSUERS + 1, 1), self.speed_m_s)
        limits[EVADER] = EVADER_SPEED_M_S
        flight.envs.command_velocity(action_terms.limited_velocity(action, limits))


def pursuit() -> Task:
    """Returns the task."""
    return Task(
        "pursuit",
        "Catch a faster evader with three pursuers",
        scenario=lambda: open_air("f450", physics_hz=500, guidance_hz=100, num_uavs=PURSUERS + 1),
        action=_Velocity(SPEED_M_S),
        observations=(
            observations.goal_heading(6.0),
            _evader_velocity(3.0),
            observations.velocity_heading(3.0),
            _centre(ARENA_M),
            team.nearest_neighbours(PURSUERS - 1, num_agents=PURSUERS, position_scale_m=6.0),
        ),
        rewards=(
            Reward(
                "closed", lambda f: np.broadcast_to(f.values[CLOSED], (f.num_envs, f.num_uavs)), 0.3
            ),
            rewards.approach(0.01),
            team.crowding(-0.3, 2.0, num_agents=PURSUERS),
            rewards.alive(-0.03),
        ),
        terminations=(_captured(10.0), team.own_crash(-5.0), _left(-5.0)),
        begin=_begin,
        decision_rate_hz=10.0,
        episode_s=30.0,
        values={GOAL: (PURSUERS + 1, 3), GAP: (1,), CLOSED: (1,)},
        advance=_advance,
        num_agents=PURSUERS,
        script=evader,
    )


def evader(flight: Flight) -> Array:
    """Returns the action (K, 1, 3) of the evader."""
    state = flight.state
    own = state.position_map[:, EVADER]
    ahead = own[:, None, :2] + EVADER_SPEED_M_S * _LOOKAHEAD_S * _DIRECTIONS
    pursuers = state.position_map + _LOOKAHEAD_S * state.velocity_map
    both = np.stack([state.position_map, pursuers], axis=1)[:, :, :PURSUERS, :2]
    distance = np.linalg.norm(ahead[:, :, None, None] - both[:, None], axis=-1)
    score = distance.min(axis=(2, 3)) - 4.0 * np.maximum(
        np.linalg.norm(ahead, axis=-1) - (ARENA_M - 1.0), 0.0
    )
    best = _DIRECTIONS[score.argmax(axis=1)]
    climb = np.clip(_HEIGHT - own[:, 2:], -1.0, 1.0)
    velocity = np.concatenate([EVADER_SPEED_M_S * best, climb], axis=-1)
    level = observation_terms.to_heading(state.attitude[:, EVADER], velocity)
    return np.clip(level / EVADER_SPEED_M_S, -1.0, 1.0)[:, None]


def _begin(flight: Flight, envs: NDArray[np.int64]) -> EnvironmentStart:
    draws = flight.draws
    angle = draws.uniform(envs, -math.pi, math.pi)
    shape = (PURSUERS + 1, 3)
    line = np.array([[-9.0, 3.0 * (k - 1), 0.0] for k in range(PURSUERS)] + [[3.0, 0.0, 0.0]])
    spread = np.array([[1.0, 0.7, 0.5]] * PURSUERS + [[5.0, 5.0, 0.0]])
    offset = line + draws.uniform(envs, -spread, spread, shape)
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y, z = np.moveaxis(offset, -1, 0)
    position = _CENTRE + np.stack([c * x - s * y, s * x + c * y, z], axis=-1)
    flight.values[GOAL][envs] = position[:, EVADER:]
    flight.values[GAP][envs] = _gap(position)
    yaw = draws.uniform(envs, -math.pi, math.pi, (PURSUERS + 1,))
    zero = np.zeros_like(yaw)
    attitude = np.stack([zero, zero, np.sin(yaw / 2.0), np.cos(yaw / 2.0)], axis=-1)
    return EnvironmentStart(position, attitude)


def _advance(flight: Flight) -> None:
    position, values = flight.state.position_map, flight.values
    gap = _gap(position)
    values[CLOSED][:] = values[GAP] - gap
    values[GAP][:] = gap
    values[GOAL][:] = position[:, EVADER:]


def _gap(position: Array) -> Array:
    """Returns the distance (R, 1), m, of the nearest pursuer to the evader."""
    apart = np.linalg.norm(position[:, :PURSUERS] - position[:, EVADER:], axis=-1)
    return np.asarray(apart.min(axis=1, keepdims=True))


def _evader_velocity(scale_m_s: float) -> Observation:
    """Returns the velocity of the evader in the level heading frame, m/s."""

    def seen(flight: Flight) -> Array:
        velocity = flight.state.velocity_map
        return flight.to_heading(np.broadcast_to(velocity[:, EVADER:], velocity.shape))

    return Observation("goal_velocity_heading", seen, 3, "m/s", scale_m_s)


def _centre(scale_m: float) -> Observation:
    """Returns the centre of the arena relative to the UAV in the level heading frame, m."""

    def seen(flight: Flight) -> Array:
        return flight.to_heading(_CENTRE - flight.state.position_map)

    x_m, y_m, z_m = _CENTRE.tolist()
    point = {"x_m": x_m, "y_m": y_m, "z_m": z_m}
    return Observation("centre_heading", seen, 3, "m", scale_m, parameters=point)


def _captured(reward: float) -> Termination:
    def near(flight: Flight) -> NDArray[np.bool_]:
        return np.asarray(flight.values[GAP][:, 0] <= CAPTURE_M)

    return Termination("captured", near, is_success=True, reward=reward)


def _left(reward: float) -> Termination:
    """Ends the episode when a pursuer leaves the arena by more than 3 m, or its height by 4 m."""

    def out(flight: Flight) -> NDArray[np.bool_]:
        away = flight.state.position_map - _CENTRE
        far = np.linalg.norm(away[..., :2], axis=-1) > ARENA_M + 3.0
        far |= np.abs(away[..., 2]) > 4.0
        far[:, EVADER:] = False
        return np.asarray(far)

    return Termination("left", out, reward=reward)
