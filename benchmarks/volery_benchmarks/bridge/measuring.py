"""Runs the simulations of the bench in real time while clients measure."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.ros_tcp.endpoint import RosTcpEndpoint
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.core.errors import VoleryError
from volery.graph.messages import Header, Time, message_type
from volery.graph.topics import Publisher
from volery.runtime import Simulation
from volery.scenario.load import load_scenario, parse_scenario
from volery.scenario.schema import Scenario
from volery_benchmarks.bridge.latency_figures import (
    IMAGE_BYTES,
    TRIALS,
    end_point_figures,
    fit_line,
    one_way_latencies,
    size_figures,
)
from volery_benchmarks.bridge.native_ros1 import one_way_figures
from volery_benchmarks.registry import Measured

IMAGES_A_SIZE = 100
IMAGE_TOPIC = "/bench/image"
_IMAGE_PERIOD_S = 0.02
_ROUND_TRIPS = 1000
_STOPS = 100
_SAFE_HEIGHT_M = 50.0
"""Height at which the UAV recovers, m; it falls a little at each stop."""
_STREAM_S = 10.0
_CLIENT_TIMEOUT_S = 120.0
_IMAGE = "sensor_msgs/msg/Image"
_TRIGGER = "std_srvs/srv/Trigger"


def measure() -> Measured:
    """Returns the figures of the bench `bridge`."""
    figures: dict[str, float] = {}
    failures: dict[str, str] = {}
    with running(load_scenario("hover")) as world:
        images = image_latencies(world)
        alpha, beta = fit_line(images)
        figures["ros_tcp_alpha_s_per_mb"], figures["ros_tcp_beta_s"] = alpha, beta
        figures.update(size_figures(images))
        trips = 1e3 * np.array(world.ros_tcp("round_trips", "uav1", _ROUND_TRIPS)["took"])
        figures["ros_tcp_round_trip_ms"] = float(trips.mean())
        figures["ros_tcp_round_trip_p99_ms"] = float(np.percentile(trips, 99))
        figures.update(command_figures(world))
        trips = 1e3 * np.array(world.rosbridge("round_trips", "uav1", _ROUND_TRIPS)["took"])
        figures["rosbridge_round_trip_ms"] = float(trips.mean())
        figures["rosbridge_round_trip_p99_ms"] = float(np.percentile(trips, 99))
        took = stop_latencies(world)
        figures["stop_wall_p95_ms"] = 1e3 * float(np.percentile(took, 95))
        figures.update(end_point_figures("stop", np.reshape(took, (TRIALS, -1)).tolist()))
        try:
            figures.update(one_way_figures(world.simulation, world.bridges))
        except VoleryError as error:
            failures["ros1_one_way_ratio"] = str(error)
    figures.update(stream_figures())
    return Measured(figures, failures)


class World:
    """Runs a simulation in real time in its own thread, with two bridges open."""

    def __init__(self, simulation: Simulation, bridges: BridgeHost) -> None:
        self.simulation = simulation
        self.bridges = bridges
        tcp, web = RosTcpEndpoint(port=0), RosbridgeServer(port=0)
        bridges.open(tcp)
        bridges.open(web)
        self._ports = {"plain_ros_tcp": tcp.port, "plain_rosbridge": web.port}

    def ros_tcp(self, *words: object) -> Any:
        """Returns the measurements of the plain ROS-TCP client."""
        return self.start("plain_ros_tcp", *words)()

    def rosbridge(self, *words: object) -> Any:
        """Returns the measurements of the plain rosbridge client."""
        return self.start("plain_rosbridge", *words)()

    def start(self, client: str, *words: object) -> Any:
        """Starts a client; the returned function waits for its result."""
        module = f"volery_benchmarks.bridge.{client}"
        command = [sys.executable, "-P", "-m", module, str(self._ports[client]), *map(str, words)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

        def finish() -> Any:
            try:
                out, _ = process.communicate(timeout=_CLIENT_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.communicate()
                raise
            if process.returncode:
                raise RuntimeError(f"{module} ended with status {process.returncode}")
            return json.loads(out)

        return finish


@contextmanager
def running(scenario: Scenario) -> Iterator[World]:
    """Runs `scenario` in real time until the block ends."""
    with in_real_time(scenario) as (simulation, bridges):
        yield World(simulation, bridges)


@contextmanager
def in_real_time(scenario: Scenario) -> Iterator[tuple[Simulation, BridgeHost]]:
    """Runs `scenario` in real time, in its own thread, until the block ends."""
    with Simulation(scenario) as simulation:
        simulation.step(1)  # compile before any measurement
        with BridgeHost(simulation.gateway) as bridges:
            simulation.gateway.use_low_latency()
            over = threading.Event()
            thread = threading.Thread(target=_run, args=(simulation, over))
            thread.start()
            try:
                yield simulation, bridges
            finally:
                over.set()
                thread.join()


def _run(simulation: Simulation, over: threading.Event) -> None:
    while not over.is_set():
        simulation.run(0.5, speed=1.0)


def image_latencies(world: World) -> list[tuple[int, float]]:
    """Returns (bytes, s) of images from the simulation's thread, one size after the other."""
    publisher = advertise_images(world.simulation)
    count = IMAGES_A_SIZE * len(IMAGE_BYTES)
    finish = world.start("plain_ros_tcp", "sizes", IMAGE_TOPIC, count)
    _wait_for_subscriber(world.simulation, IMAGE_TOPIC)
    publish_images(world.simulation, publisher, IMAGE_BYTES)
    return [(size, latency) for size, latency in finish()["latencies"]]


