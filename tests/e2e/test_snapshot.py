"""Going back to a kept state, and to the start, is exact to the bit."""

import time

import numpy as np
import pytest

from volery import Simulation, load_scenario
from volery.core.errors import CommandError, SnapshotError
from volery.graph.messages import Odometry, String
from volery.graph.nodes.node import Node


class Counting(Node):
    """Counts its own messages, saves no state, and publishes from the start."""

    step = 1

    def __init__(self, **options):
        super().__init__(f"counting_{self.step}", **options)
        self.count = 0
        self.out = self.create_publisher(String, "counted", latched=True)
        self.out.publish(String(f"start {self.step}"))
        self.create_subscription(String, "counted", self.on_counted)
        self.create_timer(0.1, self.on_timer)
        self.received = []

    def on_timer(self):
        self.count += self.step
        self.out.publish(String(str(self.count)))

    def on_counted(self, message):
        self.received.append(message.data)


class CountingTwice(Counting):
    """Counts by two."""

    step = 2


class Forgetful(Node):
    """Counts odometry, and does not offer its count."""

    def __init__(self, **options):
        super().__init__("forgetful", **options)
        self.count = 0
        self.create_subscription(Odometry, "odom", self.on_odometry)

    def on_odometry(self, _message):
        self.count += 1


def flown(simulation, seconds):
    simulation.run(seconds)
    return simulation.diagnostics.digest()


def test_restored_flight_repeats_itself(simulate, wood_data):
    wood_data["duration_s"] = 30.0
    simulation = simulate(wood_data)
    simulation.diagnostics.enable_digest()
    simulation.run(6.0037)
    kept = simulation.snapshot()
    first = flown(simulation, 4.0)
    events = simulation.diagnostics.events
    simulation.restore(kept)
    assert simulation.time_ns == kept.time_ns
    assert flown(simulation, 4.0) == first
    assert simulation.diagnostics.events == events

    later = simulation.snapshot()
    beyond = flown(simulation, 1.0)
    simulation.restore(kept)
    simulation.run(0.5)
    simulation.restore(later)
    assert flown(simulation, 1.0) == beyond


def test_states_kept_do_not_change_with_the_flight(simulate, wood_data):
    simulation = simulate(wood_data)
    simulation.diagnostics.enable_digest()
    simulation.run(1.0)
    kept = simulation.snapshot()
    ends = set()
    for _ in range(3):
        simulation.restore(kept)
        ends.add(flown(simulation, 2.0))
    assert len(ends) == 1


def test_reset_is_a_fresh_start(simulate, wood_data):
    fresh = simulate(wood_data)
    fresh.diagnostics.enable_digest()
    expected = flown(fresh, 5.0)
    used = simulate(wood_data)
    used.diagnostics.enable_digest()
    used.run(7.0013)
    used.reset()
    assert used.time_ns == 0
    assert used.diagnostics.events == ()
    assert flown(used, 5.0) == expected


def test_reset_brings_a_wreck_back(simulate, flat_data):
    simulation = simulate(flat_data)
    uav = simulation.uavs["uav1"]
    uav.take_off(5.0)
    simulation.run(5.0)
    uav.command_rotor_speeds([0.0] * 4)
    simulation.run(2.0)
    assert uav.crashed
    simulation.reset()
    uav.take_off(3.0)
    simulation.run(6.0)
    assert not uav.crashed
    assert uav.position_map[2] == pytest.approx(3.1, abs=0.3)


def test_node_that_keeps_no_state_is_named(simulate, flat_data):
    flat_data["types"]["f450"]["nodes"] = [{"node": f"{__name__}:Forgetful"}]
    simulation = simulate(flat_data)
    simulation.run(0.1)
    with pytest.raises(SnapshotError, match=r"set_state\(state\): /uav1/forgetful\."):
        simulation.snapshot()


@pytest.mark.parametrize("latency_s", [0.0, 0.02])
def test_reset_recreates_a_node_without_state(simulate, flat_data, latency_s):
    entry = {"node": f"{__name__}:Counting", "latency_s": latency_s}
    keeping = {"node": "gap_following"}
    twice = {**entry, "node": f"{__name__}:CountingTwice"}
    flat_data["types"]["f450"]["nodes"] = [keeping, entry, twice]

    def counts(simulation):
        for node in simulation.vehicles.nodes:
            node.join()
        return [node.count for node in simulation.vehicles.nodes[1:]]

    def fly(simulation):
        simulation.uavs["uav1"].take_off(2.0)
        simulation.run(1.0)
        return simulation.diagnostics.digest(), counts(simulation)

    fresh, used = simulate(flat_data), simulate(flat_data)
    for simulation in (fresh, used):
        simulation.diagnostics.enable_digest()
    expected = fly(fresh)
    assert expected[1] == [10, 20]
    used.run(0.77)
    for _ in range(3):
        used.reset()
        assert fly(used) == expected
    assert len(used._engine.timer_agenda._heap) == len(fresh._engine.timer_agenda._heap)
    used.vehicles.reset("uav1")
    assert counts(used) == [0, 0]
    used.run(0.5)
    assert counts(used) == [5, 10]
    used.reset()
    assert fly(used) == expected


