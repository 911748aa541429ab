"""Plain rospy programs, run by the system's Python; each prints one JSON value a line."""

import argparse
import json
import logging
import sys
import threading
import time

import rospy
from geometry_msgs.msg import Twist
from std_msgs.msg import Header, String
from std_srvs.srv import SetBool, Trigger, TriggerResponse


class AlteredString(String):
    _md5sum = "0123456789abcdef0123456789abcdef"


class AlteredTrigger(Trigger):
    _md5sum = "0123456789abcdef0123456789abcdef"


class Refusals(logging.Handler):
    """Prints what rospy reports of sums that do not fit."""

    def emit(self, record):
        if "md5sum" in record.getMessage():
            say({"refused": record.getMessage()})


def say(value):
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def listen(options):
    """Prints what comes; `--slow` seconds of sleep a message; `--twist`: x of its velocity.

    `--altered`: with a wrong md5; then it prints why it is refused, too.
    """
    done = threading.Event()
    seen = []

    def on_message(message):
        header = message._connection_header
        seen.append(message)
        what = message.linear.x if options.twist else message.data[:100]
        say([what, header["latching"], header["callerid"]])
        time.sleep(options.slow)
        if len(seen) >= options.count:
            done.set()

    if options.altered:
        logging.getLogger("rospy").addHandler(Refusals(logging.WARNING))
    kind = AlteredString if options.altered else Twist if options.twist else String
    rospy.Subscriber(options.name, kind, on_message, buff_size=4096 if options.slow else 65536)
    say("ready")
    done.wait(options.seconds)


def headers(options):
    done = threading.Event()
    seen = []

    def on_message(message):
        seen.append(message)
        say([message.seq, message.stamp.to_nsec(), message.frame_id])
        if len(seen) >= options.count:
            done.set()

    rospy.Subscriber(options.name, Header, on_message)
    say("ready")
    done.wait(options.seconds)


def hang(options):
    """Subscribes and reads nothing."""
    block = threading.Event()
    rospy.Subscriber(options.name, String, lambda _: block.wait(options.seconds), buff_size=4096)
    say("ready")
    sys.stdin.read()
    block.set()


def talk(options):
    publisher = rospy.Publisher(options.name, String, queue_size=10, latch=options.latch)
    say("ready")
    for line in sys.stdin:
        publisher.publish(line.rstrip("\n"))
    say("end")


def serve(options):
    rospy.Service(options.name, Trigger, lambda _: TriggerResponse(True, "from rospy, übrigens"))
    say("ready")
    sys.stdin.read()


def call(options):
    kind = AlteredTrigger if options.altered else Trigger
    rospy.wait_for_service(options.name, options.seconds)
    try:
        response = rospy.ServiceProxy(options.name, kind)()
        say([response.success, response.message])
    except rospy.ServiceException as error:
        say(str(error))


def switch(options):
    rospy.wait_for_service(options.name, options.seconds)
    say([rospy.ServiceProxy(options.name, SetBool)(True).message])


JOBS = {job.__name__: job for job in (listen, headers, hang, talk, serve, call, switch)}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("job", choices=JOBS)
    parser.add_argument("name")
    parser.add_argument("--count", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=240.0)
    parser.add_argument("--slow", type=float, default=0.0)
    parser.add_argument("--altered", action="store_true")
    parser.add_argument("--twist", action="store_true")
    parser.add_argument("--latch", action="store_true")
    options = parser.parse_args()
    rospy.init_node(f"peer_{options.job}", anonymous=True, argv=["peer"], disable_rostime=True)
    JOBS[options.job](options)
    rospy.signal_shutdown("done")


main()
