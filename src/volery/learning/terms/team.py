"""Terms of teams: what a UAV sees of the others, and how near it comes to them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.policy import observation_terms, team_terms
from volery.core.arrays import Array
from volery.learning.flight import Flight
from volery.learning.task import Observation, Reward, Termination


def nearest_neighbours(
    count: int, *, num_agents: int, position_scale_m: float = 3.0, velocity_scale_m_s: float = 3.0
) -> Observation:
    """Returns the nearest of the first `num_agents` UAVs, as `team_terms.neighbours` does."""

    def seen(flight: Flight) -> Array:
        state = flight.state
        attitude = state.attitude[:, :, None]
        position = _relative(state.position_map, num_agents)
        velocity = _relative(state.velocity_map, num_agents)
        is_present = ~np.isnan(position[..., 0])
        return team_terms.neighbours(
            observation_terms.to_heading(attitude, np.nan_to_num(position)),
            observation_terms.to_heading(attitude, np.nan_to_num(velocity)),
            is_present,
            count=count,
            position_scale_m=position_scale_m,
            velocity_scale_m_s=velocity_scale_m_s,
        )

    return Observation(
        "neighbours",
        seen,
        team_terms.NEIGHBOUR_SIZE * count,
        "1",
        parameters={
            "count": count,
            "position_scale_m": position_scale_m,
            "velocity_scale_m_s": velocity_scale_m_s,
        },
    )


def crowding(weight: float, distance_m: float, *, num_agents: int) -> Reward:
    """Returns (1 - d / distance)^2 for the nearest teammate at d < `distance_m`, else 0."""

    def near(flight: Flight) -> Array:
        apart = np.linalg.norm(_relative(flight.state.position_map, num_agents), axis=-1)
        nearest = np.nan_to_num(apart, nan=np.inf).min(axis=-1)
        return np.asarray(np.clip(1.0 - nearest / distance_m, 0.0, 1.0) ** 2)

    return Reward("crowding", near, weight)


def own_crash(reward: float = -5.0) -> Termination:
    """Ends the episode when a UAV hits something, which costs this UAV."""

    def hit(flight: Flight) -> NDArray[np.bool_]:
        return np.asarray(flight.state.crashed | flight.state.on_ground)

    return Termination("crashed", hit, reward=reward)


def _relative(vectors: Array, num_agents: int) -> Array:
    """Returns vectors (K, n, 3) of the first `num_agents` UAVs less one's own, (K, n, m, 3).

    One's own are NaN.
    """
    relative = vectors[:, None, :num_agents] - vectors[:, :, None]
    own = np.arange(num_agents)
    relative[:, own, own] = np.nan
    return np.asarray(relative)
