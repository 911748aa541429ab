"""`volery play`: a recorded log behind a bridge, in a process of its own."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time

import pytest
from child_process import start_child

from volery.bridges.logs.log_writer import create_log
from volery.bridges.rosbridge.client import RosbridgeClient
from volery.graph.codecs.zero import zero_message
from volery.graph.connection import call_and_wait
from volery.runtime import Simulation
from volery.scenario.load import load_scenario

PLAY = [sys.executable, "-m", "volery", "play"]


@pytest.fixture
def flight(tmp_path):
    log = create_log(tmp_path / "flight.mcap")
    with Simulation(load_scenario("hover"), threads=1) as simulation:
        simulation.graph.subscribe_all(log.write)
        simulation.run(2.0)
    log.close()
    return log.path


def seek(client, second):
    request = zero_message("volery_interfaces/srv/Seek_Request")
    request.time = second
    return call_and_wait(client, "/volery/player/seek", request, 60.0)


def test_a_log_is_played_to_a_client(flight):
    process = start_child(
        [*PLAY, flight, "--paused", "--bridge", "rosbridge=0"], stderr=subprocess.PIPE, text=True
    )
    try:
        head = process.stderr.readline()
        assert "a flight of 'hover'" in head
        port = re.match(r"open .*127\.0\.0\.1:(\d+)", process.stderr.readline())[1]
        client = RosbridgeClient(f"ws://127.0.0.1:{port}")
        odom = client.subscribe("/uav1/odom", "nav_msgs/msg/Odometry", wake=lambda: None)
        for second in (1.5, 0.25, 1.0):
            assert seek(client, second).success
            until = time.monotonic() + 60.0
            stamps = []
            while not any(second - 0.021 < stamp <= second for stamp in stamps):
                assert time.monotonic() < until
                messages = [p.message for p in odom.take()]
                stamps += [m.header.stamp.sec + m.header.stamp.nanosec / 1e9 for m in messages]
        info = call_and_wait(client, "/volery/player/info", None, 60.0)
        assert (info.file, info.state, info.position) == ("flight.mcap", 2, 1.0)
        client.close()
        process.send_signal(signal.SIGINT)
        _, output = process.communicate(timeout=60.0)
        assert "Stopped with Ctrl-C at 1.000 s" in output
    finally:
        process.kill()
        process.wait()


def test_a_log_that_cannot_be_played_is_reported_in_a_line(tmp_path):
    path = tmp_path / "nothing.mcap"
    create_log(path).close()
    for words, reason in (
        ((path,), "no readable message"),
        ((tmp_path / "none.bag",), "cannot read"),
        ((path, "--speed", "fast"), "--speed"),
    ):
        done = subprocess.run(
            [*PLAY, *words], check=False, capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 2
        assert reason in done.stderr
        assert "Traceback" not in done.stderr
