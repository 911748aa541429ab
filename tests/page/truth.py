"""What is true in the simulation, by a client of its own (`served.ros`), not by the page."""

from __future__ import annotations

import time

VEHICLES = "volery_interfaces/msg/VehicleStates"
STATUS = "volery_interfaces/msg/SimulationStatus"


def until(fits, timeout_s=180.0, what="it did not become true"):
    """The first answer of `fits()` that is true."""
    ends = time.monotonic() + timeout_s
    while not (found := fits()):
        assert time.monotonic() < ends, what
        time.sleep(0.1)
    return found


def vehicle(served, uav, fits=lambda _: True, timeout_s=180.0):
    """The UAV, once it is so."""
    found = {}

    def look(message):
        found.update({each["name"]: each for each in message["vehicles"]})
        return uav in found and fits(found[uav])

    served.once("/volery/vehicles", VEHICLES, look, timeout_s)
    return found[uav]


def place(served, uav):
    """(x, y, z) m, map: where it is."""
    at = vehicle(served, uav)["position"]
    return at["x"], at["y"], at["z"]


def status(served, fits=lambda _: True, timeout_s=180.0):
    """What the simulation says of itself, once it is so."""
    return served.once("/volery/status", STATUS, fits, timeout_s)


def weather(served, fits=lambda _: True, timeout_s=180.0):
    """The weather, once it is so."""
    ends = time.monotonic() + timeout_s
    while not fits(told := served.call("/volery/get_weather", "volery_interfaces/srv/GetWeather")):
        assert time.monotonic() < ends, f"the weather stayed {told}"
        time.sleep(0.2)
    return told


def put(served, uav, x, y, z):
    """Place a UAV somewhere, at rest, turned to the east."""
    pose = {"position": {"x": x, "y": y, "z": z}, "orientation": {"w": 1.0}}
    request = {
        "entity": uav,
        "state": {"header": {"frame_id": "map"}, "pose": pose},
        "set_pose": True,
        "set_twist": True,
    }
    told = served.call("/set_entity_state", "simulation_interfaces/srv/SetEntityState", request)
    assert told["result"]["result"] == 1, told


def stamp_ns(told):
    """Simulated time of a status."""
    return told["stamp"]["sec"] * 10**9 + told["stamp"]["nanosec"]
