"""Submissions that loop, take memory, read others, cheat or fail beside ones that fly."""

from __future__ import annotations

import json
import socket
from pathlib import Path

import pytest
from assignments import ASSIGNMENT, write_assignment, write_controller
from typer.testing import CliRunner

from volery.cli.app import app
from volery.grading import grade, load_assignment
from volery.grading.sandbox import bubblewrap
from volery.grading.submissions import find_submissions

LOOP = """
def on_odometry(self, odometry):
    while odometry.header.stamp.sec >= 2:
        pass
"""
MEMORY = """
def on_odometry(self, odometry):
    if odometry.header.stamp.sec >= 2:
        self.kept = [bytearray(100_000_000) for _ in range(100_000)]
"""
LEAVES = """
def on_odometry(self, odometry):
    if odometry.header.stamp.sec >= 2:
        raise ValueError("no way")
"""
READS = """
def started(self):
    import os
    from pathlib import Path
    found = [name for name in {names!r} if Path(name).exists()]
    found += [pid for pid in os.listdir("/proc") if pid.isdigit() and int(pid) > 60]
    import socket
    for address in (("127.0.0.1", {port}), ("192.0.2.1", 80)):
        try:
            socket.create_connection(address, timeout=2.0)
            found.append(address)
        except OSError:
            pass
    try:
        Path("/submission/submission.py").write_text("")
        found.append("can write")
    except OSError:
        pass
    raise SystemExit(f"reaches {{found}}")
"""
CHEATS = """
def started(self):
    from simulation_interfaces.srv import ResetSimulation
    from volery_interfaces.srv import JoinLockStep
    client = self.create_client(ResetSimulation, "/reset_simulation")
    self.answer = client.call_async(ResetSimulation.Request())

def on_odometry(self, odometry):
    if self.answer.done():
        self.get_logger().info(str(self.answer.exception()))
    self.command_to(2.0, odometry)
"""


@pytest.fixture
def folder(tmp_path):
    """Returns the folder of the submissions."""
    return tmp_path / "submissions"


def graded(tmp_path, folder, timeout_s=600.0):
    text = ASSIGNMENT.replace("timeout_s = 60.0", f"timeout_s = {timeout_s}")
    assignment = load_assignment(write_assignment(tmp_path, text))
    return {found.submission: found for found in grade(assignment, find_submissions(folder))}


def test_the_fair_ones_fly_as_alone(tmp_path, folder):
    write_controller(folder / "ann.py")
    alone = graded(tmp_path, folder)["ann"]
    assert (alone.total, alone.problems) == (4.0, [])
    write_controller(folder / "memory.py", MEMORY)
    write_controller(folder / "leaves.py", LEAVES)
    write_controller(folder / "cheats.py", CHEATS)
    (folder / "broken.py").write_text("import nothing_like_this\n")
    found = graded(tmp_path, folder)
    assert found["ann"].flights[0].digest == alone.flights[0].digest
    assert found["ann"].total == 4.0
    assert "MemoryError" in found["memory"].problems[0]
    assert "ValueError: no way" in found["leaves"].problems[0]
    assert found["leaves"].points == {"no contact": 1.0, "arrives": 0.0}
    assert "nothing_like_this" in found["broken"].problems[0]
    assert found["cheats"].flights[0].digest == alone.flights[0].digest


def test_a_submission_that_never_returns_is_ended(tmp_path, folder):
    write_controller(folder / "loop.py", LOOP)
    found = graded(tmp_path, folder, timeout_s=20.0)
    assert found["loop"].problems == ["seed 1: the node took more than 20 s"]
    assert found["loop"].total == 0.0


@pytest.mark.skipif(bubblewrap() is None, reason="needs bubblewrap: apt-get install bubblewrap")
def test_a_submission_reaches_nothing_but_its_uav(tmp_path, folder, tcp_port):
    write_controller(folder / "ann.py")
    names = [str(folder / "ann.py"), str(tmp_path), str(Path.home() / ".bashrc"), "/etc/passwd"]
    write_controller(folder / "reads.py", READS.format(names=names, port=tcp_port))
    [problem] = graded(tmp_path, folder)["reads"].problems
    assert problem.startswith("seed 1: the node did not start: ")
    assert "SystemExit: reaches [] (submission.py:" in problem


@pytest.fixture
def tcp_port():
    """Returns a port on which this process listens."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_the_command_writes_text_json_table_and_page(tmp_path, folder):
    write_controller(folder / "ann.py")
    file = write_assignment(tmp_path)
    table, page = tmp_path / "grades.csv", tmp_path / "grades.html"
    words = ["grade", str(file), str(folder), "--jobs", "1", "--csv", str(table), "--html"]
    result = CliRunner().invoke(app, [*words, str(page), "--json"])
    assert result.exit_code == 0, result.output
    (found,) = json.loads(result.stdout)["grades"]
    assert (found["submission"], found["total"], found["max_total"]) == ("ann", 4.0, 4.0)
    assert "ann,4,4,1,3," in table.read_text()
    assert "<summary>ann</summary>" in page.read_text()
