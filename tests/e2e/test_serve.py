"""`volery serve` and `volery run --page`: one address, and worlds that change behind it."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest
from child_process import start_child

roslibpy = pytest.importorskip("roslibpy")
VOLERY = [sys.executable, "-m", "volery"]
OWN = """
name = "{name}"
duration_s = 0.4
[types.f450]
airframe = "f450"
[[types.f450.sensors]]
kind = "ground_truth"
[[uavs]]
type = "f450"
position_m = [0.0, 0.0, {height}]
"""


class Server:
    """A process with a page; `lines` are what it says."""

    def __init__(self, *words, cwd=None):
        self.process = start_child(
            [*VOLERY, *map(str, words)], stderr=subprocess.PIPE, text=True, cwd=cwd
        )
        self.lines = []
        self._has_started = threading.Event()
        self._reader = threading.Thread(target=self._read)
        self._reader.start()
        assert self._has_started.wait(120), self.lines
        self.url = re.search(r"http://\S+:(\d+)/", "\n".join(self.lines))
        assert self.url, self.lines
        self.port = int(self.url[1])

    def _read(self):
        for line in self.process.stderr:
            self.lines.append(line.rstrip())
            if line.startswith("page"):
                self._has_started.set()
        self._has_started.set()

    def fetch(self, path, body=None):
        request = urllib.request.Request(f"http://127.0.0.1:{self.port}{path}", body)
        try:
            with urllib.request.urlopen(request, timeout=900) as response:
                return response.status, response.read()
        except urllib.error.HTTPError as error:
            with error:
                return error.code, error.read()

    @property
    def status(self):
        return json.loads(self.fetch("/api/status")[1])

    def wait_for(self, **wanted):
        self.wait_until(lambda status: wanted.items() <= status.items())

    def wait_until(self, good):
        end = time.monotonic() + 600.0
        while not good(status := self.status):
            assert time.monotonic() < end, (status, self.lines)
            time.sleep(0.05)

    def end(self, how=signal.SIGINT):
        if self.process.poll() is None:
            self.process.send_signal(how)
        code = self.process.wait(60)
        self._reader.join()
        self.process.stderr.close()
        return code


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    folder = tmp_path_factory.mktemp("served")
    server = Server("serve", "--port", 0, "--uavs", 2, "--recordings-dir", folder, "--threads", 1)
    server.wait_for(state="flying")
    yield server
    server.end(signal.SIGKILL)


class Ros:
    """A roslibpy client of the page's rosbridge."""

    def __init__(self, server):
        self.ros = roslibpy.Ros(f"ws://127.0.0.1:{server.port}/rosbridge")
        self.ros.run(20)

    def __enter__(self):
        return self

    def __exit__(self, *_exception):
        self.ros.close()

    def call(self, service, srvtype, **fields):
        asked = roslibpy.Service(self.ros, service, srvtype)
        return asked.call(roslibpy.ServiceRequest(fields), timeout=60)

    def load(self, name):
        source = {"world_resource": {"uri": name}}
        response = self.call("/load_world", "simulation_interfaces/LoadWorld", **source)
        return response["result"]

    def first(self, topic, msgtype, good=lambda message: True, seconds=60.0):
        """The first message that is good."""
        found, there = [], threading.Event()

        def take(message):
            if good(message):
                found.append(message)
                there.set()

        listener = roslibpy.Topic(self.ros, topic, msgtype)
        listener.subscribe(take)
        assert there.wait(seconds), topic
        listener.unsubscribe()
        return found[0]


def test_the_page_and_the_graph_are_at_one_address(server):
    assert server.fetch("/")[0] == 200
    assert server.status["scenario"] == "hover"
    assert server.fetch("/api/world.glb")[1].startswith(b"glTF")
    with Ros(server) as ros:
        odometry = ros.first("/uav2/odom", "nav_msgs/Odometry")
        assert odometry["child_frame_id"] == "uav2/base_link"
        assert ros.first("/volery/world", "std_msgs/String")["data"] == server.status["world"]


def test_another_world_flies_while_the_page_stays(server):
    before = server.status["world"]
    with Ros(server) as ros:
        assert ros.load("grid_map")["result"] == 1
    server.wait_for(state="flying", scenario="grid_map")
    assert server.status["world"] != before
    with Ros(server) as ros:
        shown = server.status["world"]
        changed = ros.call("/volery/set_grid_map", "volery_interfaces/SetGridMap", block_height=9.0)
        assert changed["success"]
        ros.first("/volery/world", "std_msgs/String", lambda message: message["data"] != shown)
        assert server.status["world"] != shown
        # the file is that of the higher blocks
        content = server.fetch("/api/world.glb")[1]
        length = int.from_bytes(content[12:16], "little")
        extras = json.loads(content[20 : 20 + length])["asset"]["extras"]
        assert extras["bounds_enu_m"]["max"][2] == 9.0
        assert extras["kind"] == "grid_map"


def test_an_uploaded_map_is_flown(server):
    status, content = server.fetch("/api/uploads?kind=grid_map&name=Yard.csv", b"0,0,1\n0,1,0\n")
    assert (status, json.loads(content)) == (201, {"scenario": "yard"})
    assert "yard" in [card["name"] for card in json.loads(server.fetch("/api/scenarios")[1])]
    with Ros(server) as ros:
        wanted = {"scenario": "yard", "changes": '{"uavs": 3}'}
        response = ros.call("/volery/load_scenario", "volery_interfaces/LoadScenario", **wanted)
        assert response["success"], response
    server.wait_for(state="flying", scenario="yard")
    with Ros(server) as ros:
        content = ros.first("/volery/vehicles", "volery_interfaces/VehicleStates")
        assert [vehicle["name"] for vehicle in content["vehicles"]] == ["uav1", "uav2", "uav3"]
    status, content = server.fetch("/api/uploads?kind=grid_map&name=Yard.csv", b"0,0,7\n")
    assert status == 422
    assert "line 1, column 3" in json.loads(content)["error"]


