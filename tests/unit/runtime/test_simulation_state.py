"""The simulation's state, steps and worlds, by the standard."""

import time

import pytest
from service_calls import call_service, code_of, start_call
from test_pause import InThread, wait_for

from volery.core.errors import CommandError, GraphError
from volery.graph.actions import GoalStatus
from volery.graph.messages import message_type
from volery.scenario import library

STOPPED, PLAYING, PAUSED, QUITTING = range(4)
OK, UNSUPPORTED, NOT_FOUND, INCORRECT_STATE, FAILED = 1, 0, 2, 3, 4
ALREADY, WRONG_TRANSITION, NO_RESOURCE = 101, 103, 102


def state(simulation):
    return call_service(simulation, "/get_simulation_state").state.state


def enter(simulation, wanted):
    return code_of(call_service(simulation, "/set_simulation_state", state={"state": wanted}))


def test_features_name_what_works_alone(simulate, flat_data):
    def features(**options):
        response = simulate(flat_data, **options).graph.call("/get_simulator_features")
        return set(response.features.features.tolist())

    plain = features()
    assert {0, 1, 10, 11, 20, 23, 24, 25, 26, 31, 32, 33, 45, 50} <= plain
    assert not plain & {7, 9, 13, 40, 41, 43}
    assert features(on_load=print) - plain == {40, 43}


def test_playing_pausing_stopping(simulate, flat_data):
    simulation = simulate(flat_data)
    assert state(simulation) == PLAYING
    assert enter(simulation, PLAYING) == ALREADY
    simulation.run(0.1)
    assert enter(simulation, PAUSED) == OK
    assert simulation.clock.paused
    assert state(simulation) == PAUSED
    assert enter(simulation, STOPPED) == OK
    assert state(simulation) == STOPPED
    assert simulation.time_ns == 0
    assert enter(simulation, PAUSED) == WRONG_TRANSITION
    assert enter(simulation, PLAYING) == OK
    assert state(simulation) == PLAYING
    assert not simulation.clock.paused
    for wanted in (4, 5, 77):
        assert enter(simulation, wanted) == WRONG_TRANSITION


def test_quitting_ends_a_run_and_later_ones(simulate, flat_data):
    simulation = simulate(flat_data)
    with InThread(simulation, None, speed=1.0):
        simulation.post(lambda: enter(simulation, QUITTING)).result(60.0)
    assert simulation.time_s < 30.0
    assert simulation.clock.finished
    assert state(simulation) == QUITTING
    before = simulation.time_ns
    simulation.run(1.0)
    assert simulation.time_ns == before
    assert enter(simulation, PLAYING) == WRONG_TRANSITION


