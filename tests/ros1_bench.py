"""A ROS 1 master of the test's own, programs around it, and a graph with a thread."""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import queue
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from functools import cache
from pathlib import Path

import pytest
from held_ports import held_port
from live_graph import LiveGraph

from volery.bridges.ros1.environment import rospy_is_installed
from volery.graph.messages import Clock, time_from_ns

HERE = Path(__file__).parent / "ros1"
CLOCK = "rosgraph_msgs/msg/Clock"
SYSTEM_PYTHON = "/usr/bin/python3"
_TOOLS = ("rosmaster", "rostopic", "rosservice", "rosbag")


def missing_of_ros1():
    """What of ROS 1 is not installed."""
    missing = [tool for tool in _TOOLS if shutil.which(tool) is None]
    return missing if rospy_is_installed() else ["rospy", *missing]


def require_ros1():
    """Skip the tests of a module where ROS 1 is not installed."""
    missing = missing_of_ros1()
    if missing:
        pytest.skip(f"no {', '.join(missing)}: see .ci/install_ros1", allow_module_level=True)


def wait_until(condition, seconds=180.0):
    """Whether a condition comes true in time."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


class Master:
    """A rosmaster on loopback, and the environment of its nodes, which is set in this process."""

    def __init__(self):
        self._held = contextlib.ExitStack()
        self._port = self._held.enter_context(held_port())  # also while none runs
        self._folder = tempfile.mkdtemp(prefix="volery-ros1-")
        self._process = None
        self.uri = f"http://127.0.0.1:{self._port}"
        os.environ.update(
            ROS_MASTER_URI=self.uri,
            ROS_IP="127.0.0.1",
            ROS_HOSTNAME="127.0.0.1",
            ROS_HOME=self._folder,
            ROS_LOG_DIR=self._folder,
        )

    def start(self):
        self._process = subprocess.Popen(
            ["rosmaster", "--core", "-p", str(self._port)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

        def is_up():
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self._port)):
                return True

        assert wait_until(is_up)

    def stop(self):
        if self._process is not None:
            end(self._process)
            self._process = None

    def close(self):
        self.stop()
        self._held.close()
        shutil.rmtree(self._folder, ignore_errors=True)


@cache
def shared_master():
    """The process's master: rospy stays with the first one that it meets."""
    master = Master()
    atexit.register(master.close)
    master.start()
    return master


def end(process):
    """End a process by its own id, and wait until it has gone."""
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(10.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(60.0)


def tool(*command, seconds=180.0, **environment):
    """What a command of ROS prints."""
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env={**os.environ, **environment},
    )
    try:
        return process.communicate(timeout=seconds)[0]
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # those it started, too
        process.wait(60.0)
        process.stdout.close()


@contextlib.contextmanager
def running(*command):
    """A command of ROS that runs until the block ends; lines of what it prints, as they come."""
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    lines = []
    reader = threading.Thread(target=lambda: lines.extend(process.stdout), daemon=True)
    reader.start()
    try:
        yield lines
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # those it started, too
        process.wait(60.0)
        reader.join(60.0)
        process.stdout.close()


class Program:
    """A program that prints JSON values, one a line; use it as a context manager."""

    def __init__(self, *command, **environment):
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=HERE,
            env={**os.environ, **environment},
        )
        self._lines = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        for line in self.process.stdout:
            if line.startswith(("[", '"', "{")):
                with contextlib.suppress(ValueError):
                    self._lines.put(json.loads(line))
        self._lines.put(EOFError())

    def next(self, seconds=180.0):
        """The next value."""
        value = self._lines.get(timeout=seconds)  # of a program that may still have to start
        if isinstance(value, EOFError):
            raise value
        return value

    def send_line(self, line):
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()  # rospy takes seconds to leave in good order
        self.process.wait(60.0)
        self._reader.join(60.0)
        self.process.stdin.close()
        self.process.stdout.close()


def peer(*arguments):
    """A plain rospy program that has begun."""
    return Program(SYSTEM_PYTHON, str(HERE / "peer.py"), *arguments)


def ours(script, **environment):
    """A program of this project in a process of its own."""
    return Program(sys.executable, str(HERE / script), **environment)


class WallGraph(LiveGraph):
    """A graph whose time is the computer's."""

    def __init__(self):
        super().__init__(time.time_ns)

    def publisher(self, topic, msgtype, **options):
        """A function that publishes."""
        made = self.graph.advertise(topic, msgtype, **options)
        return lambda message: self.do(lambda: made.publish(message))

    def collect(self, topic, msgtype):
        """A list that fills with the messages of a topic."""
        seen = []
        self.graph.subscribe(topic, lambda published: seen.append(published.message), msgtype)
        return seen

    @contextlib.contextmanager
    def clock(self, period_s=0.02):
        """Publishes `/clock` meanwhile, in step with the computer's."""
        publish, stop, start = self.publisher("/clock", CLOCK), threading.Event(), time.monotonic()

        def tick():
            while not stop.wait(period_s):
                publish(Clock(time_from_ns(int((time.monotonic() - start) * 1e9))))

        ticking = threading.Thread(target=tick)
        ticking.start()
        try:
            yield
        finally:
            stop.set()
            ticking.join()
