"""A recorder returns the true states at its rate, over resets too, and changes no results."""

from __future__ import annotations

import math

import numpy as np
import pytest

from volery.control.flight_modes import FlightMode
from volery.core.errors import CommandError
from volery.runtime import Simulation
from volery.scenario.load import parse_scenario


@pytest.fixture
def simulation(flat_data):
    flat_data["uavs"][0]["on_start"] = "take_off"
    with Simulation(parse_scenario(flat_data)) as made:
        yield made


def test_samples_are_the_states_at_their_times(simulation):
    recorder = simulation.record(10.0)
    states = []
    for _ in range(20):
        uav = simulation.uavs["uav1"]
        states.append((simulation.time_s, uav.position_map, uav.velocity_map, uav.attitude))
        simulation.run(0.1)
    result = recorder.result()
    assert result.uavs == ("uav1",)
    assert result.position_map.shape == (1, 21, 3)
    assert result.times_s[:20].tolist() == [state[0] for state in states]
    flight = result["uav1"]
    for field, k in (("position_map", 1), ("velocity_map", 2), ("attitude", 3)):
        assert np.array_equal(getattr(flight, field)[:20], [state[k] for state in states]), field
    assert np.array_equal(flight.position_map[-1], simulation.uavs["uav1"].position_map)
    assert flight.mode[0] == flight.mode[-1] == FlightMode.TAKE_OFF
    assert 0.99 < flight.battery_charge[-1] <= 1.0


def test_recording_changes_no_results(flat_data):
    digests = []
    for rate_hz in (None, 37.0):
        with Simulation(parse_scenario(flat_data)) as simulation:
            simulation.diagnostics.enable_digest()
            if rate_hz is not None:
                simulation.record(rate_hz)
            simulation.run(4.0)
            digests.append(simulation.diagnostics.digest())
    assert digests[0] == digests[1]


def test_fly_returns_the_flight_with_its_events(simulation):
    simulation.run(1.0)
    result = simulation.fly(5.0, rate_hz=20.0)
    assert (result.times_s[0], result.times_s[-1]) == (1.0, 6.0)
    assert np.allclose(np.diff(result.times_s), 0.05)
    assert [event.detail for event in result.events] == ["changed to HOLD"]
    before = simulation.fly(1.0)
    assert before.events == ()
    assert before.times_s[0] == 6.0


def test_results_in_between_add_no_samples_to_later_ones(simulation):
    recorder = simulation.record(10.0)
    simulation.run(0.25)
    assert recorder.result().times_s.tolist() == [0.0, 0.1, 0.2, 0.25]
    simulation.vehicles.spawn("guest", "f450", [5.0, 5.0, 3.0])
    assert recorder.result().uavs == ("uav1", "guest")
    assert "<b>flat</b>" in simulation._repr_html_()
    simulation.run(0.15)
    result = recorder.result()
    assert result.times_s.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4]
    assert np.isfinite(result["guest"].position_map[3:]).all()


def test_a_stopped_recorder_keeps_its_flight(simulation):
    with simulation.record() as recorder:
        simulation.run(1.0)
    assert not recorder.is_recording
    simulation.run(5.0)
    assert recorder.result().times_s[-1] == 1.0
    assert recorder.result().events == ()


def test_the_result_remains_after_the_simulation_is_closed(flat_data):
    with Simulation(parse_scenario(flat_data)) as simulation:
        recorder = simulation.record()
        simulation.run(0.5)
    assert recorder.result().times_s[-1] == 0.5
    assert recorder.result()._repr_png_().startswith(b"\x89PNG")


def test_a_restored_state_replaces_the_undone_flight(simulation):
    recorder = simulation.record(10.0)
    simulation.run(1.0)
    snapshot = simulation.snapshot()
    simulation.run(1.0)
    simulation.restore(snapshot)
    assert recorder.result().times_s[-1] == 1.0
    simulation.uavs["uav1"].land()
    simulation.run(0.5)
    result = recorder.result()
    assert np.allclose(result.times_s, np.arange(16) / 10.0)
    assert result["uav1"].mode[-1] == FlightMode.LAND
    assert result["uav1"].mode[9] == FlightMode.TAKE_OFF


def test_a_reset_begins_the_recording_again(simulation):
    recorder = simulation.record(10.0)
    simulation.run(1.0)
    simulation.reset(seed=7)
    simulation.run(0.3)
    result = recorder.result()
    assert np.allclose(result.times_s, [0.0, 0.1, 0.2, 0.3])
    assert result.seed == 7


def test_a_spawned_uav_has_no_samples_before(simulation):
    recorder = simulation.record(10.0)
    simulation.run(0.5)
    simulation.vehicles.spawn("guest", "f450", [5.0, 5.0, 3.0])
    simulation.run(0.5)
    simulation.vehicles.delete("uav1")
    simulation.run(0.2)
    result = recorder.result()
    assert result.uavs == ("uav1", "guest")
    assert np.allclose(result.times_s, np.arange(13) / 10.0)
    assert np.isnan(result["guest"].position_map[:6]).all()
    assert np.isfinite(result["guest"].position_map[6:]).all()
    assert np.isnan(result["uav1"].position_map[11:]).all()
    assert (result["uav1"].mode[11:] == -1).all()


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, math.nan, math.inf, 5000.0])
def test_an_impossible_rate_is_refused(simulation, rate_hz):
    with pytest.raises(CommandError, match=r"rate_hz = .* cannot be recorded: use a rate above 0"):
        simulation.record(rate_hz)


def test_a_rate_that_does_not_divide_a_second(simulation):
    times = simulation.fly(1.0, rate_hz=30.0).times_s
    assert len(times) == 31 + (times[-2] != 1.0 and times[-1] - times[-2] < 0.03)
    assert np.diff(times).max() <= 0.035


def test_progress_shows_a_bar(simulation, capsys):
    seen = []
    simulation.run(0.5, progress=True, on_progress=seen.append)
    shown = capsys.readouterr().err
    assert "flat" in shown
    assert "0.5/0.5 s" in shown
    assert seen[-1].time_s == 0.5


def test_a_notebook_shows_the_simulation(simulation):
    simulation.run(1.0)
    html = simulation._repr_html_()
    assert "<b>flat</b>, seed " in html
    assert "<td>uav1</td><td>TAKE_OFF</td>" in html
    assert "1.000 of " in html
    assert 'src="data:image/png;base64,' in html