def advertise_images(simulation: Simulation) -> Publisher:
    """Advertises `IMAGE_TOPIC`."""
    advertising = simulation.gateway.post(lambda: simulation.graph.advertise(IMAGE_TOPIC, _IMAGE))
    publisher: Publisher = advertising.result()
    return publisher


def publish_images(simulation: Simulation, publisher: Publisher, sizes: Sequence[int]) -> None:
    """Publishes `IMAGES_A_SIZE` images per size (bytes), stamped in the simulation's thread."""
    image = message_type(_IMAGE)
    for size in sizes:
        pixels = np.zeros(size, np.uint8)
        pixels.flags.writeable = False

        def publish(pixels: Any = pixels) -> None:
            stamp = Time(*divmod(time.monotonic_ns(), 10**9))
            width = len(pixels)
            publisher.publish(image(Header(stamp, ""), 1, width, "mono8", 0, width, pixels))

        for _ in range(IMAGES_A_SIZE):
            simulation.gateway.post(publish)
            time.sleep(_IMAGE_PERIOD_S)


def command_figures(world: World) -> dict[str, float]:
    """Runs ten trials of ten commands: until applied, and until that report is back."""
    applied_ns: dict[float, int] = {}

    def note(published: Any) -> None:
        applied_ns[published.message.twist.angular.z] = time.monotonic_ns()

    simulation = world.simulation
    topic = "/uav1/cmd_vel/applied"
    noting = simulation.post(lambda: simulation.graph.subscribe(topic, note)).result()
    round_trips, one_way = [], []
    for _ in range(TRIALS):
        found = world.ros_tcp("round_trips", "uav1", TRIALS)
        round_trips.append(found["took"])
        one_way.append(one_way_latencies(found["sent_ns"], applied_ns))
    simulation.post(noting.cancel).result()
    return {
        **end_point_figures("round_trip", round_trips),
        **end_point_figures("one_way", one_way),
    }


