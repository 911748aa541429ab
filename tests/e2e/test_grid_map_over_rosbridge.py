"""A plain web client, roslibpy, that sends a map, watches `/map` and changes it by services."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.rosbridge.server import RosbridgeServer

roslibpy = pytest.importorskip("roslibpy")

DATA = {
    "name": "sent_blocks",
    "world": {"grid_map": {"block_height_m": 4.0}},
    "types": {
        "f450": {"plant": "kinematic", "sensors": [{"kind": "lidar", "noise": False}]},
    },
    "uavs": [{"type": "f450", "position_m": [0.0, 0.0, 2.0]}],
}
MESSAGE = {
    "header": {"frame_id": "map"},
    "info": {
        "resolution": 2.0,
        "width": 2,
        "height": 2,
        "origin": {"position": {"x": 3.0, "y": -2.0}, "orientation": {"w": 1.0}},
    },
    "data": [0, 0, 100, -1],
}


def until(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.01)


@pytest.fixture
def running(simulate):
    simulation = simulate(DATA)
    simulation.step(1)
    over = threading.Event()

    def run():
        while not over.is_set():
            simulation.run(0.2, speed=1.0)

    server = RosbridgeServer("127.0.0.1", 0)
    with BridgeHost(simulation.gateway) as bridges:
        bridges.open(server)
        simulation.gateway.use_low_latency()
        thread = threading.Thread(target=run)
        thread.start()
        yield simulation, server.port
        over.set()
        thread.join()


def test_a_web_client_builds_the_world(running):
    simulation, port = running
    ros = roslibpy.Ros("127.0.0.1", port)
    ros.run(timeout=60.0)
    try:
        maps, scans = [], []
        roslibpy.Topic(ros, "/map", "nav_msgs/OccupancyGrid").subscribe(maps.append)
        topic = "/uav1/laser/horizontal/scan"
        roslibpy.Topic(ros, topic, "sensor_msgs/LaserScan").subscribe(scans.append)
        until(lambda: scans)
        sender = roslibpy.Topic(ros, "/map_command", "nav_msgs/OccupancyGrid")
        sender.publish(roslibpy.Message(MESSAGE))
        until(lambda: maps)
        assert maps[-1]["data"] == [0, 0, 100, 0]
        assert maps[-1]["info"]["origin"]["position"] == {"x": 3.0, "y": -2.0, "z": 0.0}
        until(lambda: ahead(scans[-1]) == pytest.approx(3.0, abs=1e-3))
        service = roslibpy.Service(ros, "/volery/set_grid_map", "volery_interfaces/SetGridMap")
        response = service.call(roslibpy.ServiceRequest({"block_height": 0.5}), timeout=60)
        assert response["success"]
        assert "'map_command', 2 x 2 cells of 2 m, blocks 0.5 m high" in response["message"]
        until(lambda: ahead(scans[-1]) is None or np.isinf(ahead(scans[-1])))
        response = service.call(roslibpy.ServiceRequest({"name": "x"}), timeout=60)
        assert (response["success"], response["message"]) == (
            False,
            "there is no grid map 'x'; known: map_command",
        )
    finally:
        ros.close()
    assert [event.kind.value for event in simulation.diagnostics.events] == ["world"] * 2


def ahead(scan):
    """What stands straight ahead; JSON has no infinity, so that None is nothing."""
    return scan["ranges"][len(scan["ranges"]) // 2]
