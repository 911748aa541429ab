"""One way to a plain rospy subscriber: from the graph, and from plain rospy, by turns.

    python tests/ros1/one_way.py [--count 200]

Prints JSON: for each size the median time from the publisher's stamp to the subscriber's callback,
in ms, and the ratio of the two.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time

import numpy as np
from ros1_bench import HERE, SYSTEM_PYTHON, LiveGraph, Program, shared_master, wait_until

from volery.bridges.doors import Doors
from volery.bridges.ros1 import Ros1Door
from volery.graph.messages import message_type, time_from_ns

SIZES = (0, 100_000, 1_000_000)
PERIOD_S = 0.01
IMAGE = "sensor_msgs/msg/Image"


def measure(count=200):
    """Medians and ratios by size in bytes."""
    shared_master()
    live = LiveGraph()
    topic = live.graph.advertise("/one_way/graph", IMAGE)
    make = message_type(IMAGE)
    header = message_type("std_msgs/msg/Header")

    def publish(data):
        stamp = header(time_from_ns(time.time_ns()), "")
        topic.publish(make(stamp, 1, len(data), "mono8", 0, len(data), data))

    peer = (SYSTEM_PYTHON, str(HERE / "one_way_peer.py"))
    with (
        Doors(live.gateway) as doors,
        Program(*peer, "subscribe") as subscriber,
        Program(*peer, "publish") as plain,
    ):
        doors.open(Ros1Door(topics=("/one_way/*",)))
        subscriber.next()
        plain.next()
        assert wait_until(lambda: any(t.subscribers for t in live.graph.topics()))
        time.sleep(1.0)
        for size in SIZES:
            data = np.zeros(size, np.uint8)
            data.flags.writeable = False
            for _ in range(count):
                plain.tell(str(size))
                time.sleep(PERIOD_S)
                live.post(lambda data=data: publish(data))
                time.sleep(PERIOD_S)
        time.sleep(0.5)
        subscriber.tell("report")
        taken = subscriber.next()
    live.close()
    return summarize(taken)


def summarize(taken):
    """The figures of all that came."""
    result = {}
    for size in SIZES:
        times = {
            path: [ms for p, s, ms in taken if p == path and s == size]
            for path in ("plain", "graph")
        }
        medians = {path: statistics.median(values) for path, values in times.items()}
        result[str(size)] = {
            "plain_ms": round(medians["plain"], 3),
            "graph_ms": round(medians["graph"], 3),
            "ratio": round(medians["graph"] / medians["plain"], 3),
            "received": [len(times["plain"]), len(times["graph"])],
        }
    ratios = [found["ratio"] for found in result.values()]
    result["ros1_one_way_ratio"] = round(statistics.geometric_mean(ratios), 3)
    return result


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=200)
    sys.stdout.write(json.dumps(measure(parser.parse_args().count), indent=2) + "\n")
