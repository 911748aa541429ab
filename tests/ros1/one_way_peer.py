"""The plain rospy sides of `one_way.py`, run by the system's Python."""

import json
import sys
import threading
import time

import rospy
from sensor_msgs.msg import Image


def say(value):
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def publish():
    publisher = rospy.Publisher("/one_way/plain", Image, queue_size=10)
    say("ready")
    for line in sys.stdin:
        data = bytes(int(line))
        message = Image(height=1, width=len(data), encoding="mono8", step=len(data), data=data)
        now = time.time_ns()
        message.header.stamp = rospy.Time(now // 1_000_000_000, now % 1_000_000_000)
        publisher.publish(message)


def subscribe():
    taken = []

    def take(message, path):
        now = time.time_ns()
        taken.append([path, len(message.data), (now - message.header.stamp.to_nsec()) * 1e-6])

    for path in ("plain", "graph"):
        rospy.Subscriber(f"/one_way/{path}", Image, take, path, buff_size=1 << 20, tcp_nodelay=True)
    say("ready")
    for _ in sys.stdin:
        say(taken)


rospy.init_node(f"one_way_{sys.argv[1]}", argv=["peer"], disable_rostime=True)
threading.Thread(
    target={"publish": publish, "subscribe": subscribe}[sys.argv[1]], daemon=True
).start()
rospy.spin()
