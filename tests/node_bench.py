"""A graph, a clock and timers around nodes, without a simulation."""

from __future__ import annotations

import itertools

import numpy as np

from volery.graph.graph import Graph
from volery.graph.messages import (
    JointState,
    LaserScan,
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    Twist,
    TwistWithCovariance,
    Vector3,
    header,
)
from volery.graph.nodes.node import Context

NOTHING = np.zeros(36)


class NodeBench:
    """Nodes below `/uav1` and what they publish, by topic."""

    def __init__(self):
        self.now_ns = 0
        self.graph = Graph(lambda: self.now_ns)
        self.context = Context(self.graph, self, lambda: self.now_ns)
        self.received = {}
        self._timers = []
        self._order = itertools.count()

    def every(self, period_s, callback, *, wanted=None):
        self._timers.append([round(period_s * 1e9), round(period_s * 1e9), callback])

    def forget(self, callback):
        self._timers = [entry for entry in self._timers if entry[2] != callback]

    def at(self, time_ns, action):
        raise NotImplementedError

    def start(self, node_class, **parameters):
        return node_class(context=self.context, namespace="/uav1", parameter_overrides=parameters)

    def listen(self, topic):
        self.received[topic] = []
        self.graph.subscribe(topic, lambda p: self.received[topic].append(p.message))
        return self.received[topic]

    def send(self, topic, message):
        """Publish it; its arrays become read-only, as those of the simulation are."""
        for value in vars(message).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        self.graph.advertise(topic, type(message)).publish(message)
        self.graph.deliver()

    def call(self, service, **fields):
        return self.graph.call(service, fields)

    def run_to(self, time_ns):
        """Ring what is due until then, in order of time."""
        while True:
            due = min(self._timers, key=lambda t: t[0], default=None)
            if due is None or due[0] > time_ns:
                break
            self.now_ns = max(self.now_ns, due[0])
            due[0] += due[1]
            due[2]()
            self.graph.deliver()
        self.now_ns = time_ns


def odometry(time_ns, position, velocity=(0.0, 0.0, 0.0), yaw=0.0, frame="uav1/odom"):
    turn = Quaternion(0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))
    c, s = np.cos(yaw), np.sin(yaw)
    x, y, z = velocity
    body = Vector3(float(c * x + s * y), float(c * y - s * x), float(z))
    return Odometry(
        header(time_ns, frame),
        "uav1/base_link",
        PoseWithCovariance(Pose(Point(*map(float, position)), turn), NOTHING),
        TwistWithCovariance(Twist(body, Vector3(0.0, 0.0, 0.0)), NOTHING),
    )


def scan(time_ns, ranges, first=-np.pi, last=np.pi, sweep_s=0.01):
    """A level scan whose beams go from `first` to `last`."""
    ranges = np.asarray(ranges, np.float32)
    steps = max(len(ranges) - 1, 1)
    return LaserScan(
        header(time_ns, "uav1/laser_horizontal"),
        first,
        last,
        (last - first) / steps,
        sweep_s / steps,
        0.025,
        0.1,
        30.0,
        ranges,
        np.zeros(0, np.float32),
    )


def nod(time_ns, angle, rate=0.0):
    return JointState(
        header(time_ns, ""),
        ["laser_nodding"],
        np.array([angle]),
        np.array([rate]),
        np.zeros(0),
    )
