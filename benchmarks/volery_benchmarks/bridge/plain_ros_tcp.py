"""Runs a ROS-TCP client of the standard library alone, in its own process.

    python -m volery_benchmarks.bridge.plain_ros_tcp PORT sizes TOPIC COUNT
    python -m volery_benchmarks.bridge.plain_ros_tcp PORT round_trips UAV COUNT
    python -m volery_benchmarks.bridge.plain_ros_tcp PORT stops UAV COUNT
    python -m volery_benchmarks.bridge.plain_ros_tcp PORT streams SECONDS TOPIC...

It prints one JSON object. Clocks are compared across processes: CLOCK_MONOTONIC is the machine's.
"""

from __future__ import annotations

import json
import random
import socket
import struct
import sys
import time
from collections.abc import Iterator
from typing import Any

_TWIST = "geometry_msgs/Twist"
_SETTLE_S = 0.5
_FALL_S = 0.01


class Client:
    """Connects to the endpoint; sends whole frames and reads frames one by one."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._file = self._socket.makefile("rb", buffering=1 << 16)

    def send(self, destination: str, payload: bytes) -> None:
        """Sends one frame."""
        name = destination.encode()
        head = struct.pack("<I", len(name)) + name + struct.pack("<I", len(payload))
        self._socket.sendall(head + payload)

    def command(self, name: str, **fields: Any) -> None:
        """Sends a system command."""
        self.send(name, json.dumps(fields).encode())

    def frames(self) -> Iterator[tuple[str, bytes]]:
        """Yields frames as they arrive."""
        while True:
            (length,) = struct.unpack("<I", self._read(4))
            name = self._read(length).decode()
            (length,) = struct.unpack("<I", self._read(4))
            yield name, self._read(length)

    def wait_for(self, destination: str) -> bytes:
        """Returns the payload of the next frame to `destination`."""
        return next(payload for name, payload in self.frames() if name == destination)

    def _read(self, count: int) -> bytes:
        data: bytes = self._file.read(count)
        if len(data) < count:
            raise ConnectionError("the server has closed the connection")
        return data


def receive_images(client: Client, topic: str, count: int) -> dict[str, Any]:
    """Returns (size, latency s) of images stamped with the wall time of publishing."""
    client.command("__subscribe", topic=topic, message_name="sensor_msgs/Image")
    got = []
    for name, payload in client.frames():
        if name == topic:
            now_ns = time.monotonic_ns()
            _, sec, nanosec = struct.unpack_from("<III", payload)
            got.append((len(payload), (now_ns - (sec * 10**9 + nanosec)) * 1e-9))
            if len(got) == count:
                return {"latencies": got}
    raise ConnectionError


def round_trips(client: Client, uav: str, count: int) -> dict[str, Any]:
    """Returns the time, s, from sending a Twist to receiving the report of its application.

    Also returns the sending times, ns of the monotonic clock, by the number in each command.
    """
    command, applied = f"/{uav}/cmd_vel", f"/{uav}/cmd_vel/applied"
    client.command("__publish", topic=command, message_name=_TWIST)
    client.command("__subscribe", topic=applied, message_name="geometry_msgs/TwistStamped")
    time.sleep(_SETTLE_S)
    took, sent, draw = [], [], random.Random(1)
    for k in range(count):
        time.sleep(draw.uniform(0.002, 0.006))
        number = 0.1 + 1e-6 * k
        before = time.perf_counter()
        sent.append((number, time.monotonic_ns()))
        client.send(command, struct.pack("<6d", 0.0, 0.0, 0.0, 0.0, 0.0, number))
        while True:
            report = client.wait_for(applied)
            if struct.unpack("<d", report[-8:])[0] == number:
                break
        took.append(time.perf_counter() - before)
    return {"took": took, "sent_ns": sent}


def stops(client: Client, uav: str, count: int) -> dict[str, Any]:
    """Returns the sending times of stop requests, ns, monotonic; the UAV recovers in between."""
    service = f"/{uav}/kill"
    client.command("__ros_service", topic=service, message_name="std_srvs/Trigger")
    client.command("__ros_service", topic="/bench/recover", message_name="std_srvs/Trigger")
    time.sleep(_SETTLE_S)
    sent, draw = [], random.Random(2)
    for k in range(count):
        time.sleep(draw.uniform(0.15, 0.25))
        sent.append(time.monotonic_ns())
        _request(client, service, 101 + 2 * k)
        time.sleep(_FALL_S)  # the response confirms the command: the next step executes it
        _request(client, "/bench/recover", 102 + 2 * k)
    return {"sent_ns": sent}


def _request(client: Client, service: str, number: int) -> None:
    client.command("__request", srv_id=number)
    client.send(service, b"")
    client.wait_for(service)


def streams(client: Client, seconds: float, topics: list[str]) -> dict[str, Any]:
    """Returns topic, stamp (ns) and arrival time (ns, monotonic clock) of each scan."""
    for topic in topics:
        client.command("__subscribe", topic=topic, message_name="sensor_msgs/LaserScan")
    wanted = set(topics)
    got: list[tuple[str, int, int]] = []
    end = time.monotonic() + seconds
    for name, payload in client.frames():
        if name in wanted:
            _, sec, nanosec = struct.unpack_from("<III", payload)
            got.append((name, sec * 10**9 + nanosec, time.monotonic_ns()))
        if time.monotonic() > end:
            break
    return {"got": got}


def main() -> None:
    """Runs the command line."""
    port, what, *rest = sys.argv[1:]
    client = Client(int(port))
    if what == "sizes":
        result = receive_images(client, rest[0], int(rest[1]))
    elif what == "round_trips":
        result = round_trips(client, rest[0], int(rest[1]))
    elif what == "stops":
        result = stops(client, rest[0], int(rest[1]))
    else:
        result = streams(client, float(rest[0]), rest[1:])
    sys.stdout.write(json.dumps(result))


if __name__ == "__main__":
    main()
