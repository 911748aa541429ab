"""Tests pacing alone: number of steps, waiting time, changes by other threads."""

import threading

import pytest
from fake_wall_clock import FakeWallClock

from volery.core.errors import CommandError
from volery.engine import pacing
from volery.engine.pacing import Pacer

MS = 1_000_000


@pytest.fixture
def clock(monkeypatch):
    made = FakeWallClock()
    monkeypatch.setattr(pacing, "time", made.time)
    return made


@pytest.fixture
def pacer(clock):
    made = Pacer()
    made._changed.wait = clock.wait
    made.begin(None, 0)
    return made


def held_s(clock, pacer, time_ns):
    """Wall seconds that the run is held at a simulated time."""
    start_s = clock.now_s
    while pacer.wait(time_ns):
        pass
    return clock.now_s - start_s


def test_full_speed_waits_for_nothing(clock, pacer):
    assert pacer.next_steps(MS) > 10
    assert held_s(clock, pacer, 10**12) == 0.0


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_a_factor_of_real_time(clock, pacer, speed):
    pacer.set_speed(speed)
    assert pacer.next_steps(MS) == max(1, round(5 * speed))
    sim_ns = round(0.2 * speed * 1e9)
    assert held_s(clock, pacer, sim_ns) == pytest.approx(0.2)


def test_slices_are_at_least_a_step(pacer):
    pacer.set_speed(1e-3)
    assert pacer.next_steps(MS) == 1


def make_steps(pacer):
    """Make what comes next, as a run does; how many steps that were."""
    steps = pacer.next_steps(MS)
    pacer.made(steps)
    return steps


def test_a_paused_run_makes_the_steps_asked_for(pacer):
    pacer.pause()
    assert pacer.paused
    assert pacer.next_steps(MS) == 0
    assert pacer.wait(0)
    pacer.single_steps(2)
    pacer.single_steps(1)
    assert not pacer.wait(0)
    assert make_steps(pacer) == 2
    assert make_steps(pacer) == 1
    assert make_steps(pacer) == 0
    pacer.single_steps(250)
    made = [make_steps(pacer) for _ in range(4)]
    assert sum(made) == 250
    assert max(made) <= 100  # a resume in between is not kept waiting
    pacer.resume()
    assert not pacer.wait(0)


def test_steps_not_made_are_forgotten_by_resume(pacer):
    pacer.pause()
    pacer.single_steps(5)
    pacer.resume()
    pacer.pause()
    assert pacer.next_steps(MS) == 0


def test_nothing_is_caught_up_after_a_pause_or_a_change(clock, pacer):
    pacer.set_speed(1.0)
    pacer.wait(0)
    pacer.pause()
    clock.wait(0.15)
    pacer.resume()
    assert held_s(clock, pacer, 100 * MS) == pytest.approx(0.1)
    pacer.set_speed(2.0)
    assert held_s(clock, pacer, 300 * MS) == pytest.approx(0.1)


def test_other_threads_end_a_wait_at_once(monkeypatch):
    monkeypatch.setattr(pacing, "_LONGEST_WAIT_S", 300.0)
    pacer = Pacer()
    for change in (pacer.resume, pacer.wake, lambda: pacer.single_steps(1)):
        pacer.pause()
        timer = threading.Timer(0.01, change)
        timer.start()
        pacer.wait(0)  # else for five minutes
        timer.join(60.0)
        assert timer.finished.is_set()
    assert pacer.paused_s < 300.0


def test_pauses_are_measured(pacer):
    pacer.pause()
    for _ in range(3):
        pacer.wait(0)
    assert pacer.paused_s == pytest.approx(0.15)


def test_refusals(pacer):
    for speed in (0.0, -1.0, float("nan"), 1e6):
        with pytest.raises(CommandError, match="positive real-time factor"):
            pacer.set_speed(speed)
    with pytest.raises(CommandError, match="paused run"):
        pacer.single_steps(1)
    pacer.pause()
    with pytest.raises(CommandError, match="at least 1"):
        pacer.single_steps(0)
