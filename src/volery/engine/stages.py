"""The step, as a tuple of stages in the order in which they run.

A tick is the longest piece of time in which nothing is due: `advance_vehicles` fuses its physics
steps into one compiled call. Where a run is cut into ticks does not change its result.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from volery.engine.lock_step import meet

if TYPE_CHECKING:
    from volery.engine.engine import Engine

Stage: TypeAlias = "Callable[[Engine, Tick], None]"


@dataclass
class Tick:
    """What the stages of one tick share."""

    last_step: int
    """Step at which the run ends; the tick ends earlier where something is due."""


def take_commands(engine: Engine, _tick: Tick) -> None:
    """Do what other threads have posted since the last tick, in the order of arrival.

    Nothing is half done here, so that an action may take the simulation back to an earlier state.
    What was published is handed out, so that it acts on the physics steps of this very tick.
    """
    engine.process_commands()


def advance_vehicles(engine: Engine, tick: Tick) -> None:
    """Control and dynamics, fused, up to the horizon, an event or a UAV that must look around."""
    first = engine.fleet.step
    steps = engine.horizon(tick.last_step) - first
    if steps > 0:
        engine.fleet.advance(steps, engine.terrain, event_ends=True)
        engine.turn = 0
        engine.state_check.advanced()
        engine.sink.advanced(first + 1, engine.fleet.step)


def resolve_contacts(engine: Engine, _tick: Tick) -> None:
    """Touches of trees, solids and other UAVs; fresh distances for those that need them."""
    engine.collisions.resolve(engine.time_ns)


def sample_sensors(engine: Engine, _tick: Tick) -> None:
    """All sensors that are due, as batches."""
    for due in engine.sensor_agenda.pop_due(engine.fleet.step):
        time_ns = due.instant_ns if due.what.lag_ns else engine.time_ns
        samples = due.what.sample(due.k, time_ns, engine.fleet)
        if engine.estimation is not None:
            engine.estimation.take(samples)
        engine.sink.sampled(samples)


def raise_events(engine: Engine, _tick: Tick) -> None:
    """Landings, impacts and mode changes that the compiled steps noted, then all new events."""
    events = engine.collect_events()
    if events:
        engine.state_check.look()
    for event in events:
        engine.sink.happened(event)


def publish(engine: Engine, _tick: Tick) -> None:
    """Hand out what was measured, then let due timers speak; nodes answer with commands."""
    engine.sink.deliver()
    while (action := engine.deadlines.pop_due(engine.fleet.step)) is not None:
        action()
        engine.sink.deliver()
    for due in engine.timer_agenda.pop_due(engine.fleet.step):
        due.what()
        engine.sink.deliver()
    raise_events(engine, _tick)  # what was noted since: faults


def meet_partners(engine: Engine, _tick: Tick) -> None:
    """Wait for the lock-step partners whose instant has come, and do what they ask."""
    due = engine.partner_agenda.pop_due(engine.fleet.step)
    if due:
        engine.turn += 1
        engine.is_broken_off = not meet([entry.what for entry in due], engine.time_ns, engine)
        engine.sink.deliver()


STAGES: tuple[Stage, ...] = (
    take_commands,
    advance_vehicles,
    resolve_contacts,
    sample_sensors,
    raise_events,
    publish,
    meet_partners,
)
