"""Runs plain rospy programs with the system's Python, without importing Volery.

    python3 plain_rospy.py publish|subscribe

`publish` publishes an image for each size (bytes) that it reads; `subscribe` prints for each line
the [path, size, ms] of all images received, from the publisher's stamp to the callback.
"""

import json
import sys
import threading
import time
from typing import Any

import rospy
from sensor_msgs.msg import Image


def say(value: Any) -> None:
    """Prints a value as JSON."""
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def publish() -> None:
    """Publishes images of the requested sizes."""
    publisher = rospy.Publisher("/one_way/plain", Image, queue_size=10)
    say("ready")
    for line in sys.stdin:
        data = bytes(int(line))
        message = Image(height=1, width=len(data), encoding="mono8", step=len(data), data=data)
        now = time.time_ns()
        message.header.stamp = rospy.Time(now // 1_000_000_000, now % 1_000_000_000)
        publisher.publish(message)


def subscribe() -> None:
    """Receives images from both publishers."""
    taken = []

    def take(message: Any, path: str) -> None:
        now = time.time_ns()
        taken.append([path, len(message.data), (now - message.header.stamp.to_nsec()) * 1e-6])

    for path in ("plain", "graph"):
        rospy.Subscriber(f"/one_way/{path}", Image, take, path, buff_size=1 << 20, tcp_nodelay=True)
    say("ready")
    for _ in sys.stdin:
        say(taken)


def main() -> None:
    """Runs the command line."""
    what = sys.argv[1]
    rospy.init_node(f"one_way_{what}", argv=["peer"], disable_rostime=True)
    work = {"publish": publish, "subscribe": subscribe}[what]
    threading.Thread(target=work, daemon=True).start()
    rospy.spin()


if __name__ == "__main__":
    main()
