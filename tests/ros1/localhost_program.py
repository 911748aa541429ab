"""A program of ours in a process of its own: prints the first message of a topic as JSON."""

import json
import sys
import threading

from volery.bridges.ros1.client import Ros1Client


def main():
    link = Ros1Client(node_name="localhost_program")
    woken = threading.Event()
    queue = link.subscribe("/to_localhost", wake=woken.set)
    woken.wait(60.0)
    sys.stdout.write(json.dumps(queue.take()[0].message.data) + "\n")
    sys.stdout.flush()
    link.close()


main()
