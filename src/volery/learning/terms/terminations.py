"""Terminations: functions return (K,) whether the episode of an environment ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.learning.flight import Flight
from volery.learning.task import Termination
from volery.learning.terms.rewards import goal_distance


def crashed(reward: float = -10.0) -> Termination:
    """Ends the episode when a UAV hits something, the ground included."""

    def hit(flight: Flight) -> NDArray[np.bool_]:
        touches = flight.state.crashed | flight.state.on_ground
        return np.asarray(touches.any(axis=1))

    return Termination("crashed", hit, reward=reward)


def out_of_range(limit_m: float, reward: float = -10.0) -> Termination:
    """Ends the episode when a UAV is farther than `limit_m` from its goal."""

    def far(flight: Flight) -> NDArray[np.bool_]:
        return np.asarray((goal_distance(flight) > limit_m).any(axis=1))

    return Termination("out_of_range", far, reward=reward)


def arrived(
    within_m: float, speed_limit_m_s: float = float("inf"), reward: float = 10.0
) -> Termination:
    """Ends the episode with success when all UAVs are near their goals and slow."""

    def there(flight: Flight) -> NDArray[np.bool_]:
        slow = np.linalg.norm(flight.state.velocity_map, axis=-1) <= speed_limit_m_s
        return np.asarray(((goal_distance(flight) <= within_m) & slow).all(axis=1))

    return Termination("arrived", there, is_success=True, reward=reward)
