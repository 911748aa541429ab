"""What is true in the simulation, by a client of its own (`served.ros`), not by the page."""

from __future__ import annotations

import time
from contextlib import contextmanager
from itertools import pairwise

VEHICLES = "volery_interfaces/msg/VehicleStates"
STATUS = "volery_interfaces/msg/SimulationStatus"


def until(fits, timeout_s=600.0, what="it did not become true"):
    """The first result of `fits()` that is true."""
    ends = time.monotonic() + timeout_s
    while not (found := fits()):
        assert time.monotonic() < ends, what
        time.sleep(0.1)
    return found


def vehicle(served, uav, fits=lambda _: True, timeout_s=600.0):
    """The UAV, once it is so."""
    found = {}

    def look(message):
        found.update({each["name"]: each for each in message["vehicles"]})
        return uav in found and fits(found[uav])

    served.once("/volery/vehicles", VEHICLES, look, timeout_s)
    return found[uav]


def position_of(served, uav):
    """(x, y, z) m, map: where it is."""
    at = vehicle(served, uav)["position"]
    return at["x"], at["y"], at["z"]


def status(served, fits=lambda _: True, timeout_s=600.0):
    """What the simulation says of itself, once it is so."""
    return served.once("/volery/status", STATUS, fits, timeout_s)


def collect_statuses(served):
    """Context with the list of what the simulation says of itself, from before its block on."""
    return served.collect("/volery/status", STATUS)


def collect_vehicles(served):
    """Context with the list of the states of all UAVs, from before its block on."""
    return served.collect("/volery/vehicles", VEHICLES)


def first_after_return(statuses):
    """The first status after simulated time has gone back; None: it has not yet."""
    return next(
        (after for before, after in pairwise(list(statuses)) if stamp_ns(after) < stamp_ns(before)),
        None,
    )


def of_uav(messages, uav):
    """The states of one UAV in messages."""
    return [one for message in list(messages) for one in message["vehicles"] if one["name"] == uav]


def pass_seconds(served, seconds):
    """Wait until so much simulated time has passed."""
    ends_ns = stamp_ns(status(served)) + int(seconds * 1e9)
    status(served, lambda message: stamp_ns(message) >= ends_ns)


def set_speed(served, factor):
    """Real-time factor; 0: as fast as possible."""
    served.call("/volery/set_speed", "volery_interfaces/srv/SetSpeed", {"factor": factor})


@contextmanager
def hurried(served):
    """Simulated time passes as fast as it can, then in real time again.

    For flights and take-offs without manual control.
    """
    set_speed(served, 0.0)
    try:
        yield
    finally:
        set_speed(served, 1.0)


def weather(served, fits=lambda _: True, timeout_s=600.0):
    """The weather, once it is so."""
    ends = time.monotonic() + timeout_s
    while not fits(
        response := served.call("/volery/get_weather", "volery_interfaces/srv/GetWeather")
    ):
        assert time.monotonic() < ends, f"the weather stayed {response}"
        time.sleep(0.2)
    return response


def put(served, uav, x, y, z):
    """Place a UAV somewhere, at rest, turned to the east."""
    pose = {"position": {"x": x, "y": y, "z": z}, "orientation": {"w": 1.0}}
    request = {
        "entity": uav,
        "state": {"header": {"frame_id": "map"}, "pose": pose},
        "set_pose": True,
        "set_twist": True,
    }
    response = served.call("/set_entity_state", "simulation_interfaces/srv/SetEntityState", request)
    assert response["result"]["result"] == 1, response


def stamp_ns(message):
    """Simulated time of a status."""
    return message["stamp"]["sec"] * 10**9 + message["stamp"]["nanosec"]