def test_snapshot_of_another_simulation_is_refused(simulate, flat_data):
    one, other = simulate(flat_data), simulate(flat_data)
    with pytest.raises(SnapshotError, match="another simulation"):
        other.restore(one.snapshot())


def test_posted_restore_takes_the_run_back(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.diagnostics.enable_digest()
    simulation.uavs["uav1"].take_off(2.0)
    simulation.run(1.0)
    kept = simulation.snapshot()
    simulation.run(1.3)
    done = simulation.post(lambda: simulation.restore(kept))
    simulation.step(1)  # to 2.301 s once more
    assert done.done()
    posted = simulation.diagnostics.digest()
    simulation.restore(kept)
    assert flown(simulation, 1.301) == posted


def test_no_snapshot_in_the_middle_of_a_tick(simulate, flat_data):
    simulation = simulate(flat_data)
    problem = []

    def on_odometry(_published):
        try:
            simulation.snapshot()
        except SnapshotError as error:
            problem.append(str(error))

    simulation.graph.subscribe("/uav1/odom", on_odometry)
    simulation.run(0.05)
    assert "middle of a tick" in problem[0]


def test_undelivered_messages_are_kept(simulate, flat_data):
    simulation = simulate(flat_data)
    received = []
    publisher = simulation.graph.advertise("/note", String)
    simulation.graph.subscribe("/note", lambda published: received.append(published.message.data))
    publisher.publish(String("waiting"))
    kept = simulation.snapshot()
    simulation.run(0.01)
    simulation.restore(kept)
    simulation.run(0.01)
    assert received == ["waiting", "waiting"]


def test_a_single_uav_is_reset_and_the_other_flies_on(simulate, flat_data):
    flat_data["uavs"] = [
        {"type": "f450", "position_m": [0.0, 0.0]},
        {"type": "f450", "position_m": [5.0, 0.0]},
    ]

    def accelerations_of(simulation, since_ns):
        got = []
        simulation.graph.subscribe(
            "/uav1/imu",
            lambda p: got.append((p.time_ns - since_ns, p.message.linear_acceleration.z)),
        )
        return got

    used, undisturbed, fresh = (simulate(flat_data) for _ in range(3))
    for simulation in (used, undisturbed):
        simulation.uavs["uav1"].take_off(4.0)
        simulation.uavs["uav2"].take_off(3.0)
        simulation.run(4.0)
        simulation.uavs["uav1"].command_rotor_speeds([0.0] * 4)
        simulation.run(2.0)
    assert used.uavs["uav1"].crashed
    used.vehicles.reset("uav1")
    assert not used.uavs["uav1"].crashed
    again, first = accelerations_of(used, 6_000_000_000), accelerations_of(fresh, 0)
    for simulation in (used, fresh):
        simulation.uavs["uav1"].take_off(2.0)
        simulation.run(3.0)
    undisturbed.run(3.0)
    np.testing.assert_array_equal(used.uavs["uav1"].position_map, fresh.uavs["uav1"].position_map)
    np.testing.assert_array_equal(
        used.uavs["uav2"].position_map, undisturbed.uavs["uav2"].position_map
    )
    assert again == first[1:]  # the first sample was published before the subscription

    used.uavs["uav2"].go_to([0.0, 0.0, 0.4])
    used.uavs["uav1"].go_to([-6.0, 0.0, 3.0])
    used.run(12.0)
    with pytest.raises(CommandError, match="uav1 cannot go back to its start: uav2 is there"):
        used.vehicles.reset("uav1")
    with pytest.raises(CommandError, match="no UAV 'uav7'; known: uav1, uav2"):
        used.vehicles.reset("uav7")


def test_after_a_reset_in_mid_run_the_real_time_factor_holds():
    with Simulation(load_scenario("hover"), threads=1) as simulation:
        simulation.run(1.0)
        simulation.post(simulation.reset)
        start = time.perf_counter()
        simulation.run(0.2, speed=2.0)  # on to where it was to end, from the beginning
        took_s = time.perf_counter() - start
        assert simulation.time_s == pytest.approx(1.2)
    assert took_s > 0.5
