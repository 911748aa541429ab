"""The step, as a tuple of stages in the order in which they run.

A tick is the longest piece of time in which nothing is due: `advance_vehicles` fuses its physics
steps into one compiled call. Where a run is cut into ticks does not change its result.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from volery.engine.engine import Engine

Stage: TypeAlias = "Callable[[Engine, Tick], None]"


@dataclass
class Tick:
    """What the stages of one tick share."""

    horizon_step: int
    """Step that the tick may reach at most: the end of the run's slice or the next firing."""


def take_commands(engine: Engine, _tick: Tick) -> None:
    """Do what other threads have posted since the last tick, in the order of arrival."""
    engine.inbox.work_off()


def advance_vehicles(engine: Engine, tick: Tick) -> None:
    """Control and dynamics, fused, up to the horizon, an event or a UAV that must look around."""
    first = engine.fleet.step
    steps = tick.horizon_step - first
    if steps > 0:
        engine.fleet.advance(steps, engine.terrain, event_ends=True)
        engine.sink.advanced(first + 1, engine.fleet.step)


def resolve_contacts(engine: Engine, _tick: Tick) -> None:
    """Touches of trees, solids and other UAVs; fresh distances for those that need them."""
    engine.collisions.resolve(engine.time_ns)


def sample_sensors(engine: Engine, _tick: Tick) -> None:
    """All sensors that are due, as batches."""
    for due in engine.sensor_agenda.pop_due(engine.fleet.step):
        time_ns = due.instant_ns if due.what.lag_ns else engine.time_ns
        engine.sink.sampled(due.what.sample(due.k, time_ns, engine.fleet))


def raise_events(engine: Engine, _tick: Tick) -> None:
    """Landings, impacts and mode changes that the compiled steps noted, then all new events."""
    for event in engine.collect_events():
        engine.sink.happened(event)


def publish(engine: Engine, _tick: Tick) -> None:
    """Hand out what was measured, then let due timers speak; nodes answer with commands."""
    engine.sink.deliver()
    for due in engine.timer_agenda.pop_due(engine.fleet.step):
        due.what()
        engine.sink.deliver()


STAGES: tuple[Stage, ...] = (
    take_commands,
    advance_vehicles,
    resolve_contacts,
    sample_sensors,
    raise_events,
    publish,
)
