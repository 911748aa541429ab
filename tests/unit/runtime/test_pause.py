"""Runs that another thread pauses, steps and paces: same bytes, no rush, little load."""

import threading
import time

import pytest

from volery.core.errors import CommandError


def digest_of(simulation, seconds, **options):
    simulation.diagnostics.enable_digest()
    simulation.run(seconds, **options)
    return simulation.diagnostics.digest()


class InThread:
    """A run in a thread of its own; leaves with the run's end."""

    def __init__(self, simulation, seconds, **options):
        self._error = None
        self._arguments = simulation, seconds, options
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self):
        simulation, seconds, options = self._arguments
        try:
            simulation.run(seconds, **options)
        except BaseException as error:
            self._error = error

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, kind, *_exception):
        if kind is not None:
            self._arguments[0].clock.resume()
        self._thread.join(60.0)
        assert not self._thread.is_alive()
        if self._error is not None:
            raise self._error


def wait_for(condition):
    for _ in range(6000):
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("this never came true")


def test_results_do_not_depend_on_pauses(simulate, flat_data):
    flat_data["uavs"][0]["on_start"] = "take_off"
    plain = digest_of(simulate(flat_data), 2.0)
    simulation = simulate(flat_data)
    simulation.diagnostics.enable_digest()
    simulation.clock.pause()
    with InThread(simulation, 2.0, speed=20.0):
        simulation.clock.single_step()
        wait_for(lambda: simulation.time_ns == 1_000_000)
        simulation.clock.single_step(7)
        wait_for(lambda: simulation.time_ns == 8_000_000)
        for _ in range(20):
            simulation.clock.resume()
            time.sleep(0.003)
            simulation.clock.pause()
            simulation.clock.set_speed(40.0 if simulation.clock.speed == 20.0 else 20.0)
        simulation.clock.set_speed(None)
        simulation.clock.resume()
    assert simulation.time_s == pytest.approx(2.0)
    assert simulation.diagnostics.digest() == plain


def test_a_paused_run_stands_still_does_what_is_posted_and_reports(simulate, flat_data):
    simulation = simulate(flat_data)
    uav = simulation.uavs["uav1"]
    reports, load = [], []

    def on_progress(progress):
        reports.append(progress)
        load.append(time.thread_time())  # of the thread that runs

    simulation.clock.pause()
    assert simulation.clock.paused
    with InThread(simulation, 0.5, on_progress=on_progress):
        wait_for(lambda: len(reports) >= 3)
        assert all(progress.paused and progress.time_s == 0.0 for progress in reports)
        assert simulation.post(lambda: uav.take_off(2.0)).result(timeout=60.0).command == "take_off"
        assert simulation.time_ns == 0
        before, start = len(reports), time.perf_counter()
        time.sleep(1.0)
        wait_for(lambda: len(reports) >= before + 4)
        calls, elapsed = len(reports) - before, time.perf_counter() - start
        assert calls <= 10 * elapsed + 2
        assert load[before + calls - 1] - load[before] < 0.05 * elapsed
        simulation.clock.resume()
    assert simulation.time_s == pytest.approx(0.5)
    assert not reports[-1].paused
    assert simulation.clock.paused_s > 1.0
    assert uav.mode.name == "TAKE_OFF"


def test_nothing_is_caught_up_after_a_pause(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.run(0.1)
    with InThread(simulation, 10.0, speed=1.0):
        wait_for(lambda: simulation.time_s > 0.1)
        simulation.clock.pause()
        time.sleep(2.0)
        at = simulation.time_s
        resumed = time.perf_counter()
        simulation.clock.resume()
        wait_for(lambda: simulation.time_s > at + 0.02)
        came_to, since = simulation.time_s, time.perf_counter() - resumed
        simulation.clock.set_speed(None)
    assert came_to - at < since + 0.1  # and not two seconds more


def test_full_speed_and_back(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.run(0.1)
    start = time.perf_counter()
    with InThread(simulation, 3.0, speed=0.01):
        wait_for(lambda: simulation.clock.speed == 0.01)
        simulation.clock.set_speed(None)
    assert time.perf_counter() - start < 100.0  # not 300
    assert simulation.clock.speed is None


def test_a_pause_from_on_progress(simulate, flat_data):
    """The thread that runs may pause itself, as a command line's key does."""
    simulation = simulate(flat_data)
    seen = []

    def on_progress(progress):
        seen.append((simulation.time_ns, progress.paused))
        if len(seen) == 1:
            simulation.clock.pause()
        elif len(seen) == 3:
            simulation.clock.single_step(5)
        elif len(seen) == 5:
            simulation.clock.resume()

    simulation.run(6.0, speed=10.0, on_progress=on_progress)
    assert [paused for _, paused in seen[1:5]] == [True] * 4
    assert seen[2][0] == seen[1][0]
    assert seen[4][0] == seen[2][0] + 5_000_000
    assert not seen[-1][1]


def test_refusals(simulate, flat_data):
    simulation = simulate(flat_data)
    with pytest.raises(CommandError, match="paused run"):
        simulation.clock.single_step()
    simulation.clock.pause()
    with pytest.raises(CommandError, match="at least 1"):
        simulation.clock.single_step(0)
    with pytest.raises(CommandError, match="positive real-time factor"):
        simulation.clock.set_speed(-1.0)
    simulation.step(3)  # the caller's own steps ignore the pause
    assert simulation.time_ns == 3_000_000
