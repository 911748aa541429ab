"""Tests nodes with a computation latency."""

import threading
import time

import pytest

from volery.core.errors import NodeError
from volery.graph.messages import Odometry, String
from volery.graph.nodes.node import Node

LATENCY_NS = 73_000_000
ODOM_PERIOD_NS = 20_000_000


class Thinker(Node):
    """Says the stamp of each odometry message it has thought about, and when it saw it."""

    pause_s = 0.0

    def __init__(self, **options):
        super().__init__("thinker", **options)
        self.threads = set()
        self.seen = 0
        self.answers = []
        self.out = self.create_publisher(String, "thought")
        self.land = self.create_client("std_srvs/srv/Trigger", "land")
        self.create_subscription(Odometry, "odom", self.on_odometry)

    def on_odometry(self, message):
        self.threads.add(threading.current_thread().name)
        time.sleep(self.pause_s)
        self.seen += 1
        stamp = message.header.stamp
        self.out.publish(String(f"{stamp.nanosec} {self.get_clock().now_ns()} {self.seen}"))
        if self.seen == 3:
            self.land.call_async().add_done_callback(self.on_answer)

    def on_answer(self, answer):
        self.answers.append((self.get_clock().now_ns(), answer.result().success))

    def get_state(self):
        return {"seen": self.seen, "answers": self.answers}

    def set_state(self, state):
        self.seen, self.answers = state["seen"], list(state["answers"])


class Slow(Thinker):
    """The same, with a computer that is slow in wall time."""

    pause_s = 0.004


class Impatient(Thinker):
    """Wants to wait for a service."""

    def on_odometry(self, message):
        self.land.call()


class Broken(Thinker):
    """Fails in its callback."""

    def on_odometry(self, message):
        raise ValueError("no idea")


@pytest.fixture
def scenario(flat_data):
    def build(node, latency_s):
        entry = {"node": f"{__name__}:{node.__name__}", "latency_s": latency_s}
        flat_data["types"]["f450"]["nodes"] = [entry]
        return flat_data

    return build


def listen(simulation):
    received = []

    def on_thought(published):
        stamp, seen_at, count = map(int, published.message.data.split())
        received.append((stamp, seen_at, published.time_ns, count))

    simulation.graph.subscribe("/uav1/thought", on_thought)
    return received


def test_output_comes_after_the_latency(simulate, scenario):
    simulation = simulate(scenario(Thinker, LATENCY_NS / 1e9))
    received = listen(simulation)
    simulation.run(0.4)
    stamps = [stamp for stamp, *_ in received]
    assert stamps == [k * ODOM_PERIOD_NS for k in range(len(stamps))]
    assert len(stamps) == 1 + (400_000_000 - LATENCY_NS) // ODOM_PERIOD_NS
    for stamp, seen_at, released_at, _ in received:
        assert seen_at == stamp
        assert released_at == stamp + LATENCY_NS
    (node,) = simulation.vehicles.nodes
    assert node.threads == {"volery-thinker"}


def test_node_without_latency_answers_at_once(simulate, scenario):
    simulation = simulate(scenario(Thinker, 0.0))
    received = listen(simulation)
    simulation.run(0.1)
    assert all(stamp == seen == released for stamp, seen, released, _ in received)
    assert simulation.vehicles.nodes[0].threads == {threading.current_thread().name}


def test_speed_of_the_computer_and_slices_change_nothing(simulate, scenario):
    digests = set()
    for node, slices in ((Thinker, [0.5]), (Slow, [0.5]), (Slow, [0.0103] * 48 + [0.0056])):
        simulation = simulate(scenario(node, 0.05))
        listen(simulation)
        simulation.diagnostics.enable_digest()
        simulation.uavs["uav1"].take_off(2.0)
        for seconds in slices:
            simulation.run(seconds)
        digests.add(simulation.diagnostics.digest())
    assert len(digests) == 1


def test_engine_runs_on_while_a_node_thinks(simulate, scenario):
    """Thinking 20 x 4 ms beside the engine takes less wall time than the sum of both."""
    simulation = simulate(scenario(Slow, 0.05))
    (node,) = simulation.vehicles.nodes
    simulation.run(0.2)
    joined_late = []
    simulation.graph.subscribe("/uav1/odom", lambda _: joined_late.append(node.seen))
    simulation.run(0.2)
    delivered = 11 + len(joined_late)
    assert any(seen < k + 11 for k, seen in enumerate(joined_late)), "the engine waited each time"
    assert delivered >= 20


def test_service_answer_is_a_later_input(simulate, scenario):
    simulation = simulate(scenario(Thinker, 0.05))
    simulation.uavs["uav1"].take_off(2.0)
    simulation.run(0.3)
    (node,) = simulation.vehicles.nodes
    node.join()
    assert node.answers == [(2 * ODOM_PERIOD_NS + 50_000_000, True)]
    assert simulation.uavs["uav1"].mode.name == "LAND"


def test_waiting_for_a_service_is_refused(simulate, scenario):
    simulation = simulate(scenario(Impatient, 0.05))
    with pytest.raises(NodeError, match="use call_async"):
        simulation.run(0.2)


def test_failure_is_reported_with_its_time(simulate, scenario):
    simulation = simulate(scenario(Broken, 0.05))
    with pytest.raises(NodeError, match=r"/uav1/thinker failed at 0\.000 s .* ValueError: no idea"):
        simulation.run(0.2)


def test_snapshot_holds_thoughts_not_yet_spoken(simulate, scenario):
    simulation = simulate(scenario(Slow, LATENCY_NS / 1e9))
    received = listen(simulation)
    simulation.run(0.1)
    kept = simulation.snapshot()
    count = len(received)
    simulation.run(0.2)
    first = received[count:]
    simulation.restore(kept)
    count = len(received)
    simulation.run(0.2)
    assert received[count:] == first
    assert len(first) == 10
