"""A divided run whose worker is a thread of this process, and nodes that it flies."""

import contextlib
import socket
import threading
from pathlib import Path

import numpy as np

from volery.cluster.division.leader import Leader, Member, greeting_of
from volery.cluster.division.link import Link
from volery.cluster.division.partitioning import divided
from volery.cluster.division.worker import RunEndedError, Worker
from volery.core.errors import VoleryError
from volery.graph.messages import Image, LaserScan, Odometry, String, Twist, Vector3
from volery.graph.nodes.node import Node
from volery.runtime import Simulation
from volery.runtime.construction.partition import Partition
from volery.scenario.load import parse_scenario

HERE = Path(__file__).stem


class Weaver(Node):
    """Flies by what its LIDAR sees of the other UAVs, and lands after `lands_after_s`."""

    def __init__(self):
        super().__init__("weaver")
        self.declare_parameter("lands_after_s", 1e9)
        self.declare_parameter("fails_after_s", 1e9)
        self.seen = 0.0
        self.commands = self.create_publisher(Twist, "cmd_vel", 10)
        self.words = self.create_publisher(String, "words", latched=True)
        self.landing = self.create_client("std_srvs/srv/Trigger", "land")
        self.create_subscription(LaserScan, "laser/horizontal/scan", self.on_scan, 5)
        self.create_subscription(Image, "eye/depth", self.on_image, 5)
        self.create_subscription(Odometry, "odom", self.on_odometry, 5)
        self.create_subscription(String, "orders", self.on_order, 5)
        self.create_service("std_srvs/srv/Trigger", "~/dance", self.on_dance)
        self.words.publish(String("hello"))
        self.ordered = self.climb = 0.0
        self.create_timer(0.04, self.on_timer)

    def on_timer(self):
        self.climb = 0.1 * (1.0 if self.climb <= 0.0 else -1.0)
        self.commands.publish(Twist(Vector3(0.0, 0.0, self.climb), Vector3(0.0, 0.0, 0.0)))

    def on_scan(self, scan):
        finite = scan.ranges[np.isfinite(scan.ranges)]
        self.seen = float(finite.sum()) if len(finite) else 0.0

    def on_dance(self, _request, response):
        self.ordered += 0.5
        response.success, response.message = True, f"{self.get_namespace()} dances"
        return response

    def on_image(self, image):
        depth = np.frombuffer(image.data, np.float32)
        self.seen += float(depth[np.isfinite(depth)].sum())

    def on_order(self, order):
        self.ordered = float(order.data)

    def on_odometry(self, odometry):
        now_s = odometry.header.stamp.sec + odometry.header.stamp.nanosec * 1e-9
        if now_s > self.get_parameter("fails_after_s").value:
            raise ValueError("the propeller of thought broke")
        if now_s > self.get_parameter("lands_after_s").value:
            self.landing.call_async()
            return
        speed = 0.3 * np.sin(0.1 * self.seen) + self.ordered
        self.commands.publish(Twist(Vector3(speed, 0.1, 0.0), Vector3(0.0, 0.0, 0.2)))


class Listener(Node):
    """Stores what it receives, and flies by it every .1 s; `starts` a timer too early, if asked."""

    def __init__(self):
        super().__init__("listener")
        self.starts = self.declare_parameter("starts", False).value
        self.seen, self.north = 0.0, 0.0
        self.commands = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(LaserScan, "laser/horizontal/scan", self.on_scan, 5, passive=True)
        self.create_subscription(Odometry, "odom", self.on_odometry, 5, passive=True)
        self.create_timer(0.1, self.on_timer)

    def on_scan(self, scan):
        finite = scan.ranges[np.isfinite(scan.ranges)]
        self.seen = float(finite.sum()) if len(finite) else 0.0

    def on_odometry(self, odometry):
        self.north = odometry.pose.pose.position.y
        if self.starts:
            self.create_timer(0.013, self.on_timer)
            self.starts = False

    def on_timer(self):
        speed = 0.3 * np.sin(0.1 * self.seen) + 0.1 * self.north
        self.commands.publish(Twist(Vector3(speed, 0.1, 0.0), Vector3(0.0, 0.0, 0.2)))


def scenario_of(count=3, node="Weaver", **parameters):
    """Returns a scenario of `count` UAVs that see each other."""
    lidar = {"kind": "lidar", "name": "horizontal", "position_m": [0.0, 0.0, 0.18]}
    camera = {"kind": "camera", "name": "eye", "width": 16, "height": 12, "rate_hz": 10.0}
    sensors = [lidar, camera, {"kind": "imu"}, {"kind": "odometry"}]
    entry = {"node": f"{HERE}:{node}", "parameters": parameters}
    row = {"type": "weaver", "count": count, "position_m": [0.0, 0.0]}
    row |= {"last_position_m": [3.0 * (count - 1), 0.0], "on_start": "take_off"}
    flight = {"take_off_altitude_m": 0.6}
    return parse_scenario(
        {
            "name": "weaving",
            "types": {"weaver": {"flight": flight, "sensors": sensors, "nodes": [entry]}},
            "uavs": [row],
        }
    )


class DividedPair:
    """The leader's simulation, `simulation`, and a worker in a thread."""

    def __init__(self, scenario, *, on_loss=None):
        self.scenario = scenario
        self.shares = divided(scenario, 2)
        self.endings = []
        self.on_loss = on_loss or (lambda _member, reason: self.fail(reason))
        self._threads = []

    def __enter__(self):
        link = self.start_worker()
        self.simulation = Simulation(
            self.scenario, threads=1, partition=Partition(named=self.shares[1])
        ).__enter__()
        self.member = Member(link, self.shares[1])
        self.member.update(*greeting_of(link))
        self.simulation.divide(lambda parts: Leader(parts, [self.member], self.on_loss))
        self.division = self.simulation._engine.division
        return self

    def __exit__(self, *_exception):
        with contextlib.suppress(VoleryError):
            self.member.link.send("end", "the test is over")
        self.member.close()
        self.simulation.close()
        for thread in self._threads:
            thread.join(60.0)
            assert not thread.is_alive()

    def start_worker(self, repeated=0):
        """Starts a worker; returns the leader's link to it."""
        ends = socket.socketpair()
        ours, theirs = Link(ends[0], "worker 1"), Link(ends[1], "the leader")
        ours.show_life()
        theirs.show_life()
        thread = threading.Thread(target=self._serve, args=(theirs, repeated), daemon=True)
        self._threads.append(thread)
        thread.start()
        return ours

    def substitute(self, lost, _reason):
        """Has another worker repeat the part of a lost one."""
        link = self.start_worker(lost.num_answered)
        greeting_of(link)
        for frame in lost.history():
            link.send_bytes(frame)
        return link

    def fail(self, reason):
        raise AssertionError(reason)

    def _serve(self, link, repeated):
        partition = Partition(is_leader=False, named=self.shares[1])
        try:
            with Simulation(self.scenario, threads=1, partition=partition) as simulation:
                self.worker = simulation

                def connect(parts):
                    worker = Worker(parts, link, repeated)
                    worker.greet()
                    return worker

                simulation.divide(connect)
                simulation.follow()
        except RunEndedError as error:
            self.endings.append(str(error))
        except VoleryError as error:
            with contextlib.suppress(VoleryError):
                link.send("failed", str(error))
        finally:
            link.close()
