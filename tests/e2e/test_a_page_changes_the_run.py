"""Requests of a page over rosbridge, while the simulation runs and while it is paused."""

from __future__ import annotations

import json
import threading
import time

import pytest

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.rosbridge.server import RosbridgeServer

roslibpy = pytest.importorskip("roslibpy")

DATA = {
    "name": "page",
    "world": {"grid_map": {"block_height_m": 4.0, "origin_m": [40.0, 40.0]}},
    "types": {
        "f450": {
            "sensors": [
                {"kind": "lidar", "name": "nodding", "nodding": {}, "position_m": [0, 0, 0.2]},
                {"kind": "imu"},
            ]
        }
    },
    "uavs": [
        {
            "type": "f450",
            "count": 2,
            "position_m": [0.0, 0.0, 5.0],
            "last_position_m": [10.0, 0.0],
        }
    ],
}
PLAYING, PAUSED = 1, 2
WEATHER = {
    "wind": {"x": 3.0, "y": -1.0, "z": 0.0},
    "w20": 6.0,
    "rain": 12.0,
    "snow": 1.0,
    "fog_visibility": 80.0,
    "dust_visibility": 300.0,
    "hour_of_day": 18.5,
}
INVALID_POSE = 101


def until(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.01)


class Page:
    """A web client: the last message of each topic, and the services that it calls."""

    def __init__(self, port):
        self.ros = roslibpy.Ros("127.0.0.1", port)
        self.ros.run(timeout=60.0)
        self.received = {}

    def watch(self, name, msgtype):
        def receive(message):
            self.received[name] = message

        roslibpy.Topic(self.ros, name, msgtype).subscribe(receive)
        until(lambda: name in self.received)

    def call(self, name, srvtype, /, **fields):
        client = roslibpy.Service(self.ros, name, srvtype)
        return client.call(roslibpy.ServiceRequest(fields), timeout=60)

    def volery(self, name, srvtype, /, **fields):
        return self.call(f"/volery/{name}", f"volery_interfaces/{srvtype}", **fields)

    def set_state(self, state):
        response = self.call(
            "/set_simulation_state",
            "simulation_interfaces/SetSimulationState",
            state={"state": state},
        )
        assert response["result"]["result"] == 1, response

    def put(self, name, position, turn=(0.0, 0.0, 0.0, 1.0)):
        pose = {
            "position": dict(zip("xyz", position, strict=True)),
            "orientation": dict(zip("xyzw", turn, strict=True)),
        }
        return self.call(
            "/set_entity_state",
            "simulation_interfaces/SetEntityState",
            entity=name,
            set_pose=True,
            state={"pose": pose},
        )["result"]

    def position_of(self, name):
        for transform in self.received["/ground_truth/tf"]["transforms"]:
            if transform["child_frame_id"] == f"{name}/base_link":
                at = transform["transform"]["translation"]
                return [at["x"], at["y"], at["z"]]
        return None


@pytest.fixture
def opened(simulate):
    """A run in real time behind a bridge, and a page that watches it."""
    simulation = simulate(DATA)
    server = RosbridgeServer("127.0.0.1", 0)
    with BridgeHost(simulation.gateway) as bridges:
        bridges.open(server)
        simulation.gateway.use_low_latency()
        thread = threading.Thread(target=lambda: simulation.run(600.0, speed=1.0))
        thread.start()
        page = Page(server.port)
        page.watch("/ground_truth/tf", "tf2_msgs/TFMessage")
        page.watch("/volery/vehicles", "volery_interfaces/VehicleStates")
        page.watch("/volery/status", "volery_interfaces/SimulationStatus")
        yield simulation, page
        page.ros.close()
        simulation.clock.quit()
        thread.join()


@pytest.mark.parametrize("state", [PLAYING, PAUSED])
def test_the_air_changes(opened, state):
    simulation, page = opened
    page.watch("/weather", "volery_interfaces/Weather")
    if state == PAUSED:
        page.set_state(PAUSED)
        until(lambda: page.received["/volery/status"]["state"] == PAUSED)
    for name, value in WEATHER.items():
        assert page.volery("set_weather", "SetWeather", only=[name], **{name: value})["success"]
        until(lambda name=name, value=value: page.received["/weather"][name] == value)
    assert simulation.world.weather.velocity_map == (3.0, -1.0, 0.0)
    assert simulation.world.weather.particles.rain_mm_h == 12.0
    gust = {"amplitude": {"x": 2.0, "y": 0.0, "z": 0.0}, "rise": 0.5, "duration": 5.0}
    assert page.volery("gust", "Gust", **gust)["success"]
    until(lambda: len(page.received["/weather"]["gusts"]) == 1)
    refused = page.volery("set_weather", "SetWeather", only=["rain"], rain=-1.0)
    assert not refused["success"]
    assert "rain" in refused["message"]


