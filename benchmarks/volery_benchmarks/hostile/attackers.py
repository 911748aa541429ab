"""Runs clients that overload a server on loopback, in their own process.

    python -m volery_benchmarks.hostile.attackers ATTACK ROSBRIDGE_PORT ROS_TCP_PORT SECONDS
    python -m volery_benchmarks.hostile.attackers mavlink_flood TCP_PORT UDP_PORT SECONDS

It ends after SECONDS and prints how much it has sent as a JSON object. An attacker that is
disconnected reconnects.
"""

from __future__ import annotations

import json
import os
import socket
import struct
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any

from volery.bridges.unfinished import MAX_UNFINISHED_S
from volery_benchmarks.hostile import crowds, mavlink_flood
from volery_benchmarks.hostile.websocket import (
    BINARY,
    TEXT,
    frame,
    frame_head,
    open_websocket,
    read_frame,
)

STALLED_CLIENTS = 50
PUBLISHED_HZ = 10_000
LARGE_BYTES = 60_000_000
MAX_ACCEPTED_BYTES = 9_999_000
MAX_HALF_OPEN = 500
_STORM_PAUSE_S = 0.001
_BURST = 100
_CHUNK_BYTES = 1 << 20
_SERVICES: Sequence[tuple[str, Any]] = (
    ("/volery/get_scenario_options", {}),
    ("/get_available_worlds", {}),
    ("/get_entities", {}),
    ("/get_entities_states", {}),
)


def stalled(port: int, _ros_tcp: int, ends: float) -> int:
    """Subscribes to everything with many clients and never reads."""
    clients = [open_websocket(port, receive_buffer=4096) for _ in range(STALLED_CLIENTS)]
    topics = ("/clock", "/tf", "/uav1/odom", "/uav1/imu", "/uav1/ground_truth/odom")
    for client in clients:
        for topic in topics:
            asked = {"op": "subscribe", "topic": topic, "queue_length": 1000}
            client.sendall(frame(json.dumps(asked).encode()))
    time.sleep(max(0.0, ends - time.monotonic()))
    return len(clients)


def publisher(port: int, _ros_tcp: int, ends: float) -> int:
    """Publishes velocities 10,000 times a second with one client."""
    message = {"op": "publish", "topic": "/uav1/cmd_vel", "msg": {"angular": {"z": 0.1}}}
    burst = frame(json.dumps(message).encode()) * _BURST

    def publish() -> Iterator[int]:
        client = open_websocket(port)
        announced = {"op": "advertise", "topic": "/uav1/cmd_vel", "type": "geometry_msgs/Twist"}
        client.sendall(frame(json.dumps(announced).encode()))
        due = time.monotonic()
        while True:
            _send(client, burst, ends)
            yield _BURST
            due = max(due + _BURST / PUBLISHED_HZ, time.monotonic() - 0.1)
            time.sleep(max(0.0, due - time.monotonic()))

    return _until(ends, publish)


def large_cbor(port: int, _ros_tcp: int, ends: float) -> int:
    """Sends arrays of 60 million numbers as CBOR."""
    head = b"\xa1\x62op\x9a" + struct.pack(">I", LARGE_BYTES)
    return _large(port, head + bytes(LARGE_BYTES), BINARY, ends)


