"""Tests that tasks fire at the right step, in a fixed order, without drift."""

from volery.core.clock import Schedule
from volery.engine.scheduler import Scheduler

MS = 1_000_000


def run(agenda, steps):
    log = []
    for step in range(steps + 1):
        log += [(step, due.what, due.k) for due in agenda.pop_due(step)]
    return log


def test_rates_and_phases():
    agenda = Scheduler(MS)
    agenda.add("a", Schedule.from_hz(200.0))
    agenda.add("b", Schedule.from_hz(100.0, 3 * MS))
    log = run(agenda, 10)
    assert log == [(0, "a", 0), (3, "b", 0), (5, "a", 1), (10, "a", 2)]


def test_an_instant_between_steps_fires_at_the_next_step():
    agenda = Scheduler(MS)
    agenda.add("camera", Schedule.from_hz(30.0))
    steps = [step for step, _, _ in run(agenda, 1000)]
    assert steps[:4] == [0, 34, 67, 100]
    assert len(steps) == 31


def test_lag_delays_the_firing_but_not_the_instant():
    agenda = Scheduler(MS)
    agenda.add("lidar", Schedule.from_hz(40.0), lag_ns=18_750_000)
    first, second = (agenda.pop_due(19), agenda.pop_due(44))
    assert [d.instant_ns for d in first + second] == [0, 25 * MS]
    assert agenda.next_step() == 69


def test_simultaneous_firings_keep_the_order_of_addition():
    agenda = Scheduler(MS)
    for name in "zyx":
        agenda.add(name, Schedule.from_hz(100.0))
    assert [d.what for d in agenda.pop_due(0)] == ["z", "y", "x"]
    assert [d.what for d in agenda.pop_due(10)] == ["z", "y", "x"]


def test_an_entry_added_late_does_not_fire_for_the_past():
    agenda = Scheduler(MS)
    agenda.add("timer", Schedule.from_hz(100.0), after_step=25)
    assert agenda.next_step() == 30
    assert Scheduler(MS).next_step() is None


def test_firings_that_are_not_wanted_are_skipped_and_end_no_tick():
    agenda, wanted = Scheduler(MS), []
    agenda.add("camera", Schedule.from_hz(200.0), after_step=0, wanted=lambda: bool(wanted))
    agenda.add("imu", Schedule.from_hz(100.0), after_step=0)
    agenda.add("lidar", Schedule.from_hz(40.0), after_step=0)
    assert agenda.next_step() == 10
    assert agenda.next_step_of(lambda what: what != "imu") == 25
    assert [due.what for due in agenda.pop_due(10)] == ["imu"]
    wanted.append(True)
    assert agenda.next_step() == 15
    assert [(due.what, due.k) for due in agenda.pop_due(15)] == [("camera", 3)]