@pytest.mark.parametrize("state", [PLAYING, PAUSED])
def test_blocks_change(opened, state):
    simulation, page = opened
    if state == PAUSED:
        page.set_state(PAUSED)
    info = {"resolution": 2.0, "width": 2, "height": 1}
    info["origin"] = {"position": {"x": 40.0, "y": 40.0}, "orientation": {"w": 1.0}}
    message = {"header": {"frame_id": "map"}, "info": info, "data": [100, 0]}
    roslibpy.Topic(page.ros, "/map_command", "nav_msgs/OccupancyGrid").publish(message)
    page.watch("/map", "nav_msgs/OccupancyGrid")
    response = page.volery("set_grid_map", "SetGridMap", block_height=9.0, cell_size=3.0)
    assert response["success"], response["message"]
    until(lambda: page.received["/map"]["info"]["resolution"] == 3.0)
    grid_map = page.volery("get_grid_map", "GetGridMap")
    assert (grid_map["block_height"], grid_map["cell_size"], grid_map["columns"]) == (9.0, 3.0, 2)
    assert simulation.world.scene.clearance([[41.0, 41.0, 8.0]], 5.0).distance[0] <= 0.5


@pytest.mark.parametrize("state", [PLAYING, PAUSED])
def test_a_uav_is_dragged_elsewhere_and_holds_there(opened, state):
    simulation, page = opened
    if state == PAUSED:
        page.set_state(PAUSED)
    there = [-6.0, 8.0, 7.0]
    assert page.put("uav1", there)["result"] == 1
    until(lambda: page.position_of("uav1") == pytest.approx(there, abs=0.1))
    until(lambda: page.received["/volery/vehicles"]["vehicles"][0]["mode"] == "HOLD")
    for position, word in (
        ([10.0, 0.0, 5.0], "uav2"),
        ([0.0, 0.0, -3.0], "ground"),
        ([9999.0, 0.0, 5.0], "terrain"),
    ):
        refused = page.put("uav1", position)
        assert refused["result"] == INVALID_POSE
        assert word in refused["error_message"]
    assert "there is no entity" in page.put("uav9", there)["error_message"]
    assert page.position_of("uav1") == pytest.approx(there, abs=0.1)
    if state == PAUSED:
        page.set_state(PLAYING)
    begun_s = simulation.time_s
    until(lambda: simulation.time_s > begun_s + 3.0)
    assert page.position_of("uav1") == pytest.approx(there, abs=0.2)
    assert page.received["/volery/vehicles"]["vehicles"][0]["mode"] == "HOLD"
    assert page.received["/volery/vehicles"]["vehicles"][0]["command_age"] == -1.0


def test_steps_snapshots_and_restoring(opened):
    simulation, page = opened
    page.set_state(PAUSED)
    page.watch("/weather", "volery_interfaces/Weather")
    paused_at = simulation.time_ns
    for name in ("first", "second"):
        assert page.volery("save_snapshot", "ByName", name=name)["success"]
        page.call("/step_simulation", "simulation_interfaces/StepSimulation", steps=40)
    snapshots = page.volery("list_snapshots", "ListSnapshots")
    assert snapshots["names"] == ["first", "second"]
    stamps = [stamp["sec"] * 1_000_000_000 + stamp["nanosec"] for stamp in snapshots["stamps"]]
    assert stamps == [paused_at, paused_at + 40_000_000]
    page.volery("set_weather", "SetWeather", only=["rain"], rain=5.0)
    until(lambda: page.received["/weather"]["rain"] == 5.0)
    page.put("uav2", [20.0, 20.0, 5.0])
    until(lambda: page.position_of("uav2")[0] == 20.0)
    assert page.volery("restore_snapshot", "ByName", name="first")["success"]
    until(lambda: page.received["/weather"]["rain"] == 0.0)
    until(lambda: page.position_of("uav2")[0] == pytest.approx(10.0, abs=0.1))
    stamp = page.received["/ground_truth/tf"]["transforms"][0]["header"]["stamp"]
    assert stamp["sec"] * 1_000_000_000 + stamp["nanosec"] == paused_at


def test_returns_and_commands_are_published(opened):
    _simulation, page = opened
    page.watch("/uav1/laser/nodding/points", "sensor_msgs/PointCloud2")
    assert page.received["/uav1/laser/nodding/points"]["header"]["frame_id"] == "uav1/base_link"
    assert page.call("/uav2/land", "std_srvs/Trigger")["success"]

    def landing():
        vehicle = page.received["/volery/vehicles"]["vehicles"][1]
        return vehicle["mode"] == "LAND" and 0.0 <= vehicle["command_age"] < 1.0

    until(landing)
    assert page.received["/volery/vehicles"]["vehicles"][0]["command_age"] == -1.0
    choices = page.volery("get_scenario_options", "GetScenarioOptions")
    assert "uavs" in json.loads(choices["changes_schema"])["properties"]
    refused = page.volery("load_scenario", "LoadScenario", scenario="hover", changes='{"uavs": 2}')
    assert not refused["success"]
