"""`volery run --workers` with real processes: the same flight, also after a worker was killed."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import volery

SCENARIO = """
name = "couple"
duration_s = 8.0
[world.forest]
kind = "procedural"
region_m = [20.0, -30.0, 80.0, 30.0]
trees = 60
species = { conifer = 1.0 }
[types.a]
airframe = "f450"
[[types.a.sensors]]
kind = "lidar"
name = "horizontal"
[[types.a.sensors]]
kind = "odometry"
[[types.a.nodes]]
node = "speaker:Speaker"
[[types.a.nodes]]
node = "gap_following"
parameters = { route = [[60.0, 0.0]], height_m = 2.0, speed_m_s = 2.0 }
[[uavs]]
type = "a"
count = 2
position_m = [0.0, -6.0]
last_position_m = [0.0, 6.0]
"""
SPEAKER = """
from rclpy.node import Node

class Speaker(Node):
    def __init__(self):
        super().__init__("speaker")
        self.create_timer(0.5, self.speak)

    def speak(self):
        self.get_logger().info(f"{self.get_namespace()} speaks")
"""
END_S = 600.0


@pytest.fixture
def couple(tmp_path):
    path = tmp_path / "couple.toml"
    path.write_text(SCENARIO)
    (tmp_path / "speaker.py").write_text(SPEAKER)
    return path


@pytest.fixture
def start():
    """Starts a command of Volery, which ends with the test."""
    started = []

    def begin(*words, token=None, **options):
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "volery", *map(str, words)],
            env={**os.environ, **({"VOLERY_TOKEN": token} if token else {})},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            **options,
        )
        started.append(process)
        return process

    yield begin
    for process in started:
        process.kill()
        process.communicate()


def ended(process):
    """Waits for the end of a process; returns its output."""
    output = process.communicate(timeout=END_S)[0]
    assert process.returncode == 0, output
    return output


def digest_of(output):
    return re.search(r"^topics +(\w{64})$", output, re.MULTILINE)[1]


def until(condition, process):
    """Waits until a condition is true while a process runs."""
    end = time.monotonic() + END_S
    while not condition():
        assert process.poll() is None, process.stdout.read()
        assert time.monotonic() < end
        time.sleep(0.02)


def children(pid):
    return [int(each) for each in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def test_a_killed_worker_is_replaced_and_the_flight_stays_the_same(start, couple, tmp_path):
    log = tmp_path / "flight.mcap"
    words = ("run", couple, "--trust", "--workers", 1, "--digest", "--record", log, "--speed", 3)
    leader = start(*words)
    until(lambda: log.exists() and log.stat().st_size > 100_000, leader)  # it flies
    (worker,) = children(leader.pid)
    os.kill(worker, signal.SIGKILL)
    output = ended(leader)
    assert "worker 1 is lost: " in output
    assert "this machine repeats its part so far and takes it over" in output
    assert digest_of(output) == digest_of(ended(start("run", couple, "--trust", "--digest")))
    for uav in ("uav1", "uav2"):  # the nodes of both machines speak on the leader's terminal
        assert output.count(f"/{uav} speaks") >= 15
    topics = volery.open_log(log).topics
    scans = [len(volery.open_log(log)[f"/uav{k}/laser/horizontal/scan"]) for k in (1, 2)]
    assert "/uav2/cmd_vel" in topics
    assert scans[0] == scans[1] > 300


def test_workers_join_from_elsewhere(start, couple):
    listen = ("--workers", 1, "--listen", "127.0.0.1:0")
    leader = start("run", couple, "--trust", *listen, "--digest", "--speed", 3, token="a")
    address = re.search(r"volery worker --join (\S+)", leader.stdout.readline())[1]
    intruder = start("worker", "--join", address, token="b")
    assert "the token is wrong" in intruder.communicate(timeout=END_S)[0]
    assert intruder.returncode == 2
    assert "was refused: the token is wrong" in leader.stdout.readline()
    worker = start("worker", "--join", address, token="a")
    assert "worker 1 (127.0.0.1) has joined" in leader.stdout.readline()
    output = [leader.stdout.readline()]
    assert "node 'speaker:Speaker' cannot be imported" in output[0]
    assert "waiting for another worker" in output[0]
    assert worker.wait(END_S) == 2
    worker = start("worker", "--join", address, "--trust", token="a", cwd=couple.parent)
    while "/uav2 speaks" not in (line := worker.stdout.readline()):
        assert line, "the worker ended"
    worker.kill()  # the substitute reads the scenario's folder
    output = ended(leader)
    assert "this machine repeats its part so far and takes it over" in output
    alone = start("run", couple, "--trust", "--digest")
    assert digest_of(output) == digest_of(ended(alone))
