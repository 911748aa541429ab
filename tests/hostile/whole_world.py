"""A simulation that offers every service there is, and clients that send it hostile requests."""

from __future__ import annotations

import numpy as np
from rosbags.interfaces import Nodetype

from volery.bridges.rosbridge.rosapi import RosApi
from volery.graph.service_reply import ServiceReply
from volery.graph.typestore import typestore

SENSORS = [
    {"kind": "lidar", "noise": False},
    {"kind": "imu"},
    {"kind": "sonar", "position_m": [0.0, 0.0, -0.05], "rpy_deg": [0.0, 90.0, 0.0]},
    {"kind": "odometry"},
    {"kind": "gnss"},
    {"kind": "barometer"},
    {"kind": "magnetometer"},
    {"kind": "battery"},
    {"kind": "ground_truth"},
]
GAP_FOLLOWING = {
    "node": "gap_following",
    "parameters": {"route": [[60.0, 0.0]]},
}
MAVLINK = {"node": "mavlink_autopilot"}
COVERAGE = {
    "node": "coverage",
    "parameters": {"uavs": ["uav1", "uav2"], "height_m": 2.5, "crossing_height_m": 10.0},
}
PLANNING = [
    {"node": name, "parameters": {"odometry": "odom"}}
    for name in (
        "task_manager",
        "exploration",
        "global_planner",
        "local_planner",
        "trajectory_follower",
        "mapping",
    )
]


def whole_data(folder):
    """Scenario data: two UAVs that fly by themselves, a kinematic one, actors, blocks, radios."""
    blocks = folder / "blocks.csv"
    blocks.write_text("0,0,1\n0,0,0\n")
    walker = {"kind": "external", "position_m": [0.0, 30.0]}
    circle = {
        "kind": "circle",
        "centre_m": [0.0, 40.0, 20.0],
        "radius_m": 5.0,
        "speed_m_s": 3.0,
    }
    return {
        "name": "whole",
        "duration_s": 100000.0,
        "radio": {},
        "world": {
            "terrain": {"kind": "flat", "extent_m": 200.0},
            "grid_map": {
                "maps": [{"file": str(blocks)}],
                "cell_size_m": 3.0,
                "block_height_m": 6.0,
                "origin_m": [20.0, 60.0],
            },
            "actors": [
                {"name": "walker", "shape": "person", "motion": walker},
                {"name": "gull", "shape": "bird", "motion": circle},
            ],
        },
        "types": {
            "f450": {"sensors": SENSORS, "nodes": [GAP_FOLLOWING, MAVLINK]},
            "searcher": {"sensors": SENSORS, "nodes": PLANNING},
            "puppet": {
                "plant": "kinematic",
                "sensors": [{"kind": "ground_truth"}],
            },
        },
        "uavs": [
            {
                "type": "f450",
                "count": 2,
                "position_m": [0.0, 0.0],
                "last_position_m": [8.0, 0.0],
                "on_start": "take_off",
            },
            {"type": "puppet", "position_m": [0.0, 10.0, 3.0]},
            {"type": "searcher", "position_m": [0.0, 20.0]},
        ],
        "nodes": [COVERAGE],
    }


class Client:
    """A session that collects its responses."""

    def __init__(self, simulation, name="stranger"):
        self.simulation = simulation
        self.session = simulation.gateway.open(name)

    def call(self, service, request):
        """The response of a service after a step, or an error; None: there is none."""
        responses = []
        self.session.call(service, request, ServiceReply(responses.append, responses.append))
        self.simulation.process_commands()
        return responses[0] if responses else None

    def publish(self, topic, message):
        self.session.advertise(topic, message.__msgtype__)
        self.session.publish(topic, message)
        self.simulation.process_commands()


NASTY_FLOATS = (float("nan"), float("inf"), float("-inf"), 1e308, -1e308, 1e18, -1.0, 0.0)
NASTY_TEXTS = ("", " ", "uav9", "\x00", "../../etc/passwd", "x" * 100_000, "{", "1e999", "\ud7ff")


def nasty_values(described):
    """Values that are hard to take for a field of this type; of messages inside: none."""
    kind, detail = described
    if kind == Nodetype.BASE:
        return _nasty_scalars(detail[0])
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        (inner, inner_detail), size = detail
        if inner == Nodetype.NAME:
            return []
        name = inner_detail[0]
        length = size if kind == Nodetype.ARRAY else 3
        if name == "string":
            return [[text] * length for text in NASTY_TEXTS]
        dtype = np.dtype({"bool": "?", "byte": "int8", "char": "uint8"}.get(name, name))
        values = [np.full(length, value, dtype) for value in _nasty_scalars(name)]
        if kind == Nodetype.SEQUENCE:
            values += [np.zeros(0, dtype), np.zeros(100_000, dtype)]
        return values
    return []


def _nasty_scalars(name):
    if name.startswith("float"):
        small = float(np.finfo(np.float32).max) if name == "float32" else 1e308
        return [value for value in NASTY_FLOATS if not abs(value) > small or np.isinf(value)]
    if name == "bool":
        return [True, False]
    if name == "string":
        return list(NASTY_TEXTS)
    info = np.iinfo({"byte": "int8", "char": "uint8"}.get(name, name))
    return sorted({int(info.min), int(info.max), -1 if info.min < 0 else 1, 0})


def leaves(msgtype, path=()):
    """Paths of all fields that hold no message, and their types."""
    for name, described in typestore().fielddefs[msgtype][1]:
        kind, detail = described
        if kind == Nodetype.NAME:
            yield from leaves(detail, (*path, name))
        elif name != "structure_needs_at_least_one_member":
            yield (*path, name), described


def put(message, path, value):
    """Set a field of a message, or of one inside it."""
    for name in path[:-1]:
        message = getattr(message, name)
    setattr(message, path[-1], value)


def offer_rosapi(run):
    """Offer what rosbridge's server does beside a simulation or a player."""
    api = RosApi(run.gateway, "ros2", run.graph.now_ns)
    api.start()
    return api
