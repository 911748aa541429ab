"""Runs a rosbridge client of `websockets` and `cbor2` alone, in its own process.

    python -m volery_benchmarks.bridge.plain_rosbridge PORT round_trips UAV COUNT
    python -m volery_benchmarks.bridge.plain_rosbridge PORT streams SECONDS TOPIC...

It prints one JSON object. It sends JSON and receives CBOR.
"""

from __future__ import annotations

import json
import random
import sys
import time
from typing import Any

import cbor2
from websockets.sync.client import ClientConnection, connect

_SETTLE_S = 0.5


def round_trips(client: ClientConnection, uav: str, count: int) -> dict[str, Any]:
    """Returns the time, s, from sending a Twist to receiving the report of its application."""
    command, applied = f"/{uav}/cmd_vel", f"/{uav}/cmd_vel/applied"
    _send(client, op="advertise", topic=command, type="geometry_msgs/Twist")
    _subscribe(client, applied, "geometry_msgs/TwistStamped")
    time.sleep(_SETTLE_S)
    took, draw = [], random.Random(1)
    for k in range(count):
        time.sleep(draw.uniform(0.002, 0.006))
        number = 0.1 + 1e-6 * k
        before = time.perf_counter()
        _send(client, op="publish", topic=command, msg={"angular": {"z": number}})
        while _receive(client)["msg"]["twist"]["angular"]["z"] != number:
            pass
        took.append(time.perf_counter() - before)
    return {"took": took}


def streams(client: ClientConnection, seconds: float, topics: list[str]) -> dict[str, Any]:
    """Returns topic, stamp (ns) and arrival time (ns, monotonic clock) of each scan."""
    for topic in topics:
        _subscribe(client, topic, "sensor_msgs/LaserScan")
    got: list[tuple[str, int, int]] = []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            message = _receive(client, timeout_s=max(end - time.monotonic(), 0.001))
        except TimeoutError:
            break
        stamp = message["msg"]["header"]["stamp"]
        time_ns = stamp["sec"] * 10**9 + stamp["nanosec"]
        got.append((message["topic"], time_ns, time.monotonic_ns()))
    return {"got": got}


def _subscribe(client: ClientConnection, topic: str, msgtype: str) -> None:
    _send(client, op="subscribe", topic=topic, type=msgtype, compression="cbor", queue_length=100)


def _send(client: ClientConnection, **words: Any) -> None:
    client.send(json.dumps(words))


def _receive(client: ClientConnection, timeout_s: float | None = None) -> Any:
    """Returns the next publication."""
    while True:
        data = client.recv(timeout=timeout_s)
        message = cbor2.loads(data) if isinstance(data, bytes) else json.loads(data)
        if message.get("op") == "publish":
            return message


def main() -> None:
    """Runs the command line."""
    port, what, *rest = sys.argv[1:]
    with connect(f"ws://127.0.0.1:{port}", compression=None, max_size=None) as client:
        if what == "round_trips":
            result = round_trips(client, rest[0], int(rest[1]))
        else:
            result = streams(client, float(rest[0]), rest[1:])
    sys.stdout.write(json.dumps(result))


if __name__ == "__main__":
    main()
