"""Subscribes over DDS, and reports the received messages after a line on stdin.

python -m volery_benchmarks.ros2_peer DOMAIN image|scan TOPIC ...
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable

from volery.bridges.ros2.environment import Ros2Environment, join_ros2
from volery.bridges.ros2.middleware import Profile, TopicSpec
from volery.bridges.ros2.names import NodeName
from volery.graph.codecs.cdr import decode_cdr

_TYPES = {"image": "sensor_msgs/msg/Image", "scan": "sensor_msgs/msg/LaserScan"}
_BEST_EFFORT = Profile(reliable=False, depth=10)


def main() -> None:
    """Runs the command line."""
    domain, kind, *topics = sys.argv[1:]
    msgtype = _TYPES[kind]
    came: list[tuple[str, bytes, int]] = []
    participant = join_ros2(Ros2Environment(domain_id=int(domain)))
    node = NodeName("/", "bench_peer")
    participant.add_node(node)

    def taker(topic: str) -> Callable[[bytes], None]:
        def take(data: bytes) -> None:
            decode_cdr(data, msgtype)  # as a subscriber does before its callback
            came.append((topic, data, time.monotonic_ns()))

        return take

    for topic in topics:
        participant.reader(TopicSpec(node, topic, msgtype, _BEST_EFFORT), taker(topic))
    participant.announce()
    sys.stdin.readline()
    received = []
    for topic, data, at in came:
        message = decode_cdr(data, msgtype)
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        size = message.data.size if kind == "image" else message.ranges.size
        received.append((topic, size, stamp, at))
    sys.stdout.write(json.dumps(received))
    participant.close()


if __name__ == "__main__":
    main()
