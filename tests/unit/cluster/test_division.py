"""Divided runs: the same states and messages as on one machine, whatever the clients do."""

import numpy as np
import pytest
from divided_pair import DividedPair, scenario_of

from volery.core.errors import VoleryError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import PointCloud2, String, Twist, Vector3
from volery.graph.service_reply import ServiceReply
from volery.runtime import Simulation

TWIST = "geometry_msgs/msg/Twist"


def nothing(_simulation):
    """Does nothing during a flight."""


def flown(simulation, act):
    """Flies for 4 s; `act(simulation)` is called each 1.3 s."""
    simulation.diagnostics.enable_digest()
    for _ in range(3):
        simulation.run(1.3)
        act(simulation)
    simulation.run(0.1)
    return simulation.diagnostics.digest(by_topic=True)


def both(scenario, act=nothing):
    """Returns the digests of one machine and of two."""
    with Simulation(scenario, threads=1) as simulation:
        alone = flown(simulation, act)
    with DividedPair(scenario) as pair:
        together = flown(pair.simulation, act)
    return alone, together


def test_two_machines_compute_what_one_computes():
    alone, together = both(scenario_of())
    assert together == alone


def test_nodes_of_workers_land_their_uavs():
    modes = []
    alone, together = both(
        scenario_of(lands_after_s=2.0),
        lambda simulation: modes.append([uav.mode.name for uav in simulation.uavs.values()]),
    )
    assert together == alone
    assert modes[2] == modes[5]
    assert modes[0] != modes[2]
    assert modes[2] in (["LAND"] * 3, ["LANDED"] * 3)


def test_commands_of_clients_reach_the_nodes_and_uavs_of_workers():
    def act(simulation):
        session = simulation.gateway.open("pilot 7")
        session.advertise("/uav3/orders", "std_msgs/msg/String")
        session.publish("/uav3/orders", String("0.7"))
        session.advertise("/uav2/cmd_vel", TWIST)
        session.publish("/uav2/cmd_vel", Twist(Vector3(0.9, 0.0, 0.1), Vector3(0.0, 0.0, 0.0)))
        session.call("/uav1/hold", None, ServiceReply(lambda _: None, lambda _: None))

    quiet, _ = both(scenario_of())
    alone, together = both(scenario_of(), act)
    assert together == alone
    assert alone != quiet


def test_services_of_nodes_on_workers_respond_to_clients():
    answers = []

    def act(simulation):
        session = simulation.gateway.open("pilot 7")
        reply = ServiceReply(answers.append, answers.append)
        session.call("/uav3/weaver/dance", None, reply)

    alone, together = both(scenario_of(), act)
    assert together == alone
    assert [answer.message for answer in answers] == ["/uav3 dances"] * 6


def test_services_of_lost_workers_fail():
    failures = []
    with DividedPair(scenario_of(), on_loss=lambda *_: None) as pair:
        pair.simulation.run(0.1)
        assert "/uav3/weaver/dance" in pair.simulation.graph.services()
        session = pair.simulation.gateway.open("pilot 7")
        session.call("/uav3/weaver/dance", None, ServiceReply(failures.append, failures.append))
        pair.member.link.close()
        pair.simulation.run(0.1)
        assert "/uav3/weaver/dance" not in pair.simulation.graph.services()
    assert [str(each) for each in failures] == ["service '/uav3/weaver/dance': its worker is lost"]


def test_a_reset_by_a_client_resets_all_machines():
    def act(simulation):
        session = simulation.gateway.open("pilot 7")
        answered = []
        session.call("/reset_simulation", None, ServiceReply(answered.append, answered.append))
        simulation.process_commands()
        assert answered[0].result.result == 1
        assert simulation.time_s == 0.0

    alone, together = both(scenario_of(), act)
    assert together == alone


def test_uavs_that_clients_spawn_are_the_leaders():
    with DividedPair(scenario_of()) as pair:
        spawn(pair.simulation)
        pair.simulation.run(0.5)
        assert "/guest/weaver" in pair.simulation.diagnostics.nodes
        assert list(pair.worker.uavs) == list(pair.simulation.uavs)
        assert "/guest/weaver" not in pair.worker.diagnostics.nodes


