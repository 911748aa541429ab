"""A program of ours in a process of its own: uses every method of `Ros1Client`, prints JSON."""

import json
import sys
import threading

from volery.bridges.ros1.client import Ros1Client
from volery.core.errors import GraphError
from volery.graph.messages import Header, String, Time, message_type
from volery.graph.service_reply import ServiceReply

STRING = "std_msgs/msg/String"
TRIGGER = "std_srvs/srv/Trigger"


def say(value):
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def call(link, service, request=None):
    is_done, results = threading.Event(), []

    def keep(value):
        results.append(value)
        is_done.set()

    link.call(service, request, ServiceReply(keep, keep))
    assert is_done.wait(60.0)
    return results[0]


def main():
    link = Ros1Client(node_name="program")
    woken = threading.Event()
    queue = link.subscribe("/latched", wake=woken.set)
    assert woken.wait(60.0)
    say([queue.take()[0].message.data, link.info.queues[0].received])
    link.unsubscribe(queue)
    link.advertise("/from_program", STRING, latched=True)
    link.publish("/from_program", String("published"))
    link.advertise("/headers_in", "std_msgs/msg/Header")
    try:
        link.publish("/headers_in", String("wrong"))
    except GraphError as error:
        say(str(error))
    link.publish("/headers_in", Header(Time(1, 2), "nobody hears"))
    say(call(link, "/trigger").message)
    say(str(call(link, "/nobody")))
    response = message_type(f"{TRIGGER}_Response")
    link.create_service(
        "/program", TRIGGER, lambda _, reply: reply.answer(response(True, "answered"))
    )
    say("offered")
    sys.stdin.readline()
    link.close()
    say(link.info.publishes)


main()