def large_json(port: int, _ros_tcp: int, ends: float) -> int:
    """Sends lists of 30 million numbers as JSON."""
    return _large(port, b'{"op":[' + b"1," * (LARGE_BYTES // 2) + b"1]}", TEXT, ends)


def large_image(port: int, _ros_tcp: int, ends: float) -> int:
    """Sends images of the server's max size, as CBOR, without a pause."""
    topic = {"op": "advertise", "topic": "/hostile/image", "type": "sensor_msgs/Image"}
    pixels = MAX_ACCEPTED_BYTES
    parts = (
        b"\xa3\x62op\x67publish\x65topic\x6e/hostile/image\x63msg\xa1\x64data\x5a",
        struct.pack(">I", pixels),
        bytes(pixels),
    )
    return _large(port, b"".join(parts), BINARY, ends, frame(json.dumps(topic).encode()))


def large_tf(_rosbridge: int, port: int, ends: float) -> int:
    """Sends 60 MB of transforms over ROS-TCP."""
    count = LARGE_BYTES // 76
    payload = struct.pack("<I", count) + bytes(76 * count)
    topic = json.dumps({"topic": "/tf", "message_name": "tf2_msgs/TFMessage"}).encode()
    announced, message = _ros_tcp_frame(b"__publish", topic), _ros_tcp_frame(b"/tf", payload)

    def send() -> Iterator[int]:
        client = socket.create_connection(("127.0.0.1", port), timeout=10.0)
        client.sendall(announced)
        while True:
            _send(client, message, ends)
            _drain(client)
            yield 1

    return _until(ends, send)


def storm(port: int, ros_tcp: int, ends: float) -> int:
    """Opens as many connections as allowed that send nothing, or half a request."""
    count, half_open = 0, []
    while time.monotonic() < ends:
        client = socket.socket()
        client.setblocking(False)
        client.connect_ex(("127.0.0.1", port if count % 2 else ros_tcp))
        half_open.append(client)
        count += 1
        time.sleep(_STORM_PAUSE_S)
        if count % 3 == 0:
            with suppress(OSError):
                client.send(b"GET / HTTP/1.1\r\nHost: x\r\n")
        if len(half_open) >= MAX_HALF_OPEN:
            half_open.pop(0).close()
    return count


def services(port: int, _ros_tcp: int, ends: float) -> int:
    """Calls services in a loop with four clients, one service each."""
    return _call_services(port, ends, _SERVICES)


def pattern(port: int, _ros_tcp: int, ends: float) -> int:
    """Filters entities by a pattern for which backtracking takes exponential time."""
    args = {"filters": {"filter": "(|||||||||){14}x"}}
    return _call_services(port, ends, (("/get_entities", args),))


def _call_services(port: int, ends: float, services: Sequence[tuple[str, Any]]) -> int:
    def call() -> Iterator[int]:
        clients = [open_websocket(port) for _ in services]
        calls = [
            frame(json.dumps({"op": "call_service", "service": name, "args": args}).encode())
            for name, args in services
        ]
        for client, sent in zip(clients, calls, strict=True):
            client.sendall(sent)
        while True:
            for client, sent in zip(clients, calls, strict=True):
                client.settimeout(max(0.01, ends - time.monotonic()))
                read_frame(client)
                client.sendall(sent)
                yield 1

    return _until(ends, call)


ATTACKS: dict[str, Callable[[int, int, float], int]] = {
    "stalled_subscribers": stalled,
    "publisher_10_khz": publisher,
    "large_cbor": large_cbor,
    "large_json": large_json,
    "large_image": large_image,
    "large_tf": large_tf,
    "connection_storm": storm,
    "service_loop": services,
    "service_pattern": pattern,
    "mavlink_flood": mavlink_flood.flood,
    "viewers_1000": crowds.unfinished,
    "subscribers_120_stopped": crowds.stopped,
}
"""Attacks by name; each takes two ports and its end time."""
MAVLINK_ATTACKS = frozenset({"mavlink_flood"})
"""Attacks whose ports are MAVLink's by TCP and UDP."""
WITNESSED_FROM_START = frozenset({"subscribers_120_stopped"})
"""Attacks whose first second counts."""
SETTLE_S = {"viewers_1000": MAX_UNFINISHED_S + 2.0}
"""Time after which what an attack leaves in memory is measured, where it is more than a second."""


def _large(port: int, payload: bytes, kind: int, ends: float, first: bytes = b"") -> int:
    def send() -> Iterator[int]:
        client = open_websocket(port)
        client.sendall(first)
        while True:
            _send(client, frame_head(len(payload), kind), ends)
            _send(client, payload, ends)
            _drain(client)
            yield 1

    return _until(ends, send)


def _send(client: socket.socket, data: bytes, ends: float) -> None:
    """Sends all data, or as much as the server accepts until the end. Raises `OSError`."""
    client.settimeout(0.1)
    rest = memoryview(data)
    while rest and time.monotonic() < ends:
        with suppress(TimeoutError):
            rest = rest[client.send(rest[:_CHUNK_BYTES]) :]


def _drain(client: socket.socket) -> None:
    """Reads pending data, so that the server's responses do not block it."""
    client.setblocking(False)
    with suppress(BlockingIOError):
        while client.recv(_CHUNK_BYTES):
            pass


def _until(ends: float, attack: Callable[[], Iterator[int]]) -> int:
    """Returns how much was sent until the end, over as many connections as necessary."""
    sent = 0
    while time.monotonic() < ends:
        with suppress(OSError):
            for count in attack():
                sent += count
                if time.monotonic() >= ends:
                    break
        time.sleep(0.01)
    return sent


def _ros_tcp_frame(destination: bytes, payload: bytes) -> bytes:
    lengths = struct.pack("<I", len(destination)), struct.pack("<I", len(payload))
    return b"".join((lengths[0], destination, lengths[1], payload))


def main() -> None:
    """Runs the command line."""
    attack, first_port, second_port, seconds = sys.argv[1:]
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    ends = time.monotonic() + float(seconds)
    sent = ATTACKS[attack](int(first_port), int(second_port), ends)
    sys.stdout.write(json.dumps({"sent": sent}))


if __name__ == "__main__":
    main()