def spawn(simulation):
    request = zero_message("simulation_interfaces/srv/SpawnEntity_Request")
    request.name, request.entity_resource.uri = "guest", "weaver"
    request.initial_pose.pose.position.y = 6.0
    answered = []
    session = simulation.gateway.open("pilot 7")
    session.call("/spawn_entity", request, ServiceReply(answered.append, answered.append))
    simulation.process_commands()
    assert answered[0].result.result == 1, answered[0]


def test_the_leaders_clients_receive_what_workers_sense():
    scans, returns, words = [], [], []
    with DividedPair(scenario_of()) as pair:
        graph = pair.simulation.graph
        assert "/uav3/laser/horizontal/scan" in {topic.name for topic in graph.topics()}
        graph.attach("/uav3/laser/horizontal/scan", scans.append, "sensor_msgs/msg/LaserScan")
        graph.attach("/uav3/laser/horizontal/points", returns.append, PointCloud2)
        pair.simulation.run(0.3)
        graph.subscribe("/uav3/words", words.append, String)
        pair.simulation.run(0.1)
    assert len(scans) > 10
    assert len(returns) == len(scans)
    assert [published.message.data for published in words] == ["hello"]


def test_what_has_no_subscribers_does_not_cross():
    with DividedPair(scenario_of()) as pair:
        pair.simulation.run(0.1)
        crossed = []
        apply = pair.division._inbox.apply

        def noted(items):
            crossed.extend(item[1] for item in items)
            apply(items)

        pair.division._inbox.apply = noted
        pair.simulation.run(0.3)
    assert set(crossed) == {"/uav3/cmd_vel"}


def test_machines_do_not_meet_for_messages_of_passive_subscriptions():
    scenario = scenario_of(node="Listener")
    alone, together = both(scenario)
    assert together == alone
    with DividedPair(scenario) as pair:  # without a digest, which has all messages cross
        pair.simulation.run(2.05)
        assert 20 <= pair.division._exchanges < 26  # timers, events, and the end
        found = pair.simulation._engine.fleet.state.position_map.copy()
    with Simulation(scenario, threads=1) as simulation:
        simulation.run(2.05)
        np.testing.assert_array_equal(found, simulation._engine.fleet.state.position_map)


def test_a_passive_subscription_cannot_start_timers_in_a_divided_run():
    failing = pytest.raises(VoleryError, match=r"a timer is due between two barriers.*passive")
    with DividedPair(scenario_of(node="Listener", starts=True)) as pair, failing:
        pair.simulation.run(0.5)


def test_the_part_of_a_lost_worker_is_repeated_and_goes_on():
    scenario = scenario_of(lands_after_s=3.0)

    def act(simulation):
        session = simulation.gateway.open("pilot 7")
        session.advertise("/uav3/orders", "std_msgs/msg/String")
        session.publish("/uav3/orders", String("0.4"))

    with Simulation(scenario, threads=1) as simulation:
        alone = flown(simulation, act)
    losses = []
    with DividedPair(scenario) as pair:

        def replace(lost, reason):
            losses.append(reason)
            return pair.substitute(lost, reason)

        pair.division._substitute = replace

        def lose(simulation):
            act(simulation)
            pair.member.link.close()

        together = flown(pair.simulation, lose)
    assert len(losses) == 3
    assert together == alone


def test_a_run_can_go_on_without_a_lost_worker():
    with DividedPair(scenario_of(), on_loss=lambda *_: None) as pair:
        pair.simulation.run(3.0)
        pair.member.link.close()
        pair.simulation.run(1.0)
        assert pair.simulation.time_s == pytest.approx(4.0)
        modes = [uav.mode.name for uav in pair.simulation.uavs.values()]
    assert modes == ["VELOCITY", "VELOCITY", "HOLD"]


def test_a_node_that_fails_on_a_worker_ends_the_run():
    failing = pytest.raises(VoleryError, match="propeller of thought")
    with DividedPair(scenario_of(fails_after_s=0.1)) as pair, failing:
        pair.simulation.run(0.5)


def test_machines_that_compute_other_states_are_found_out():
    with DividedPair(scenario_of()) as pair:
        pair.simulation.run(0.1)
        state = pair.worker._engine.fleet.state
        state.position_map[0, 0] += 1e-9
        with pytest.raises(VoleryError, match="worker 1 computes other states than this machine"):
            pair.simulation.run(1.0)
