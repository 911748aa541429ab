"""Defines the step as a tuple of stages in their order.

A tick is the longest time span in which nothing is due: `advance_vehicles` fuses its physics steps
into one compiled call. The division of a run into ticks does not change its result.
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
    """Data shared by the stages of one tick."""

    last_step: int
    """Step at which the run ends; the tick ends earlier if something is due."""
    fuses: bool = False
    """Whether the tick goes on after distance queries that find no contact."""


def take_commands(engine: Engine, tick: Tick) -> None:
    """Executes the commands of other threads since the last tick, in order of arrival.

    The state is consistent here, so an action may restore an earlier state. Publications are
    delivered at once, so that they affect the physics steps of this tick. In a divided run, this
    waits at a barrier of its machines.
    """
    division = engine.division
    if division is None or division.at_barrier:
        engine.process_commands()
    if division is not None:
        tick.last_step = division.begin_tick(tick.last_step)


def advance_vehicles(engine: Engine, tick: Tick) -> None:
    """Runs control and dynamics, fused, until the horizon, an event or a distance query."""
    first, fleet = engine.fleet.step, engine.fleet
    last, event_ends = engine.horizon(tick.last_step), not engine.fuses_ticks
    while fleet.step < last:
        fleet.advance(
            last - fleet.step, engine.terrain, event_ends=event_ends, workers=engine.scene.workers
        )
        if not event_ends:
            if fleet.step < last:  # the contacts of the last step have a stage of their own
                engine.collisions.resolve(engine.time_ns)
        elif not tick.fuses or fleet.has_events or not engine.collisions.refill():
            break
    if fleet.step > first:
        engine.turn = 0
        engine.state_check.advanced()
        engine.sink.advanced(first + 1, fleet.step)


def resolve_contacts(engine: Engine, _tick: Tick) -> None:
    """Resolves contacts with trees, solids and other UAVs; refills distance budgets."""
    engine.collisions.resolve(engine.time_ns)


def sample_sensors(engine: Engine, _tick: Tick) -> None:
    """Samples all sensors that are due, in batches."""
    for due in engine.sensor_agenda.pop_due(engine.fleet.step):
        time_ns = due.instant_ns if due.what.lag_ns else engine.time_ns
        samples = due.what.sample(due.k, time_ns, engine.fleet)
        if engine.estimation is not None:
            engine.estimation.take(samples)
        engine.sink.sampled(samples)


def raise_events(engine: Engine, _tick: Tick) -> None:
    """Passes the events noted by the compiled steps, and all new ones, to the sink."""
    events = engine.collect_events()
    if events:
        engine.state_check.look()
    for event in events:
        engine.sink.happened(event)


def publish(engine: Engine, _tick: Tick) -> None:
    """Delivers the samples' messages, then calls due timers; nodes respond with commands."""
    engine.sink.deliver()
    if engine.division is not None:
        engine.division.exchange_responses()
    while (action := engine.deadlines.pop_due(engine.fleet.step)) is not None:
        action()
        engine.sink.deliver()
    for due in engine.timer_agenda.pop_due(engine.fleet.step):
        due.what()
        engine.sink.deliver()
    raise_events(engine, _tick)  # events since then: faults


def meet_partners(engine: Engine, _tick: Tick) -> None:
    """Waits for the lock-step partners that are due, and applies their replies."""
    due = engine.partner_agenda.pop_due(engine.fleet.step)
    if due:
        engine.turn += 1
        engine.is_broken_off = not meet([entry.what for entry in due], engine.time_ns, engine)
        engine.sink.deliver()


def exchange(engine: Engine, _tick: Tick) -> None:
    """Passes what the machines of a divided run have published to each other."""
    if engine.division is not None:
        engine.division.end_tick()


STAGES: tuple[Stage, ...] = (
    take_commands,
    advance_vehicles,
    resolve_contacts,
    sample_sensors,
    raise_events,
    publish,
    meet_partners,
    exchange,
)