def stop_latencies(world: World) -> list[float]:
    """Returns the time, s, from each stop request to the first step with rotors commanded to 0."""
    simulation = world.simulation
    uav, response = simulation.uavs["uav1"], message_type(f"{_TRIGGER}_Response")
    stopped_ns: list[int] = []
    flying = False

    def look() -> None:
        nonlocal flying
        turning = bool(uav.rotor_reference.any())
        if flying and not turning:
            stopped_ns.append(time.monotonic_ns())
        flying = turning

    def recover(_request: Any) -> Any:
        uav.go_to([0.0, 0.0, _SAFE_HEIGHT_M])
        return response(success=True, message="")

    simulation.post(
        lambda: simulation.graph.create_service("/bench/recover", _TRIGGER, recover)
    ).result()
    simulation.diagnostics.on_advance(look)
    sent = world.ros_tcp("stops", "uav1", _STOPS)["sent_ns"]
    return [1e-9 * (stop - send) for send, stop in zip(sent, stopped_ns, strict=True)]


def stream_scenario() -> Scenario:
    """Returns ten UAVs with two LIDARs each over a forest."""
    lidars = [{"kind": "lidar", "name": name} for name in ("horizontal", "nodding")]
    return parse_scenario(
        {
            "name": "streams",
            "duration_s": 1e6,
            "world": {
                "terrain": {"kind": "flat", "extent_m": 500.0},
                "forest": {
                    "kind": "procedural",
                    "region_m": [0.0, 0.0, 500.0, 500.0],
                    "trees": 5000,
                    "species": {"broadleaf": 1.0},
                },
            },
            "types": {"surveyor": {"airframe": "f450", "sensors": lidars}},
            "uavs": [
                {
                    "type": "surveyor",
                    "count": 10,
                    "position_m": [50.0, 50.0],
                    "last_position_m": [450.0, 450.0],
                    "placement": "nearest_free",
                }
            ],
        }
    )


def stream_figures() -> dict[str, float]:
    """Streams the scans of `stream_scenario` to one client of each kind at once."""
    with running(stream_scenario()) as world:
        topics = [
            f"/{uav}/laser/{name}/scan"
            for uav in world.simulation.vehicles.names
            for name in ("horizontal", "nodding")
        ]
        published: dict[tuple[str, int], int] = {}

        def note(message: Any) -> None:
            stamp = message.message.header.stamp
            key = message.topic, stamp.sec * 10**9 + stamp.nanosec
            published[key] = time.monotonic_ns()

        for topic in topics:
            world.simulation.graph.subscribe(topic, note)
        before, wall = world.simulation.time_s, time.perf_counter()
        clients = [
            world.start(kind, "streams", _STREAM_S, *topics)
            for kind in ("plain_ros_tcp", "plain_rosbridge")
        ]
        results = [finish()["got"] for finish in clients]
        factor = (world.simulation.time_s - before) / (time.perf_counter() - wall)
    return {**stream_ages(results, published), "stream_real_time_factor": factor}


def stream_ages(
    results: list[list[tuple[str, int, int]]], published: dict[tuple[str, int], int]
) -> dict[str, float]:
    """Returns the age of scans on arrival, and the losses between first and last per client."""
    ages: list[int] = []
    lost = 0
    for got in results:
        for topic in {topic for topic, _, _ in got}:
            came = {stamp: at for name, stamp, at in got if name == topic}
            first, last = min(came), max(came)
            sent = [s for name, s in published if name == topic and first <= s <= last]
            lost += len(sent) - len(came)
            ages += [at - published[topic, stamp] for stamp, at in came.items()]
    return {
        "stream_age_p95_ms": 1e-6 * float(np.percentile(ages, 95)),
        "stream_lost": float(lost),
        "stream_scans": float(len(ages)),
    }


def _wait_for_subscriber(simulation: Simulation, topic: str, timeout_s: float = 10.0) -> None:
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        if any(t.name == topic and t.subscribers for t in simulation.graph.topics()):
            return
        time.sleep(0.02)
    raise RuntimeError(f"no client subscribed to '{topic}' within {timeout_s} s")
