"""A simulation with autopilots, and a ground station without sockets that talks to one of them."""

from __future__ import annotations

import math

import numpy as np

from volery.graph.messages import message_type
from volery.mavlink.codec import Parser, dialect
from volery.mavlink.framing import Framer
from volery.mavlink.scenario_setup import with_autopilots
from volery.runtime import Simulation
from volery.scenario.load import parse_scenario

NAN = math.nan
PACKETS = "volery_interfaces/msg/MavlinkPackets"
LINK = 7


def scenario(count=1, *, airframe="iris", nodes=(), sensors=(), **more):
    """Level ground, UAVs 5 m apart."""
    data = {
        "name": "flat",
        "duration_s": 1000.0,
        "types": {"iris": {"airframe": airframe, "nodes": list(nodes), "sensors": list(sensors)}},
        "uavs": [
            {
                "type": "iris",
                "count": count,
                "position_m": [0.0, 0.0],
                "last_position_m": [5.0 * max(count - 1, 1), 0.0],
            }
        ],
        **more,
    }
    return with_autopilots(parse_scenario(data, where="flat"))


class Station:
    """Talks to the autopilot of one UAV of `simulation`, in simulated time."""

    def __init__(self, simulation, uav="uav1", system=255, link=LINK, profile=0):
        self.simulation = simulation
        self.target = int(uav.removeprefix("uav"))
        self.link, self.profile = link, profile
        self._mav = dialect().MAVLink(None, system, 190)
        self._parser, self._framer = Parser(), Framer()
        self.deaf = False
        """Whether it passes over everything, to be quick."""
        self.received = []
        """Messages, the oldest first."""
        graph = simulation.graph
        self._out = graph.advertise(f"/{uav}/mavlink/in", PACKETS)
        graph.subscribe(f"/{uav}/mavlink/out", self._receive, PACKETS)
        self.send_bytes(b"")  # the link is there

    def _receive(self, published):
        if published.message.link == self.link and not self.deaf:
            frames = self._framer.datagram(bytes(published.message.data))
            decoded = [self._parser.decode(frame.data) for frame in frames]
            self.received += filter(None, decoded)  # of those that pymavlink knows

    def send(self, name, *fields):
        message = getattr(dialect(), f"MAVLink_{name}_message")(*fields)
        self.send_bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256

    def send_bytes(self, data):
        data = np.frombuffer(data, np.uint8)
        self._out.publish(
            message_type(PACKETS)(link=self.link, profile=self.profile, closed=False, data=data)
        )
        self.simulation.process_commands()
        self.simulation.graph.deliver()

    def seconds(self, seconds):
        self.simulation.run(seconds)

    def of(self, kind):
        return [message for message in self.received if message.get_type() == kind]

    def last(self, kind):
        found = self.of(kind)
        assert found, f"no {kind}; received {sorted({m.get_type() for m in self.received})}"
        return found[-1]

    @property
    def texts(self):
        """STATUSTEXTs, those in pieces put together."""
        whole = []
        for message in self.of("STATUSTEXT"):
            if message.chunk_seq:
                whole[-1] += message.text
            else:
                whole.append(message.text)
        return whole

    def command(self, number, *params):
        """Result of a COMMAND_LONG; params that are left out are nan."""
        filled = (*params, *(NAN,) * (7 - len(params)))
        before = len(self.of("COMMAND_ACK"))
        self.send("command_long", self.target, 1, number, 0, *filled)
        acks = self.of("COMMAND_ACK")[before:]
        assert [ack.command for ack in acks] == [number]
        return acks[0].result

    def mode(self, main, sub=0):
        return self.command(176, 1.0, float(main), float(sub))

    def send_heartbeat(self):
        """Send the heartbeat of a ground station."""
        self.send("heartbeat", 6, 8, 0, 0, 4, 3)

    def up(self, height=3.0):
        """Arm and take off."""
        self.set("MIS_TAKEOFF_ALT", height)
        assert self.command(400, 1.0) == 0
        assert self.command(22) == 0
        self.seconds(2.0 + height)

    def set(self, name, value):
        """Set a parameter; the value that holds then."""
        kind, carried = 9, float(value)
        if isinstance(value, int):
            kind, carried = 6, float(np.array(value, np.int32).view(np.float32))
        before = len(self.of("PARAM_VALUE"))
        self.send("param_set", self.target, 1, name.encode(), carried, kind)
        values = [m for m in self.of("PARAM_VALUE")[before:] if m.param_id == name]
        if not values:
            return None
        value = values[-1].param_value
        whole = values[-1].param_type == 6
        return int(np.array(value, np.float32).view(np.int32)) if whole else value

    def send_position(self, x, y, z, mask=2552, yaw=0.0, frame=1):
        """A local setpoint, NED."""
        fields = (0, self.target, 1, frame, mask, x, y, z, 0, 0, 0, 0, 0, 0, yaw, 0)
        self.send("set_position_target_local_ned", *fields)

    def velocity(self, x, y, z, mask=2503, yaw=0.0, rate=0.0, frame=1):
        fields = (0, self.target, 1, frame, mask, 0, 0, 0, x, y, z, 0, 0, 0, yaw, rate)
        self.send("set_position_target_local_ned", *fields)

    def stream(self, seconds, what, *args, every=0.05, **kwargs):
        """Send the same setpoint again and again."""
        for _ in range(round(seconds / every)):
            what(*args, **kwargs)
            self.seconds(every)

    def upload(self, items, kind=0):
        """Send a plan; the result, None where the vehicle never says."""
        before = len(self.of("MISSION_ACK"))
        self.send("mission_count", self.target, 1, len(items), kind)
        for _ in range(3 * len(items) + 3):
            acks = self.of("MISSION_ACK")[before:]
            if acks:
                return acks[-1].type
            asked = self.last("MISSION_REQUEST_INT").seq
            self.item(asked, items[asked], kind)
        return None

    def item(self, sequence, item, kind=0):
        command, frame, params, x, y, z = item
        fields = (frame, command, 0, 1, *params, round(x * 1e7), round(y * 1e7), z, kind)
        self.send("mission_item_int", self.target, 1, sequence, *fields)

    @property
    def heartbeat(self):
        return self.last("HEARTBEAT")

    @property
    def armed(self):
        return bool(self.heartbeat.base_mode & 128)

    @property
    def present_mode(self):
        custom = self.heartbeat.custom_mode
        return custom >> 16 & 255, custom >> 24 & 255


def fly(**kwargs):
    simulation = Simulation(scenario(**kwargs), threads=1)
    return simulation, Station(simulation)