def test_quitting_ends_a_paused_run(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.clock.pause()
    with InThread(simulation, None):
        simulation.clock.quit()
    assert simulation.time_ns == 0


def test_reset(simulate, flat_data):
    simulation = simulate(flat_data)
    for scope in (0, 1 | 2, 1 | 2 | 4, 255):
        simulation.run(0.1)
        assert code_of(call_service(simulation, "/reset_simulation", scope=scope)) == OK
        assert simulation.time_ns == 0
    for scope, code in ((1, UNSUPPORTED), (2, UNSUPPORTED), (64, FAILED)):
        assert code_of(call_service(simulation, "/reset_simulation", scope=scope)) == code


def test_reset_of_what_was_spawned(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.run(0.1)
    simulation.vehicles.spawn("extra", "f450", [20.0, 0.0, 0.0])
    response = call_service(simulation, "/reset_simulation", scope=1 | 2)
    assert code_of(response) == UNSUPPORTED
    assert "SCOPE_SPAWNED" in response.result.error_message
    assert code_of(call_service(simulation, "/reset_simulation", scope=4)) == OK
    assert simulation.vehicles.names == ("uav1",)
    assert simulation.time_ns == 100_000_000
    simulation.vehicles.spawn("extra", "f450", [20.0, 0.0, 0.0])
    assert code_of(call_service(simulation, "/reset_simulation", scope=1 | 2 | 4)) == OK
    assert simulation.vehicles.names == ("uav1",)
    assert simulation.time_ns == 0


def test_a_reset_that_cannot_be_is_reported(simulate, flat_data):
    simulation = simulate(flat_data)
    partner = simulation.clock.add_partner("other", period_s=0.1)
    response = call_service(simulation, "/reset_simulation")
    assert code_of(response) == FAILED
    assert "other" in response.result.error_message
    assert enter(simulation, STOPPED) == 102
    assert not simulation.clock.paused
    partner.leave()


def test_steps_are_answered_when_they_are_made(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.clock.pause()
    first = start_call(simulation, "/step_simulation", steps=7)
    second = start_call(simulation, "/step_simulation", steps=250)
    assert not first
    with InThread(simulation, 5.0):
        wait_for(lambda: second)
        assert simulation.time_ns == 257_000_000
        assert code_of(first[0]) == code_of(second[0]) == OK
        simulation.clock.quit()


@pytest.mark.parametrize(("steps", "code"), [(0, FAILED), (2**63, FAILED)])
def test_steps_that_are_none(simulate, flat_data, steps, code):
    simulation = simulate(flat_data)
    simulation.clock.pause()
    (response,) = start_call(simulation, "/step_simulation", steps=steps)
    assert code_of(response) == code


def test_steps_while_playing_are_refused(simulate, flat_data):
    simulation = simulate(flat_data)
    (response,) = start_call(simulation, "/step_simulation", steps=1)
    assert code_of(response) == INCORRECT_STATE
    with pytest.raises(GraphError, match="call_async"):
        call_service(simulation, "/step_simulation", steps=1)


@pytest.mark.parametrize(
    ("end", "why"),
    [
        (lambda s: s.clock.resume(), "the simulation continues"),
        (lambda s: s.reset(), "reset"),
        (lambda s: s.clock.quit(), "quits"),
        (lambda s: s.close(), "closed"),
    ],
)
def test_steps_that_are_interrupted_are_answered(simulate, flat_data, end, why):
    simulation = simulate(flat_data)
    simulation.clock.pause()
    responses = start_call(simulation, "/step_simulation", steps=5)
    end(simulation)
    assert code_of(responses[0]) == FAILED
    assert "0 of 5" in responses[0].result.error_message
    assert why in responses[0].result.error_message


def send(simulation, steps):
    feedback, ended = [], []
    goal = message_type("simulation_interfaces/action/SimulateSteps_Goal")(steps=steps)
    actions = simulation.graph.actions
    handle = actions.send_goal(
        "/simulate_steps", goal, feedback.append, lambda *how: ended.append(how)
    )
    return handle, feedback, ended


def test_the_action_reports_its_progress(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.clock.pause()
    goal, feedback, ended = send(simulation, 350)
    with InThread(simulation, 5.0):
        wait_for(lambda: ended)
        simulation.clock.quit()
    progress = [(one.completed_steps, one.remaining_steps) for one in feedback]
    assert progress == [(100, 250), (200, 150), (300, 50), (350, 0)]
    ((status, response),) = ended
    assert status is GoalStatus.SUCCEEDED
    assert code_of(response) == OK
    assert not goal.cancel()


def test_the_action_can_be_cancelled_and_refused(simulate, flat_data):
    simulation = simulate(flat_data)
    _, _, ended = send(simulation, 5)
    assert ended[0][0] is GoalStatus.ABORTED
    assert code_of(ended[0][1]) == INCORRECT_STATE
    simulation.clock.pause()
    goal, _, ended = send(simulation, 1_000_000)
    behind, _, ended_behind = send(simulation, 20)
    assert goal.cancel()
    assert ended[0][0] is GoalStatus.CANCELED
    assert not goal.cancel()
    with InThread(simulation, 5.0):
        wait_for(lambda: ended_behind)
        assert simulation.time_ns == 20_000_000
        simulation.clock.quit()
    assert behind.status is GoalStatus.SUCCEEDED
    simulation.graph.actions.destroy_server("/simulate_steps")
    with pytest.raises(GraphError, match="no server"):
        send(simulation, 1)


def test_worlds_are_the_scenarios_of_the_library(simulate, flat_data):
    simulation = simulate(flat_data)
    worlds = call_service(simulation, "/get_available_worlds").worlds
    assert [world.world_resource.uri for world in worlds] == library.names()
    woods = call_service(simulation, "/get_available_worlds", filter={"tags": ["forest"]}).worlds
    assert 0 < len(woods) < len(worlds)
    response = call_service(simulation, "/get_available_worlds", additional_sources=["/tmp"])
    assert code_of(response) == UNSUPPORTED
    current = call_service(simulation, "/get_current_world").world
    assert current.name == "flat"
    assert current.world_resource.uri == ""


def test_loading_is_the_owners_business(simulate, flat_data):
    wanted = {"world_resource": {"uri": "hover"}}
    alone = simulate(flat_data)
    assert code_of(call_service(alone, "/load_world", **wanted)) == UNSUPPORTED
    assert code_of(call_service(alone, "/unload_world")) == UNSUPPORTED
    loaded = []
    simulation = simulate(flat_data, on_load=loaded.append)
    response = call_service(simulation, "/load_world", **wanted)
    assert code_of(response) == OK
    assert response.world.name == loaded[0].name == "hover"
    for source, code in (
        ({"uri": "nowhere"}, NOT_FOUND),
        ({"uri": "../../etc/passwd"}, NOT_FOUND),
        ({}, NO_RESOURCE),
        ({"resource_string": "<sdf/>"}, 101),
    ):
        assert code_of(call_service(simulation, "/load_world", world_resource=source)) == code
    assert len(loaded) == 1
    assert code_of(call_service(simulation, "/unload_world")) == OK
    assert loaded[1] is None

    def refuse(name):
        raise CommandError(f"no memory for {name}")

    response = call_service(simulate(flat_data, on_load=refuse), "/load_world", **wanted)
    assert code_of(response) == FAILED
    assert "no memory" in response.result.error_message


def test_requests_of_other_threads_reach_a_paused_run(simulate, flat_data):
    simulation = simulate(flat_data)
    session = simulation.gateway.open("client")
    responses = []
    simulation.clock.pause()
    with InThread(simulation, 5.0):
        from volery.graph.service_reply import ServiceReply

        request = message_type("simulation_interfaces/srv/StepSimulation_Request")(steps=3)
        session.call("/step_simulation", request, ServiceReply(responses.append, responses.append))
        wait_for(lambda: responses)
        assert code_of(responses[0]) == OK
        assert simulation.time_ns == 3_000_000
        time.sleep(0.05)
        assert simulation.time_ns == 3_000_000
        simulation.clock.quit()
    session.close()
