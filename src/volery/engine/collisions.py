"""Detects contacts between UAVs and their surroundings, by conservative advancement.

A UAV's body is a sphere of its airframe's `collision_radius_m`. A distance query gives how far the
UAV may move before any contact is possible; the fused dynamics count that distance down and return
when it is used up. So nothing is tunnelled at any speed, and queries are rare.

Between UAVs the remaining distance is shared: for each pair, the gap is never smaller than the sum
of both budgets, so no contact is possible before a query.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.control.fused_step import travel_m
from volery.core.arrays import Array
from volery.core.compiled import brief_kernel
from volery.core.vectors import norm
from volery.engine.actor_contacts import ActorContacts, ActorShapes
from volery.engine.events import Event, EventKind
from volery.world.scene import Clearance, Scene

_MAX_LOOK_M = 8.0
"""Maximum distance of a query, which is repeated after that distance."""
_MIN_BUDGET_M = 1e-3
"""In contact, query again after each millimetre."""
_RELEASE_M = 0.02
"""Gap beyond which a contact has ended, so that another contact is a new event."""
_FRICTION = 0.4


@dataclass(frozen=True)
class Bounce:
    """Response of bodies to a contact."""

    restitution: float
    crashes: bool


CRASH = Bounce(restitution=0.15, crashes=True)
BOUNCE = Bounce(restitution=0.5, crashes=False)


class Collisions:
    """Fills the fleet's distance budgets and turns contacts into events and impulses.

    The fleet may hold several independent environments of a scenario, one after the other in its
    rows; UAVs only collide within their environment.
    """

    def __init__(
        self,
        fleet: Fleet,
        scene: Scene,
        names: tuple[str, ...],
        response: Bounce,
        emit: Callable[[Event], None],
        *,
        num_envs: int = 1,
        looks: ActorShapes | None = None,
    ) -> None:
        self._fleet = fleet
        self._scene = scene
        self._names = names
        self._response = response
        self._emit = emit
        self._radius = np.array([a.body.collision_radius_m for a in fleet.airframes])
        self._touched_solid = np.full(len(names), -1)
        self._uavs_per_env = len(names) // num_envs
        self._touching_uav = np.zeros((len(names), self._uavs_per_env), dtype=bool)
        """Pairs in contact: row, index of the other UAV in the environment."""
        self._actors = None if looks is None else ActorContacts(fleet, looks, self._touch_actor)
        """Contacts with actors; None without actors."""
        self._moving = None if looks is None else looks.actors
        fleet.state.contact_budget[:] = 0.0
        fleet.state.separation_budget[:] = 0.0

    @property
    def next_look_ns(self) -> int | None:
        """Time of the next necessary query, ns; None if it depends on motion only."""
        return None if self._actors is None else self._actors.next_look_ns

    def resolve(self, time_ns: int) -> None:
        """Queries around every UAV that is due; applies impulses, reports, refills budgets."""
        due = self._due(self._fleet.state.contact_budget)
        if len(due):
            self._resolve_solids(due, time_ns)
        due = self._due(self._fleet.state.separation_budget)
        if not self._share_gaps(due):
            for i in due:
                self._resolve_others(int(i), time_ns)
        if self._actors is not None:
            self._actors.resolve(due, time_ns)

    def refill(self) -> bool:
        """Queries around the UAVs that are due; returns whether all are free.

        Otherwise a UAV is in contact, or may be: call `resolve`, which goes on from here.
        """
        if self._actors is not None:
            return False
        state = self._fleet.state
        rows = self._due(state.contact_budget)
        if len(rows):
            found = self._query(rows)
            gaps = found.distance - self._radius[rows]
            if gaps.min() <= 0.0:
                return False
            self._touched_solid[rows[gaps > _RELEASE_M]] = -1
            state.contact_budget[rows] = np.maximum(gaps, _MIN_BUDGET_M)
        return self._share_gaps(self._due(state.separation_budget))

    def _due(self, budget: Array) -> NDArray[np.int64]:
        """Returns the rows of UAVs whose budget is used up, or may not last to the next tick.

        The latter at guidance ticks only, so that the others need no single steps in between.
        """
        fleet = self._fleet
        rows: NDArray[np.int64] = _rows_due(
            budget, fleet.state.velocity_map, fleet.state.asleep, fleet.s_to_next_tick
        )
        return rows

    def _share_gaps(self, rows: NDArray[np.int64]) -> bool:
        """Does what `_resolve_others` does for each of `rows`, unless one is in contact.

        Returns whether none is; nothing has changed otherwise.
        """
        if not len(rows):
            return True
        return _share_gaps(
            self._fleet.state.position_map,
            self._radius,
            rows,
            self._uavs_per_env,
            self._touching_uav,
            self._fleet.state.separation_budget,
        )

    def get_state(self) -> dict[str, Any]:
        """Returns the contacts, for a snapshot; the fleet saves the budgets."""
        actors = None if self._actors is None else self._actors.get_state()
        return {
            "solid": self._touched_solid.copy(),
            "uav": self._touching_uav.copy(),
            "actors": actors,
        }

    def forget(self, rows: NDArray[np.int64]) -> None:
        """Resets UAVs: they are in no contact, and are checked at once."""
        self._touched_solid[rows] = -1
        self._touching_uav[rows] = False
        for row in rows.tolist() if self._uavs_per_env > 1 else ():
            env = self._rows_of_env(row)
            self._touching_uav[env, row - env.start] = False
        if self._actors is not None:
            self._actors.forget(rows)
        self._fleet.state.contact_budget[rows] = 0.0
        self._fleet.state.separation_budget[rows] = 0.0

    def look_again(self, first_instance: int) -> None:
        """Queries around every UAV at once, after a change of the world from that instance on."""
        self._touched_solid[self._touched_solid >= first_instance] = -1
        self._fleet.state.contact_budget[:] = 0.0

    def look_at_actors(self) -> None:
        """Checks actors at once, after one was teleported."""
        if self._actors is not None:
            self._actors.look_again()

    def continue_from(self, other: Collisions, pairs: Sequence[tuple[int, int]]) -> None:
        """Copies the contacts of another fleet's UAVs; pairs of own row and the other's.

        Both fleets are single environments of a scenario.
        """
        own, theirs = np.array(pairs, np.int64).reshape(-1, 2).T
        self._touched_solid[own] = other._touched_solid[theirs]
        self._touching_uav[np.ix_(own, own)] = other._touching_uav[np.ix_(theirs, theirs)]
        if self._actors is not None and other._actors is not None:
            self._actors.continue_from(other._actors, own, theirs)

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state."""
        self._touched_solid[...] = state["solid"]
        self._touching_uav[...] = state["uav"]
        if self._actors is not None:
            self._actors.set_state(state["actors"])

    # ----------------------------------------------------------------------- trees and solids

    def _resolve_solids(self, rows: NDArray[np.int64], time_ns: int) -> None:
        state = self._fleet.state
        found = self._query(rows)
        gaps = found.distance - self._radius[rows]
        for k in np.flatnonzero(gaps <= 0.0).tolist():
            i = int(rows[k])
            away = state.position_map[i] - found.nearest[k]
            if found.distance[k] < 0.0:  # inside
                away = -away
            self._touch_solid(i, away, int(found.instance[k]), time_ns)
        self._touched_solid[rows[gaps > _RELEASE_M]] = -1
        state.contact_budget[rows] = np.maximum(gaps, _MIN_BUDGET_M)

    def _query(self, rows: NDArray[np.int64]) -> Clearance:
        """Returns the nearest points of trees and solids to the UAVs `rows`."""
        position = self._fleet.state.position_map[rows]
        return self._scene.clearance(position, _MAX_LOOK_M, include_terrain=False, uavs=rows)

    def _touch_solid(self, i: int, away: Array, instance: int, time_ns: int) -> None:
        normal = _unit(away)
        approach = -float(normal @ self._fleet.state.velocity_map[i])
        if self._touched_solid[i] != instance:
            self._touched_solid[i] = instance
            self._report(i, approach, self._scene.instance_name(instance, i), time_ns)
        if approach > 0.0:
            self._fleet.strike(i, normal, self._response.restitution, _FRICTION)

    # --------------------------------------------------------------------------------- other UAVs

    def _resolve_others(self, i: int, time_ns: int) -> None:
        """Shares the distance to each other UAV of the environment between the two."""
        env = self._rows_of_env(i)
        own = i - env.start
        state = self._fleet.state
        apart = state.position_map[i] - state.position_map[env]
        gaps = np.sqrt((apart * apart).sum(axis=1)) - self._radius[env] - self._radius[i]
        gaps[own] = np.inf
        for j in np.flatnonzero(gaps <= 0.0):
            self._touch_uav(i, env.start + int(j), apart[j], time_ns)
        released = gaps > _RELEASE_M
        touching = self._touching_uav[env]
        touching[own, released] = False
        touching[released, own] = False
        half = np.maximum(0.5 * gaps, 0.5 * _MIN_BUDGET_M)
        budget = state.separation_budget[env]
        others = np.arange(len(gaps)) != own
        budget[others] = np.minimum(budget[others], half[others])
        budget[own] = half.min()

    def _touch_uav(self, i: int, j: int, apart: Array, time_ns: int) -> None:
        state = self._fleet.state
        normal = _unit(apart)
        approach = -float(normal @ (state.velocity_map[i] - state.velocity_map[j]))
        first = self._rows_of_env(i).start
        if not self._touching_uav[i, j - first]:
            self._touching_uav[i, j - first] = self._touching_uav[j, i - first] = True
            self._report(i, approach, self._names[j], time_ns)
            self._report(j, approach, self._names[i], time_ns)
        if approach > 0.0:
            self._fleet.strike(i, normal, self._response.restitution, _FRICTION, other=j)

    # ------------------------------------------------------------------------------------- actors

    def _touch_actor(self, i: int, k: int, away: Array, is_new: bool, time_ns: int) -> None:
        """Strikes a UAV at the approach speed; the actor's motion does not change."""
        assert self._moving is not None
        state, normal = self._fleet.state, _unit(away)
        velocity = self._moving.velocity_at(k, time_ns)
        approach = -float(normal @ (state.velocity_map[i] - velocity))
        if is_new:
            self._report(i, approach, self._moving.names[k], time_ns)
        if approach > 0.0:
            state.velocity_map[i] -= velocity
            self._fleet.strike(i, normal, self._response.restitution, _FRICTION)
            state.velocity_map[i] += velocity

    def _rows_of_env(self, i: int) -> slice:
        """Returns the rows of UAV `i`'s environment."""
        first = i - i % self._uavs_per_env
        return slice(first, first + self._uavs_per_env)

    def _report(self, i: int, speed: float, partner: str, time_ns: int) -> None:
        x, y, z = self._fleet.state.position_map[i].tolist()
        self._emit(
            Event(
                time_ns,
                self._names[i],
                EventKind.COLLISION,
                (x, y, z),
                max(speed, 0.0),
                partner,
            )
        )
        if self._response.crashes:
            self._fleet.crash(i)


