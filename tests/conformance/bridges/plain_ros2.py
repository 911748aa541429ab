"""A plain DDS program that speaks as a ROS 2 node does. It shares no code with the bridge.

It runs as a process of its own and does what comes as lines of JSON on stdin; what it receives goes
to stdout. Its types are written by hand in the package's IDL, their bytes come from the tests.

    {"op": "subscribe", "topic": "/chatter", "type": "std_msgs/msg/String"}

What it has it gives up with `{"op": "leave"}`, and can be another node then.
"""

import base64
import ctypes
import json
import struct
import sys
import threading
import time
from dataclasses import dataclass

from cyclonedds.__library__ import library_path
from cyclonedds.core import (
    DDSException,
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, int64, sequence, uint8, uint32, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

CONFIG = """<CycloneDDS><Domain id="any">
  <General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
    <AllowMulticast>false</AllowMulticast></General>
  <Discovery><LeaseDuration>{lease} s</LeaseDuration><SPDPInterval>500 ms</SPDPInterval>
    <ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
    <Peers><Peer address="localhost"/></Peers></Discovery>
</Domain></CycloneDDS>"""
MATCH_S = 600.0
IMAGE_HEAD = 1000
"""Bytes of an image that are reported. A pipe takes a line below 4096 bytes as one: a process that
is stopped while it writes leaves no half line."""


@dataclass
class String_(IdlStruct, typename="std_msgs.msg.dds_.String_"):
    data: str


@dataclass
class Time_(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header_(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    stamp: Time_
    frame_id: str


@dataclass
class Image_(IdlStruct, typename="sensor_msgs.msg.dds_.Image_"):
    header: Header_
    height: uint32
    width: uint32
    encoding: str
    is_bigendian: uint8
    step: uint32
    data: sequence[uint8]


@dataclass
class Request_(IdlStruct, typename="std_srvs.srv.dds_.Trigger_Request_"):
    guid: uint64
    seq: int64
    structure_needs_at_least_one_member: uint8


@dataclass
class Response_(IdlStruct, typename="std_srvs.srv.dds_.Trigger_Response_"):
    guid: uint64
    seq: int64
    success: bool
    message: str


TYPES = {"std_msgs/msg/String": String_, "sensor_msgs/msg/Image": Image_}


def stay_bytes(kind):
    """Have samples of a type written and read as they are."""

    def keep(cls, data, **_):
        sample = cls.__new__(cls)
        sample.raw = data
        return sample

    kind.serialize = lambda self, **_: self.raw
    kind.deserialize = classmethod(keep)
    kind.deserialize_key = classmethod(keep)


for kind in (*TYPES.values(), Request_, Response_):
    stay_bytes(kind)


def qos(*, reliable=True, latched=False, user_data=b""):
    kept = Policy.History.KeepLast(1 if latched else 1000)
    return Qos(
        Policy.Reliability.Reliable(duration(infinite=True))
        if reliable
        else Policy.Reliability.BestEffort,
        kept,
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.DurabilityService(0, kept, -1, -1, -1),
        Policy.WriterDataLifecycle(autodispose=False),
        Policy.Userdata(data=user_data),
    )


class Peer:
    def __init__(self, domain_id, lease_s):
        self.domain_id = domain_id
        self.domain = Domain(domain_id, CONFIG.format(lease=lease_s))
        self.output_lock = threading.Lock()
        self.library = ctypes.CDLL(str(library_path))
        self.join()

    def join(self):
        self.participant = DomainParticipant(self.domain_id)
        self.writers, self.askers, self.readers, self.leaving = {}, {}, [], False
        self.waitset = WaitSet(self.participant)
        self.listener = threading.Thread(target=self.listen, daemon=True)
        self.listener.start()

    def leave(self):
        self.leaving = True
        self.listener.join()
        self.library.dds_delete(self.participant._ref)
        self.join()
        return True

    def report(self, **fields):
        with self.output_lock:
            sys.stdout.write(json.dumps(fields) + "\n")
            sys.stdout.flush()

    def listen(self):
        while not self.leaving:
            if not self.readers:
                time.sleep(0.02)
                continue
            self.waitset.wait(duration(milliseconds=50))
            for reader, take in tuple(self.readers):
                for sample in reader.take(100):
                    if sample.sample_info.valid_data:
                        take(sample.raw)

    def write(self, writer, kind, data):
        writer.write(kind.deserialize(data))

    def add_reader(self, topic, kind, take, quality):
        reader = DataReader(self.participant, Topic(self.participant, topic, kind), qos=quality)
        self.readers.append((reader, take))
        any_state = ViewState.Any | InstanceState.Any | SampleState.NotRead
        self.waitset.attach(ReadCondition(reader, any_state))
        return reader

    def speak(self, topic, kind, quality):
        return DataWriter(self.participant, Topic(self.participant, topic, kind), qos=quality)

    def matched(self, what):
        end = time.monotonic() + MATCH_S
        while not what() and time.monotonic() < end:
            time.sleep(0.005)
        return bool(what())

    # -------------------------------------------------------------------------------- operations

    def advertise(self, topic, type, latched, wait):
        kind = TYPES[type]
        writer = self.speak(f"rt{topic}", kind, qos(latched=latched))
        self.writers[topic] = writer, kind
        return self.matched(writer.get_matched_subscriptions) if wait else True

    def advertise_oddly(self, dds_topic, type_name, user_data):
        """A writer whose names are taken as they are, of a structure that ROS 2 has not."""

        @dataclass
        class Odd(IdlStruct, typename=type_name):
            numbers: sequence[int32]
            more: float64

        stay_bytes(Odd)
        writer = self.speak(dds_topic, Odd, qos(user_data=user_data.encode()))
        self.writers[dds_topic] = writer, Odd
        return True

    def publish(self, topic, data):
        try:
            self.write(*self.writers[topic], base64.b64decode(data))
        except DDSException:  # the library looks at what it is given
            return False
        return True

    def subscribe(self, topic, type, reliable, latched):
        def take(raw):
            content = raw[:IMAGE_HEAD] if kind is Image_ else raw
            self.report(topic=topic, data=base64.b64encode(content).decode(), size=len(raw))

        kind = TYPES[type]
        quality = qos(reliable=reliable, latched=latched)
        reader = self.add_reader(f"rt{topic}", kind, take, quality)
        return self.matched(reader.get_matched_publications)

    def call(self, service):
        come = threading.Event()
        found = []

        def take(raw):
            if raw[4:20] == header:
                found.append(raw[:4] + raw[20:])
                come.set()

        header = struct.pack("<Qq", 77, time.monotonic_ns())
        quality = qos(user_data=b"clientid=1.2.3;")
        writer = self.speak(f"rq{service}Request", Request_, quality)
        reader = self.add_reader(f"rr{service}Reply", Response_, take, quality)
        self.askers[service] = writer
        both = self.matched(
            lambda: writer.get_matched_subscriptions() and reader.get_matched_publications()
        )
        if both:
            self.write(writer, Request_, b"\0\1\0\0" + header + b"\0")
            come.wait(MATCH_S)
        self.readers = [known for known in self.readers if known[0] is not reader]
        return base64.b64encode(found[0]).decode() if found else None

    def outlive(self, service):
        """Wait until a service that was called has no server any more."""
        return self.matched(lambda: not self.askers[service].get_matched_subscriptions())

    def create_service(self, service, answer):
        quality = qos(user_data=b"serviceid=1.2.3;")
        writer = self.speak(f"rr{service}Reply", Response_, quality)

        def take(raw):
            if answer is not None:
                body = base64.b64decode(answer)
                self.write(writer, Response_, body[:4] + raw[4:20] + body[4:])

        self.add_reader(f"rq{service}Request", Request_, take, quality)
        self.writers[f"service {service}"] = writer, Response_
        return self.matched(writer.get_matched_subscriptions)


def main():
    peer = Peer(int(sys.argv[1]), float(sys.argv[2]))
    peer.report(ready=True)
    for line in sys.stdin:
        fields = json.loads(line)
        operation = fields.pop("op")
        peer.report(done=getattr(peer, operation)(**fields))


if __name__ == "__main__":
    main()
