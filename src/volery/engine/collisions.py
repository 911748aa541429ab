"""Touches between UAVs and what stands or flies around them, by conservative advancement.

A UAV's body counts as a sphere of its airframe's `collision_radius_m`. A look at the geometry tells
how far it may move before anything can touch it; the fused dynamics count that distance down and
come back when it is used up. So nothing is tunnelled at any speed, and looks are rare.

Between UAVs the distance left is shared: for each pair, the gap is never smaller than the sum of
both budgets, so no two can touch before one of them asks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.core.compiled import brief_kernel
from volery.core.vectors import norm
from volery.engine.actor_contacts import ActorContacts, ActorShapes
from volery.engine.events import Event, EventKind
from volery.world.scene import Scene

Array = NDArray[np.float64]

_LOOK_REACH_M = 8.0
"""Nothing further away is looked for; the look is repeated after that distance."""
_LEAST_BUDGET_M = 1e-3
"""While touching, look again after each millimetre."""
_RELEASE_M = 0.02
"""Gap at which a touch is over and another one is a new event."""
_FRICTION = 0.4


@dataclass(frozen=True)
class Bounce:
    """How bodies answer a touch."""

    restitution: float
    crashes: bool


CRASH = Bounce(restitution=0.15, crashes=True)
BOUNCE = Bounce(restitution=0.5, crashes=False)


class Collisions:
    """Keeps the fleet's distance budgets filled and turns touches into events and impulses.

    The fleet may hold several independent copies of a scenario, one after the other in its rows;
    UAVs meet those of their own copy only.
    """

    def __init__(
        self,
        fleet: Fleet,
        scene: Scene,
        names: tuple[str, ...],
        response: Bounce,
        emit: Callable[[Event], None],
        *,
        copies: int = 1,
        looks: ActorShapes | None = None,
    ) -> None:
        self._fleet = fleet
        self._scene = scene
        self._names = names
        self._response = response
        self._emit = emit
        self._radius = np.array([a.body.collision_radius_m for a in fleet.airframes])
        self._touched_solid = np.full(len(names), -1)
        self._crew = len(names) // copies
        self._touching_uav = np.zeros((len(names), self._crew), dtype=bool)
        """Who touches whom (row, place of the other in the copy)."""
        self._actors = None if looks is None else ActorContacts(fleet, looks, self._touch_actor)
        """Touches of things that move by themselves, where there are any."""
        self._moving = None if looks is None else looks.actors
        fleet.state.contact_budget[:] = 0.0
        fleet.state.separation_budget[:] = 0.0

    @property
    def next_look_ns(self) -> int | None:
        """When somebody has to look again at the latest; None where that follows from motion."""
        return None if self._actors is None else self._actors.next_look_ns

    def resolve(self, time_ns: int) -> None:
        """Look around every UAV whose budget is used up; strike, report, and refill."""
        state = self._fleet.state
        if self._actors is None and not _is_used_up(state.contact_budget, state.separation_budget):
            return
        used_up = np.flatnonzero(state.contact_budget <= 0.0)
        if len(used_up):
            self._resolve_solids(used_up, time_ns)
        used_up = np.flatnonzero(state.separation_budget <= 0.0)
        for i in used_up:
            self._resolve_others(int(i), time_ns)
        if self._actors is not None:
            self._actors.resolve(used_up, time_ns)

    def get_state(self) -> dict[str, Any]:
        """What a snapshot keeps beside the fleet's own budgets: who touches what."""
        actors = None if self._actors is None else self._actors.get_state()
        return {
            "solid": self._touched_solid.copy(),
            "uav": self._touching_uav.copy(),
            "actors": actors,
        }

    def forget(self, rows: NDArray[np.int64]) -> None:
        """Take UAVs as new: they touch nothing, and look around at once."""
        self._touched_solid[rows] = -1
        self._touching_uav[rows] = False
        for row in rows.tolist():
            crew = self._crew_of(row)
            self._touching_uav[crew, row - crew.start] = False
        if self._actors is not None:
            self._actors.forget(rows)
        self._fleet.state.contact_budget[rows] = 0.0
        self._fleet.state.separation_budget[rows] = 0.0

    def look_again(self, first_instance: int) -> None:
        """Look around every UAV at once: the world has changed from that instance on."""
        self._touched_solid[self._touched_solid >= first_instance] = -1
        self._fleet.state.contact_budget[:] = 0.0

    def look_at_actors(self) -> None:
        """Look at once at things, one of which was put somewhere."""
        if self._actors is not None:
            self._actors.look_again()

    def continue_from(self, other: Collisions, kept: Sequence[tuple[int, int]]) -> None:
        """Know who touches what of another fleet's UAVs: own row and the other's, for each pair.

        Both are single copies of a scenario.
        """
        own, theirs = np.array(kept, np.int64).reshape(-1, 2).T
        self._touched_solid[own] = other._touched_solid[theirs]
        self._touching_uav[np.ix_(own, own)] = other._touching_uav[np.ix_(theirs, theirs)]
        if self._actors is not None and other._actors is not None:
            self._actors.continue_from(other._actors, own, theirs)

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a kept state."""
        self._touched_solid[...] = state["solid"]
        self._touching_uav[...] = state["uav"]
        if self._actors is not None:
            self._actors.set_state(state["actors"])

    # ----------------------------------------------------------------------- trees and solids

    def _resolve_solids(self, rows: NDArray[np.int64], time_ns: int) -> None:
        state = self._fleet.state
        found = self._scene.clearance(
            state.position_map[rows], _LOOK_REACH_M, include_terrain=False
        )
        gaps = found.distance - self._radius[rows]
        for k, i in enumerate(rows):
            if gaps[k] <= 0.0:
                away = state.position_map[i] - found.nearest[k]
                if found.distance[k] < 0.0:  # inside
                    away = -away
                self._touch_solid(int(i), away, int(found.instance[k]), time_ns)
            elif gaps[k] > _RELEASE_M:
                self._touched_solid[i] = -1
        state.contact_budget[rows] = np.maximum(gaps, _LEAST_BUDGET_M)

    def _touch_solid(self, i: int, away: Array, instance: int, time_ns: int) -> None:
        normal = _unit(away)
        approach = -float(normal @ self._fleet.state.velocity_map[i])
        if self._touched_solid[i] != instance:
            self._touched_solid[i] = instance
            self._report(i, approach, self._scene.instance_name(instance), time_ns)
        if approach > 0.0:
            self._fleet.strike(i, normal, self._response.restitution, _FRICTION)

    # --------------------------------------------------------------------------------- other UAVs

    def _resolve_others(self, i: int, time_ns: int) -> None:
        """Share the distance to each other UAV of the copy between the two of them."""
        crew = self._crew_of(i)
        own = i - crew.start
        state = self._fleet.state
        apart = state.position_map[i] - state.position_map[crew]
        gaps = np.sqrt((apart * apart).sum(axis=1)) - self._radius[crew] - self._radius[i]
        gaps[own] = np.inf
        for j in np.flatnonzero(gaps <= 0.0):
            self._touch_uav(i, crew.start + int(j), apart[j], time_ns)
        released = gaps > _RELEASE_M
        touching = self._touching_uav[crew]
        touching[own, released] = False
        touching[released, own] = False
        half = np.maximum(0.5 * gaps, 0.5 * _LEAST_BUDGET_M)
        budget = state.separation_budget[crew]
        others = np.arange(len(gaps)) != own
        budget[others] = np.minimum(budget[others], half[others])
        budget[own] = half.min()

    def _touch_uav(self, i: int, j: int, apart: Array, time_ns: int) -> None:
        state = self._fleet.state
        normal = _unit(apart)
        approach = -float(normal @ (state.velocity_map[i] - state.velocity_map[j]))
        first = self._crew_of(i).start
        if not self._touching_uav[i, j - first]:
            self._touching_uav[i, j - first] = self._touching_uav[j, i - first] = True
            self._report(i, approach, self._names[j], time_ns)
            self._report(j, approach, self._names[i], time_ns)
        if approach > 0.0:
            self._fleet.strike_pair(i, j, normal, self._response.restitution, _FRICTION)

    # ------------------------------------------------------------------------------------- things

    def _touch_actor(self, i: int, k: int, away: Array, is_new: bool, time_ns: int) -> None:
        """A thing is not moved by what it meets; a UAV is struck as fast as the two approach."""
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

    def _crew_of(self, i: int) -> slice:
        """Rows of the copy that UAV `i` belongs to."""
        first = i - i % self._crew
        return slice(first, first + self._crew)

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
def _is_used_up(contact_budget: Array, separation_budget: Array) -> bool:
    """Whether any UAV's budget (N,) is."""
    for i in range(len(contact_budget)):
        if contact_budget[i] <= 0.0 or separation_budget[i] <= 0.0:
            return True
    return False
