"""Vertical posts of which each environment has its own, placed anew in every episode.

The value `POSTS` has their axes and radii. They are geometry of the task, not of the shared world:
a contact is a sweep of the UAVs' collision spheres between two decisions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.policy import observation_terms, team_terms
from volery.core.arrays import Array
from volery.learning.flight import Flight
from volery.learning.task import Observation, Reward, Termination

POSTS = "posts_map"
"""Name of the posts (K, P, 3) among the values of a flight: x, y and radius, m; radius 0: none."""
BEFORE = "position_before_map"
"""Name of the positions (K, n, 3), m, at the decision before, among the values of a flight."""
PRESENT = "position_present_map"
"""Name of the positions (K, n, 3), m, at the present decision, which an episode begins with."""
_CANDIDATES = 6


def nearest_posts(count: int, range_m: float = 1.5) -> Observation:
    """Returns the nearest posts, as `team_terms.posts` describes them."""

    def seen(flight: Flight) -> Array:
        posts = flight.values[POSTS][:, None]
        relative = posts - flight.state.position_map[..., None, :]
        radius = np.broadcast_to(posts[..., 2], relative.shape[:-1])
        level = observation_terms.to_heading(flight.state.attitude[:, :, None], relative)
        return team_terms.posts(level[..., :2], radius, count=count, range_m=range_m)

    return Observation(
        "posts",
        seen,
        team_terms.POST_SIZE * count,
        "1",
        limit=1.0,
        parameters={"count": count, "range_m": range_m},
    )


def closeness(weight: float, margin_m: float) -> Reward:
    """Returns ((margin - clearance) / margin)^2 where the clearance is below the margin, else 0."""

    def near(flight: Flight) -> Array:
        return np.asarray(np.clip(1.0 - clearance(flight) / margin_m, 0.0, 1.0) ** 2)

    return Reward("post_closeness", near, weight)


def touched(reward: float = -5.0) -> Termination:
    """Ends the episode when a UAV touches a post, which costs this UAV."""
    return Termination("post", lambda flight: clearance(flight) <= 0.0, reward=reward)


def clearance(flight: Flight) -> Array:
    """Returns each UAV's smallest distance (K, n), m, to posts since the last decision.

    Infinite without posts.
    """
    posts = flight.values[POSTS][:, None]
    start = flight.values[BEFORE][..., None, :2] - posts[..., :2]
    path = (flight.state.position_map - flight.values[BEFORE])[..., None, :2]
    length = np.maximum(np.sum(path * path, axis=-1), 1e-12)
    along = np.clip(-np.sum(start * path, axis=-1) / length, 0.0, 1.0)
    distance = np.linalg.norm(start + along[..., None] * path, axis=-1) - posts[..., 2]
    distance = np.where(posts[..., 2] > 0.0, distance, np.inf)
    return np.asarray(
        distance.min(axis=-1, initial=np.inf) - flight.airframe.body.collision_radius_m
    )


def note_positions(flight: Flight) -> None:
    """Notes the positions, between which UAVs touch posts; for `Task.advance`."""
    flight.values[BEFORE][:] = flight.values[PRESENT]
    flight.values[PRESENT][:] = flight.state.position_map


def scattered_posts(
    flight: Flight,
    envs: NDArray[np.int64],
    number: Array,
    *,
    low: tuple[float, float],
    high: tuple[float, float],
    radius_m: tuple[float, float],
    gap_m: float,
) -> Array:
    """Draws posts (R, P, 3) for `envs` (R,): `number` (R,) of them, the others have radius 0.

    Their axes lie between the corners `low` and `high`, m, with at least `gap_m` between surfaces:
    each is the candidate that is farthest from those before it, and left out if all are too near.
    """
    slots = flight.values[POSTS].shape[1]
    posts = np.zeros((len(envs), slots, 3))
    shape = (slots, _CANDIDATES, 3)
    drawn = flight.draws.uniform(envs, [*low, radius_m[0]], [*high, radius_m[1]], shape)
    rows = np.arange(len(envs))
    for k in range(slots):
        candidates = drawn[:, k]
        between = np.linalg.norm(candidates[:, :, None, :2] - posts[:, None, :, :2], axis=-1)
        gaps = between - candidates[:, :, None, 2] - posts[:, None, :, 2]
        gaps = np.where(posts[:, None, :, 2] > 0.0, gaps, np.inf).min(axis=-1)
        best = gaps.argmax(axis=1)
        is_free = (gaps[rows, best] >= gap_m) & (k < number)
        posts[:, k] = np.where(is_free[:, None], candidates[rows, best], 0.0)
    return posts
