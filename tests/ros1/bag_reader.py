"""Reads a bag as programs of ROS 1 do, run by the system's Python; prints one JSON value."""

import io
import json
import sys

import rosbag


def main():
    read = {}
    with rosbag.Bag(sys.argv[1]) as bag:
        raw = [(topic, message[:2]) for topic, message, _ in bag.read_messages(raw=True)]
        for (topic, (name, data)), (_, message, _) in zip(raw, bag.read_messages(), strict=True):
            again = io.BytesIO()
            message.serialize(again)
            known = read.setdefault(topic, [name, 0, True])
            known[1] += 1
            known[2] = known[2] and again.getvalue() == bytes(data)
    sys.stdout.write(json.dumps(read) + "\n")


main()
