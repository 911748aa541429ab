"""Verdicts while a flight goes on: what is decided, and what clients receive."""

from __future__ import annotations

import json

import pytest
from made_runs import event_of, flight_of, line, run_of

from volery.runtime import Simulation
from volery.scenario.load import parse_scenario
from volery.verdicts import Outcome
from volery.verdicts.judging import Judge
from volery.verdicts.live_verdicts import TOPIC, LiveVerdicts
from volery.verdicts.observing import TopicRecord

EAST = line([0.0, 0.0, 3.0], [5.0, 0.0, 3.0], 51)  # 1 m/s for 5 s, of 10
STATUS = {"/uav1/status": TopicRecord([1.0, 2.0], {"data": [3.0, 1.0]})}


def outcome(expectation, **parts):
    """Returns the outcome after 5 s of a flight that goes on."""
    events = parts.pop("events", ())
    run = run_of(flight_of([EAST], events=events), expectation, topics=STATUS, **parts)
    (verdict,) = Judge(run.scenario).verdicts(run, is_over=False)
    return verdict.outcome


CRASH = (event_of(2.0, "uav1", "impact", detail="tree 1", speed_m_s=3.0),)
GOAL = {"kind": "arrives", "position_m": [9.0, 0.0]}
VALUE = {"kind": "topic_value", "topic": "status", "at_least": 2.0}
RATE = {"kind": "topic_rate", "topic": "status", "at_least_hz": 50.0}


@pytest.mark.parametrize(
    ("expectation", "expected"),
    [
        ({"kind": "speed", "at_most_m_s": 2.0}, Outcome.PASSED),
        ({"kind": "speed", "at_most_m_s": 0.5}, Outcome.FAILED),
        ({"kind": "speed", "at_most_m_s": 0.5, "from_s": 8.0}, Outcome.PENDING),
        ({"kind": "inside", "region_m": [-1.0, -1.0, 3.0, 1.0]}, Outcome.FAILED),
        (GOAL, Outcome.PENDING),
        ({**GOAL, "by_s": 8.0}, Outcome.PENDING),
        ({**GOAL, "by_s": 4.0}, Outcome.FAILED),
        ({**GOAL, "position_m": [4.0, 0.0]}, Outcome.PASSED),
        ({"kind": "modes", "modes": ["land"]}, Outcome.PENDING),
        (VALUE, Outcome.PASSED),
        ({**VALUE, "when": "at_end"}, Outcome.PENDING),
        ({**VALUE, "when": "always"}, Outcome.FAILED),
        ({**VALUE, "topic": "other", "when": "always"}, Outcome.PENDING),
        ({**VALUE, "at_least": 9.0}, Outcome.PENDING),
        ({**VALUE, "at_least": 9.0, "until_s": 4.0}, Outcome.FAILED),
        (RATE, Outcome.FAILED),
        ({**RATE, "window_s": 6.0}, Outcome.PENDING),
        ({"kind": "area", "at_least_m2": 1e4}, Outcome.PENDING),
        ({"kind": "estimate_error", "at_most_m": 1.0}, Outcome.PENDING),
        ({"kind": "real_time_factor", "at_least": 99.0}, Outcome.PENDING),
        ({"kind": "formula", "formula": "eventually(x > 7)"}, Outcome.PENDING),
    ],
)
def test_what_the_rest_of_a_flight_may_mend_is_pending(expectation, expected):
    assert outcome(expectation) is expected


def test_a_contact_is_final():
    assert outcome({"kind": "no_contact"}) is Outcome.PASSED
    assert outcome({"kind": "no_contact"}, events=CRASH) is Outcome.FAILED


def test_nothing_is_pending_at_the_end():
    run = run_of(flight_of([EAST]), GOAL)
    assert [verdict.outcome for verdict in Judge(run.scenario).verdicts(run)] == [Outcome.FAILED]


HOP = {
    "name": "hop",
    "duration_s": 4.0,
    "types": {"bird": {"airframe": "f450"}},
    "uavs": [{"type": "bird", "position_m": [0.0, 0.0], "on_start": "take_off"}],
    "expect": [
        {"kind": "no_contact"},
        {"kind": "formula", "name": "climbs", "formula": "eventually(z > 1)"},
    ],
}


class Client:
    """Receives the topic from outside."""

    def __init__(self, simulation):
        self._box = simulation.gateway.open("client").subscribe(TOPIC, depth=10, wake=lambda: None)

    def take(self):
        """Returns the tables of the new messages."""
        return [json.loads(published.message.data) for published in self._box.take()]


@pytest.fixture
def simulation():
    with Simulation(parse_scenario(HOP, where="test"), threads=1) as simulation:
        yield simulation


def outcomes(table):
    return {verdict["name"]: verdict["outcome"] for verdict in table["verdicts"]}


def test_clients_receive_verdicts_of_the_flight_so_far_and_at_its_end(simulation):
    live, client = LiveVerdicts(simulation), Client(simulation)
    simulation.run(0.2)
    live.look()
    (table,) = client.take()
    assert (table["over"], table["time_s"]) == (False, 0.2)
    assert outcomes(table) == {"no contact": "passed", "climbs": "pending"}
    live.look()
    assert client.take() == []  # the simulation has not moved
    simulation.run()
    verdicts = live.finish()
    (table,) = client.take()
    assert (table["over"], table["time_s"]) == (True, 4.0)
    assert table["verdicts"] == [verdict.to_data() for verdict in verdicts]
    assert outcomes(table) == {"no contact": "passed", "climbs": "passed"}
    assert json.loads(live.last.message.data) == table


def test_a_client_that_comes_later_receives_the_last_message(simulation):
    live = LiveVerdicts(simulation)
    simulation.run()
    live.finish()
    late = Client(simulation)
    simulation.run(0.0)
    live.look()
    (table,) = late.take()
    assert table["over"]


def test_after_a_reset_the_new_flight_is_judged(simulation):
    live, client = LiveVerdicts(simulation), Client(simulation)
    simulation.run()
    live.finish()
    simulation.reset()
    simulation.run(0.2)
    live.look()
    table = client.take()[-1]
    assert (table["over"], outcomes(table)["climbs"]) == (False, "pending")
    simulation.run()
    assert all(verdict.is_passed for verdict in live.finish())


def test_the_topic_changes_no_digest(simulation):
    digests = []
    for is_watched in (False, True):
        with Simulation(simulation.scenario, threads=1) as flight:
            flight.diagnostics.enable_digest()
            live = LiveVerdicts(flight)
            client = Client(flight) if is_watched else None
            flight.run(on_progress=lambda _progress, live=live: live.look())
            live.finish()
            assert client is None or client.take()
            digests.append(flight.diagnostics.digest())
    assert digests[0] == digests[1]
