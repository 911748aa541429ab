"""A graph with a thread that stands in for the simulation's, and a peer without sockets."""

from __future__ import annotations

import json
from concurrent.futures import Future

from live_graph import LiveGraph

from volery.bridges.rosbridge.message_encoder import MessageEncoder
from volery.bridges.rosbridge.protocol import RosbridgePeer, ServerContext
from volery.graph.graph import Graph
from volery.graph.messages import message_type
from volery.graph.session import Gateway

STRING = "std_msgs/msg/String"
TRIGGER = "std_srvs/srv/Trigger"
SET_BOOL = "std_srvs/srv/SetBool"
STEPS = "simulation_interfaces/action/SimulateSteps"
TIME_NS = 5_000_000_007


class FakeSimulation(LiveGraph):
    """Does what is posted, in a thread of its own, and delivers."""

    def __init__(self) -> None:
        super().__init__(lambda: TIME_NS)

    def publish(self, topic, message, *, latched=False):
        publisher = self.graph.advertise(topic, message.__msgtype__, latched=latched)
        self.do(lambda: publisher.publish(message))
        return publisher


class Bench:
    """A graph whose posts are done at once, and peers on it."""

    def __init__(self, **shared) -> None:
        self.graph = Graph(lambda: TIME_NS, self._post)
        self.gateway = Gateway(self.graph, self._post)
        generation = shared.pop("generation", "ros2")
        self.shared = ServerContext(MessageEncoder(generation), now_ns=lambda: TIME_NS, **shared)
        self.now_s = 100.0
        self._depth = 0

    def _post(self, action) -> Future:
        future: Future = Future()
        try:
            future.set_result(action())
        except Exception as error:
            future.set_exception(error)
        if self._depth == 0:
            self._depth = 1
            self.graph.deliver()
            self._depth = 0
        return future

    def peer(self, name="client") -> Client:
        return Client(self, name)


class Client:
    """A peer and the client at its other end."""

    def __init__(self, bench: Bench, name: str) -> None:
        self.bench = bench
        self.wakes = 0
        self.peer = RosbridgePeer(
            bench.gateway.open(name), bench.shared, wake=self._wake, post=lambda action: action()
        )

    def _wake(self) -> None:
        self.wakes += 1

    def send(self, op, **fields) -> None:
        self.send_raw(json.dumps({"op": op, **fields}))

    def send_raw(self, frame) -> None:
        self.peer.receive(frame, self.bench.now_s)

    def frames(self):
        return list(self.peer.frames(self.bench.now_s))

    def read(self):
        return [json.loads(frame) for frame in self.frames()]

    def data(self):
        return [m["msg"]["data"] for m in self.read() if m["op"] == "publish"]


def trigger_response(success, message):
    return message_type(f"{TRIGGER}_Response")(success, message)