def _unit(vector: Array) -> Array:
    length = norm(vector)
    return vector / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])


@brief_kernel
def _share_gaps(
    position: Any, radius: Any, rows: Any, uavs_per_env: int, touching: Any, budget: Any
) -> bool:
    """Shares the gaps of UAVs `rows` with the others of their environments.

    Returns whether none of them is in contact; nothing changes otherwise. position: (N, 3) m;
    radius: (N,) m; touching: (N, uavs_per_env) pairs in contact; budget: (N,) m.
    """
    for is_sharing in (False, True):
        for i in rows:
            first = i - i % uavs_per_env
            nearest = np.inf
            for own in range(uavs_per_env):
                j = first + own
                if j == i:
                    continue
                x = position[i, 0] - position[j, 0]
                y = position[i, 1] - position[j, 1]
                z = position[i, 2] - position[j, 2]
                gap = np.sqrt(x * x + y * y + z * z) - radius[j] - radius[i]
                if not is_sharing:
                    if gap <= 0.0:
                        return False
                    continue
                if gap > _RELEASE_M and touching[i, own]:
                    touching[i, own] = touching[j, i - first] = False
                half = max(0.5 * gap, 0.5 * _MIN_BUDGET_M)
                budget[j] = min(budget[j], half)
                nearest = min(nearest, half)
            if is_sharing:
                budget[i] = nearest
    return True


@brief_kernel
def _rows_due(budget: Any, velocity: Any, asleep: Any, seconds: float) -> Any:
    """Returns the rows of budgets (N,) m that are used up or may be so in `seconds`, if above 0."""
    found, rows = 0, np.empty(len(budget), np.int64)
    for i in range(len(budget)):
        limit = travel_m(velocity[i], seconds) if seconds > 0.0 and not asleep[i] else 0.0
        if budget[i] <= limit:
            rows[found] = i
            found += 1
    return rows[:found]
