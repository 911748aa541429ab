"""The recipes of docs/bridges.md for roslibpy and roslibjs run word for word, but for the port."""

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from rosbridge_bench import FakeSimulation

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.graph import messages as m

ROOT = Path(__file__).parents[3]
DOC = (ROOT / "docs/bridges.md").read_text()
SECTION = DOC[DOC.index("## Python and JavaScript clients") : DOC.index("## What each open port")]
TRIGGER = "std_srvs/srv/Trigger"


def recipe(language, port):
    """The text of the section's block in a language, for a server at another port."""
    (text,) = re.findall(rf"```{language}\n(.*?)```", SECTION, flags=re.DOTALL)
    assert text.count("9090") == 1
    return text.replace("9090", str(port))


@pytest.fixture
def served():
    """A simulation with the service and topics of the recipes, and its rosbridge server."""
    simulation = FakeSimulation()
    response = m.message_type(f"{TRIGGER}_Response")
    simulation.graph.create_service(
        "/uav1/take_off", TRIGGER, lambda _request: response(True, "taking off")
    )
    odometry = m.Odometry()
    odometry.pose.pose.position.x = 7.5
    simulation.publish("/uav1/odom", odometry, latched=True)
    with BridgeHost(simulation.gateway) as bridges:
        server = RosbridgeServer(port=0)
        bridges.open(server)
        yield simulation, server
    simulation.close()


def until(condition, timeout_s=60.0):
    end = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def run_beside(simulation, command, **options):
    """Run a client until it has printed odometry and sent a command; returns both."""
    commands = []
    simulation.graph.subscribe("/uav1/cmd_vel", lambda p: commands.append(p.message), m.Twist)
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options
    )
    lines = []
    try:
        for line in process.stdout:  # ends with the process
            lines.append(line)
            if "7.5" in line:
                break
        until(lambda: commands or process.poll() is not None, 60)
    finally:
        process.kill()
        lines.append(process.communicate()[0])
    return "".join(lines), commands


def test_roslibpy(served):
    pytest.importorskip("roslibpy")
    simulation, server = served
    code = recipe("python", server.port) + "\nimport time\ntime.sleep(60)\n"
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    printed, commands = run_beside(simulation, [sys.executable, "-c", code], env=environment)
    assert "taking off" in printed
    assert "'x': 7.5" in printed
    assert commands, printed
    assert (commands[0].linear.x, commands[0].angular.z) == (1.0, 0.0)


def test_roslibjs(served, tmp_path):
    node = shutil.which("node")
    named = os.environ.get("VOLERY_ROSLIB")
    modules = (Path(named) if named else ROOT / "web") / "node_modules"
    if node is None or not (modules / "roslib").is_dir():
        pytest.skip("needs node, and roslib in web/node_modules or in the folder VOLERY_ROSLIB")
    simulation, server = served
    (tmp_path / "node_modules").symlink_to(modules)
    script = tmp_path / "recipe.mjs"
    script.write_text(recipe("js", server.port))
    flags = ["--preserve-symlinks", "--preserve-symlinks-main"]
    printed, commands = run_beside(simulation, [node, *flags, str(script)], cwd=tmp_path)
    assert "taking off" in printed
    assert "x: 7.5" in printed
    assert commands, printed
    assert commands[0].linear.x == 1.0
