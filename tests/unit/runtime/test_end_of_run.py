"""A scenario that ends while clients are connected: it waits, says so, and continues on request."""

from contextlib import suppress

import pytest
from service_calls import call_service, code_of, request_of

from volery.core.errors import GraphError
from volery.graph.service_reply import ServiceReply
from volery.runtime.services.simulation_state import RunState

STANDARD_REFUSALS = (
    ("/set_simulation_state", {"state": {"state": int(RunState.PLAYING)}}),
    ("/step_simulation", {"steps": 5}),
)


class EndedError(Exception):
    """Ends the wait."""


class Client:
    """Calls services from outside, while a simulation waits at its end."""

    def __init__(self, simulation):
        self.simulation = simulation
        self.session = simulation.gateway.open("test")

    def at_end(self, *calls):
        """Responses to calls that are made while the simulation waits; then the wait ends."""
        responses = []

        def look():
            if len(responses) < len(calls):
                service, fields = calls[len(responses)]
                reply = ServiceReply(responses.append, responses.append)
                request = request_of(self.simulation.graph, service, **fields)
                self.session.call(service, request, reply)
                self.simulation.process_commands()
            elif self.simulation.clock.finished:
                raise EndedError

        with suppress(EndedError):
            self.simulation.wait_at_end(look)
        assert len(responses) == len(calls)
        return responses


@pytest.fixture
def ended(simulate, flat_data):
    simulation = simulate(flat_data | {"duration_s": 0.05})
    simulation.run()
    assert simulation.clock.finished
    return simulation


@pytest.mark.parametrize(("service", "fields"), STANDARD_REFUSALS)
def test_services_of_the_standard_refuse_with_a_reason(ended, service, fields):
    (response,) = Client(ended).at_end((service, fields))
    assert code_of(response) != 1
    assert "the scenario ended at 0.1 s" in response.result.error_message
    assert ended.time_ns == 50_000_000


@pytest.mark.parametrize(
    ("service", "fields"),
    [
        ("/uav1/land", {}),
        ("/uav1/go_to", {"position": {"x": 1.0, "y": 0.0, "z": 5.0}}),
        ("/volery/set_weather", {}),
        ("/volery/inject_fault", {}),
    ],
)
def test_commands_without_effect_are_refused(ended, service, fields):
    (response,) = Client(ended).at_end((service, fields))
    assert isinstance(response, GraphError)
    assert "/volery/continue_run" in str(response)


def test_what_only_asks_is_answered(ended):
    (state,) = Client(ended).at_end(("/get_simulation_state", {}))
    assert state.state.state == RunState.PAUSED


def test_the_status_says_so(ended):
    seen = []
    queue = ended.gateway.open("page").subscribe("/volery/status", wake=lambda: None)

    def look():
        seen.extend(published.message.ended for published in queue.take())
        if True in seen:
            raise EndedError

    with pytest.raises(EndedError):
        ended.wait_at_end(look)
    assert not ended.waits_at_end


def test_it_flies_on_where_asked(ended):
    client = Client(ended)
    (response,) = client.at_end(("/volery/continue_run", {}))
    assert response.success
    assert not ended.clock.paused
    ended.run(0.02)
    assert not ended.clock.finished
    assert ended.time_ns == 70_000_000
    assert call_service(ended, "/uav1/take_off").success


def test_a_run_to_the_end_past_the_end_lasts_until_somebody_quits(ended):
    Client(ended).at_end(("/volery/continue_run", {}))

    def look(progress):
        if progress.time_s > 0.5:
            ended.clock.quit()

    ended.run(on_progress=look)
    assert ended.time_s > 0.5


def test_a_reset_brings_the_end_back(ended):
    client = Client(ended)
    client.at_end(("/volery/continue_run", {}))
    ended.run(0.1)
    ended.reset()
    ended.run()
    assert ended.time_ns == 50_000_000


def test_a_reset_ends_the_wait(ended):
    (response,) = Client(ended).at_end(("/reset_simulation", {"scope": 255}))
    assert code_of(response) == 1
    assert not ended.clock.finished
    assert not ended.waits_at_end


def test_only_an_ended_run_is_continued(simulate, flat_data):
    response = call_service(simulate(flat_data), "/volery/continue_run")
    assert not response.success
    assert "has not ended" in response.message
