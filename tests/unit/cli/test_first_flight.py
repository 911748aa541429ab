"""The flight behind the first page goes on until a client takes part."""

import pytest

from volery.cli.first_flight import RESTART_CHARGE, FirstFlight
from volery.graph.codecs.zero import zero_message
from volery.graph.service_reply import ServiceReply

PACK = 'base = "f450"\n[battery]\ncapacity_ah = 1.2\n'
"""Hovering takes 0.7 % a second."""


@pytest.fixture
def hovering(simulate, flat_data, tmp_path):
    """A UAV that hovers, with charge for some seconds until the flight starts again."""
    (tmp_path / "small.toml").write_text(PACK, encoding="utf-8")
    kind = {"airframe": str(tmp_path / "small.toml"), "battery_charge": 0.25}
    flat_data["types"]["f450"] |= kind
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 3.0]
    flat_data["duration_s"] = 300.0
    return simulate(flat_data)


def call(simulation, service, kind):
    """Calls a service as the page does."""
    answers = []
    reply = ServiceReply(answers.append, answers.append)
    simulation.gateway.open("page").call(service, zero_message(f"{kind}_Request"), reply)
    simulation.process_commands()
    assert len(answers) == 1


def fly(simulation, seconds):
    """Flies with looks as those of the server; returns the largest time and the lowest charge."""
    first, latest_s, min_charge = FirstFlight(simulation), 0.0, 1.0
    for _ in range(round(seconds / 0.1)):
        simulation.run(0.1)
        first.look()
        simulation.process_commands()
        latest_s = max(latest_s, simulation.time_s)
        min_charge = min(min_charge, simulation.uavs["uav1"].battery_charge)
    return latest_s, min_charge


def test_it_starts_again_before_batteries_are_low(hovering):
    latest_s, min_charge = fly(hovering, 30.0)
    assert latest_s < 15.0
    assert min_charge > RESTART_CHARGE - 0.02
    assert not [event for event in hovering.diagnostics.events if event.kind == "battery"]
    assert hovering.uavs["uav1"].mode.name == "HOLD"


def test_a_flight_of_a_client_is_left_alone(hovering):
    call(hovering, "/uav1/hold", "std_srvs/srv/Trigger")
    latest_s, min_charge = fly(hovering, 30.0)
    assert latest_s == pytest.approx(30.0, abs=0.2)
    assert min_charge < RESTART_CHARGE


def test_queries_and_the_pace_are_no_part_in_it(hovering):
    call(hovering, "/volery/get_scenario_options", "volery_interfaces/srv/GetScenarioOptions")
    call(hovering, "/volery/set_speed", "volery_interfaces/srv/SetSpeed")
    latest_s, _ = fly(hovering, 30.0)
    assert latest_s < 15.0
