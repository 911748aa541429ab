"""Falling batteries: warnings at each level, and the actions of PX4's COM_LOW_BAT_ACT."""

import json
import logging

import pytest

from volery.core.errors import CommandError
from volery.graph.messages import String

PACK = 'base = "f450"\n[battery]\ncapacity_ah = 1.2\n'
"""Hovering takes 0.7 % a second."""


@pytest.fixture
def weak(flat_data, tmp_path):
    """Hovers at 3 m on the last 16 % of a small pack."""
    (tmp_path / "weak.toml").write_text(PACK)
    flat_data["types"]["f450"] = {
        "airframe": str(tmp_path / "weak.toml"),
        "battery_charge": 0.16,
        "sensors": [],
    }
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 3.0]
    return flat_data


def received_events(simulation):
    events = []
    simulation.graph.subscribe(
        "/events", lambda p: events.append(json.loads(p.message.data)), String
    )
    return events


def test_each_level_is_warned_of_on_terminal_and_topic(simulate, weak, caplog):
    simulation = simulate(weak)
    events = received_events(simulation)
    with caplog.at_level(logging.WARNING):
        simulation.run_until("impact", timeout_s=60.0)
    levels = [event["detail"] for event in events if event["kind"] == "battery"]
    assert levels == ["battery low", "battery critical", "battery emergency", "battery empty"]
    warnings = [record.getMessage() for record in caplog.records]
    assert len(warnings) == 4
    for text, level in zip(warnings, levels, strict=True):
        assert f"uav1: {level}, " in text
    assert "15 % left" in warnings[0]
    assert warnings[3].endswith("its rotors stop")


@pytest.mark.parametrize(
    ("action", "modes"), [("land", ["LAND", "LANDED"]), ("return", ["RETURN", "LAND", "LANDED"])]
)
def test_its_action_brings_it_down_in_time(simulate, weak, action, modes, caplog):
    weak["types"]["f450"]["flight"] = {"low_battery_action": action, "return_altitude_m": 0.5}
    simulation = simulate(weak)
    uav = simulation.uavs["uav1"]
    uav.go_to((30.0, 0.0, 3.0))
    simulation.run_until(lambda: uav.battery_charge < 0.07, timeout_s=60.0)
    simulation.run(0.1)
    assert uav.mode.name == modes[0]
    seen = [uav.mode.name]

    def is_down():
        if uav.mode.name != seen[-1]:
            seen.append(uav.mode.name)
        return bool(uav.mode.name in ("LANDED", "CRASHED"))

    simulation.run_until(is_down, timeout_s=60.0)
    assert seen == modes
    assert uav.battery_charge > 0.0
    events = [event.detail for event in simulation.diagnostics.events]
    assert f"changed to {modes[0]}: battery critical" in events
    assert any(
        "it lands" in r.getMessage() or "it returns" in r.getMessage() for r in caplog.records
    )


def test_a_later_command_replaces_the_action(simulate, weak):
    weak["types"]["f450"]["flight"] = {"low_battery_action": "land"}
    simulation = simulate(weak)
    uav = simulation.uavs["uav1"]
    simulation.run_until(lambda: uav.mode.name == "LAND", timeout_s=60.0)
    uav.hold()
    simulation.run(0.2)
    assert uav.mode.name == "HOLD"


@pytest.mark.parametrize(
    ("charge", "action", "reason"),
    [
        (0.06, "land", r'its battery is critical \(6 %\), at which low_battery_action = "land"'),
        (0.04, "return", r"its battery is emergency \(4 %\)"),
        (0.0001, "warn", r"its battery is empty \(0 %\); a reset charges it"),
    ],
)
def test_a_take_off_that_could_not_last_is_refused(simulate, weak, charge, action, reason):
    weak["types"]["f450"] |= {"battery_charge": charge, "flight": {"low_battery_action": action}}
    weak["uavs"][0]["position_m"] = [0.0, 0.0]
    simulation = simulate(weak)
    simulation.run(3.0)
    for take_off in (simulation.uavs["uav1"].take_off, simulation.vehicles.take_off):
        with pytest.raises(CommandError, match=f"uav1 cannot take off: {reason}"):
            take_off(2.0)
    assert simulation.uavs["uav1"].mode.name == "LANDED"


def test_a_low_battery_that_only_warns_takes_off(simulate, weak):
    weak["types"]["f450"]["battery_charge"] = 0.06
    weak["uavs"][0]["position_m"] = [0.0, 0.0]
    simulation = simulate(weak)
    simulation.run(1.0)
    simulation.uavs["uav1"].take_off(1.0).wait()
    assert simulation.uavs["uav1"].mode.name == "HOLD"


@pytest.mark.parametrize(
    ("position_m", "plant", "ending"),
    [
        ([0.0, 0.0], "rigid_body", "0 % left"),
        ([0.0, 0.0, 3.0], "kinematic", "its plant flies on without it"),
    ],
)
def test_rotors_stop_only_where_they_turn(simulate, weak, caplog, position_m, plant, ending):
    weak["types"]["f450"] |= {"battery_charge": 0.0001, "plant": plant}
    weak["uavs"][0]["position_m"] = position_m
    simulation = simulate(weak)
    with caplog.at_level(logging.WARNING):
        simulation.run(3.0)
    assert caplog.records[-1].getMessage().endswith(ending)
