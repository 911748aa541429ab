"""The battery monitor: from the pack to /uavN/battery, and what a scenario may say of it."""

import math

import numpy as np
import pytest

from volery.core.errors import DataFileError, ScenarioError
from volery.engine.events import EventKind


def with_monitor(data, **kind):
    data["types"]["f450"] |= {"sensors": [{"kind": "battery"}], **kind}
    data["uavs"] = [{"type": "f450", "position_m": [0.0, 0.0, 20.0]}]
    return data


def test_publishes_battery_states(flat_data, simulate):
    simulation = simulate(with_monitor(flat_data, battery_charge=0.6))
    received = []
    simulation.graph.subscribe_all(
        lambda p: received.append(p) if p.topic == "/uav1/battery" else None
    )
    simulation.run(5.0)
    assert [p.time_ns for p in received] == [k * 1_000_000_000 for k in range(len(received))]
    assert len(received) >= 5
    state = received[-1].message
    uav = simulation.uavs["uav1"]
    assert state.percentage == pytest.approx(uav.battery_charge, abs=1e-3)
    assert 0.58 < state.percentage < 0.6
    assert state.voltage == pytest.approx(uav.battery_voltage, abs=0.01)
    assert 14.0 < state.voltage < 15.5
    assert 20.0 < -state.current < 30.0
    assert state.charge == pytest.approx(state.percentage * 5.0)
    assert math.isnan(state.temperature)
    np.testing.assert_allclose(state.cell_voltage, [state.voltage / 4] * 4, rtol=1e-6)
    assert len(received[-1].cdr) > 80


def test_low_is_an_event(flat_data, simulate):
    simulation = simulate(with_monitor(flat_data, battery_charge=0.14))
    simulation.run(0.5)
    (event,) = [e for e in simulation.diagnostics.events if e.kind is EventKind.BATTERY]
    assert event.detail == "battery low"
    assert "uav1 battery low at" in event.describe()


def test_a_worn_rotor_and_a_fault(flat_data, simulate):
    simulation = simulate(with_monitor(flat_data, wear=[{"thrust": 0.9}, {}, {}, {}]))
    simulation.run(2.0)
    uav = simulation.uavs["uav1"]
    assert uav.rotor_speed[0] > 1.03 * uav.rotor_speed[1]
    uav.set_rotor_health(1, 0.0)
    simulation.run(0.3)
    assert uav.rotor_speed[1] < 1.0


def test_wear_of_the_wrong_length(flat_data, simulate):
    with pytest.raises(ScenarioError, match=r"flat: types\.f450\.wear has 2 .* 4 rotors"):
        simulate(with_monitor(flat_data, wear=[{}, {}]))


def test_an_airframe_without_a_battery(flat_data, simulate, tmp_path):
    from volery.vehicle import airframe

    text = (airframe._AIRFRAMES / "f450.toml").read_text()
    path = tmp_path / "ideal.toml"
    path.write_text(text[: text.index("[battery]")])
    with pytest.raises(DataFileError, match=r"sensor 'battery': airframe f450 has no battery"):
        simulate(with_monitor(flat_data, airframe=str(path)))