def test_a_scenario_that_ends_stays_and_one_that_cannot_be_leads_back(server):
    folder = server.process.args[server.process.args.index("--recordings-dir") + 1]
    for name, height in (("short", 0.5), ("buried", -30.0)):
        made = Path(folder) / "uploads" / name
        made.mkdir(parents=True, exist_ok=True)
        (made / "scenario.toml").write_text(OWN.format(name=name, height=height))
    with Ros(server) as ros:
        assert ros.load("short")["result"] == 1
    server.wait_for(state="ended", scenario="short")
    with Ros(server) as ros:
        state = ros.call("/get_simulation_state", "simulation_interfaces/GetSimulationState")
        assert state["state"]["state"] == 2  # paused
        with pytest.raises(roslibpy.core.ServiceException, match="continue_run"):
            ros.call("/uav1/land", "std_srvs/Trigger")
        assert ros.call("/volery/continue_run", "std_srvs/Trigger")["success"]
        assert server.status["state"] == "flying"
        assert ros.call("/uav1/land", "std_srvs/Trigger")["success"]
        reset = ros.call("/reset_simulation", "simulation_interfaces/ResetSimulation", scope=255)
        assert reset["result"]["result"] == 1
        assert ros.load("nowhere")["result"] != 1
        assert ros.load("buried")["result"] == 1
    server.wait_until(lambda status: status["message"].startswith("buried: "))
    server.wait_for(state="ended", scenario="short")
    assert server.status["message"].startswith("buried: ")
    with Ros(server) as ros:
        unloaded = ros.call("/unload_world", "simulation_interfaces/UnloadWorld")
        assert unloaded["result"]["result"] == 1
    server.wait_for(state="no_world", world=None)
    with Ros(server) as ros:
        assert ros.load("hover")["result"] == 1
    server.wait_for(state="flying", scenario="hover")


def test_ctrl_c_ends_it(server):
    assert server.end() == 0
    assert server.lines[-1] == "the server has stopped"
    assert not [line for line in server.lines if "Traceback" in line or "ERROR" in line]


def test_a_run_shows_its_flight_and_ends_by_itself_where_asked(tmp_path):
    words = ("run", "hover", "--seconds", 3, "--page=0", "--threads", 1, "--exit-at-end")
    server = Server(*words, cwd=tmp_path)
    server.wait_for(state="flying", scenario="hover")
    assert server.end(0) == 0


def test_a_run_with_a_page_writes_its_files_and_stays(tmp_path):
    log, report = tmp_path / "flight.mcap", tmp_path / "report" / "index.html"
    files = ("--record", log, "--report", report.parent)
    words = ("run", "hover", "--seconds", 1, "--page=0", "--threads", 1, *files)
    server = Server(*words, cwd=tmp_path)
    server.wait_for(state="ended", scenario="hover")
    assert report.is_file()
    size = log.stat().st_size
    with Ros(server) as ros:
        assert ros.call("/volery/continue_run", "std_srvs/Trigger")["success"]
        ros.first("/clock", "rosgraph_msgs/Clock", lambda m: m["clock"]["sec"] >= 2)
    assert log.stat().st_size == size
    assert server.end() == 0
    assert not [line for line in server.lines if "Traceback" in line or "ERROR" in line]


def test_a_first_scenario_that_is_wrong_ends_the_command(tmp_path):
    ran = subprocess.run(
        [*VOLERY, "serve", "nowhere", "--port", "0"],
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
        cwd=tmp_path,
    )
    assert ran.returncode == 2
    assert "no scenario 'nowhere'" in ran.stderr
    for words, why in (
        (["--host", "0.0.0.0"], "--allow-remote"),
        (["--host", "0.0.0.0", "--allow-remote"], "set a --token"),
    ):
        ran = subprocess.run(
            [*VOLERY, "serve", "--port", "0", *words],
            capture_output=True,
            text=True,
            timeout=900,
            check=False,
            cwd=tmp_path,
        )
        assert ran.returncode == 2
        assert why in ran.stderr


def test_a_log_is_served_with_the_verdicts_of_its_flight(tmp_path):
    scenario = tmp_path / "own.toml"
    expectation = '[[expect]]\nkind = "speed"\nat_most_m_s = 0.01\n'
    scenario.write_text(OWN.format(name="own", height=5.0) + expectation, encoding="utf-8")
    log = tmp_path / "own.mcap"
    subprocess.run(
        [*VOLERY, "run", str(scenario), "--record", str(log)], check=True, capture_output=True
    )
    server = Server("serve", log, "--port", 0)
    try:
        server.wait_for(state="flying", scenario="own")
        with Ros(server) as ros:
            message = ros.first("/volery/verdicts", "std_msgs/String")
            assert ros.first("/volery/player/state", "volery_interfaces/PlayerState")["end"] > 0.3
        found = json.loads(message["data"])
        assert (found["over"], [each["name"] for each in found["verdicts"]]) == (
            True,
            ["speed <= 0.01 m/s"],
        )
    finally:
        server.end(signal.SIGKILL)


def test_a_log_that_is_none_is_an_error(tmp_path):
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(b"no log")
    for path, reason in ((broken, "broken.mcap"), (tmp_path / "nowhere.mcap", "nowhere.mcap")):
        done = subprocess.run(
            [*VOLERY, "serve", str(path), "--port", "0"],
            check=False,
            capture_output=True,
            text=True,
            timeout=600.0,
        )
        assert done.returncode == 2
        assert "error: " in done.stderr
        assert reason in done.stderr
