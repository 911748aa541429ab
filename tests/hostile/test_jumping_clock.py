"""A wall clock that is set by an hour during a run: only dates follow it."""

import os
import re
import time
from pathlib import Path

import pytest

import volery
from volery.bridges.logs.log_writer import create_log
from volery.graph import messages as m
from volery.mavlink.codec import Codec, dialect
from volery.mavlink.framing import Framer
from volery.mavlink.links.signing import Signing, steady_time
from volery.runtime import Simulation
from volery.scenario.load import load_scenario
from volery.server.recordings import _Durations

HOUR_S = 3600.0
KEY = bytes(range(32))

DATES = {
    "bridges/nodes/host.py": "the time of nodes that run on wall time",
    "bridges/ros1/client.py": "arrival of a message, as other ROS nodes stamp it",
    "bridges/ros2/client.py": "stamps of parameter events",
    "bridges/ros2/subscriptions.py": "the same",
    "bridges/ros2/zenoh/endpoints.py": "source time stamps of the protocol",
    "cli/topics.py": "stamps of published messages where the graph has no clock",
    "cli/yaml_codec.py": "stamps of published messages",
    "comms/station/tcp.py": "send time of the protocol; its receivers estimate the offset",
    "core/compiled.py": "age of a file",
    "core/wall_time.py": "read once; the elapsed time is added",
    "graph/nodes/rclpy_modules.py": "stamps of log lines",
    "graph/nodes/ros_time.py": "a system clock of a node file",
    "mavlink/offboard/connection.py": "arrival of a message from an autopilot",
    "server/recordings.py": "age of a file",
}
"""Modules that read the wall clock, and what for."""


@pytest.fixture(params=[HOUR_S, -HOUR_S], ids=["forward", "back"])
def set_clock(request, monkeypatch):
    """Sets the wall clock by an hour, from the call on; what has elapsed is unchanged."""
    before, before_ns = time.time, time.time_ns

    def jump():
        shift = request.param
        monkeypatch.setattr(time, "time", lambda: before() + shift)
        monkeypatch.setattr(time, "time_ns", lambda: before_ns() + round(shift * 1e9))

    return jump


def test_wall_time_is_read_for_dates_only():
    """Durations, ages and rates are of `time.monotonic`; the modules above read other clocks."""
    package = Path(volery.__file__).parent
    reads = re.compile(r"\btime\.time(_ns)?\b")
    found = {
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        if reads.search(path.read_text(encoding="utf-8"))
    }
    assert found == set(DATES)


def test_steady_time_is_wall_time_that_does_not_jump(set_clock):
    assert steady_time() == pytest.approx(time.time(), abs=60.0)
    truly = time.time()
    set_clock()
    assert abs(time.time() - truly) > HOUR_S - 60.0
    assert steady_time() == pytest.approx(truly, abs=60.0)


def test_statuses_of_a_run_are_as_far_apart_as_they_were_published(set_clock):
    """The page estimates from them how old what it shows is."""
    with Simulation(load_scenario("hover")) as simulation:
        session = simulation.gateway.open("viewer")
        queue = session.subscribe("/volery/status", wake=lambda: None)

        def next_wall_s():
            for _ in range(3000):
                simulation.run(0.1, speed=1.0)
                if found := queue.take():
                    stamp = found[-1].message.wall
                    return stamp.sec + 1e-9 * stamp.nanosec
            raise AssertionError("no status")

        before_s = next_wall_s()
        set_clock()
        assert next_wall_s() == pytest.approx(before_s, abs=HOUR_S - 60.0)


def ping_by(sender):
    message = dialect().MAVLink_ping_message(0, 0, 0, 0)
    (frame,) = Framer().feed(sender.sign(Codec(7).pack(message, 0)))
    return frame


def test_signed_links_outlast_a_jump(set_clock):
    """Streams go on and new ones begin, and no old frame is fresh again."""
    truly = time.time()
    ours, theirs = Signing(KEY), Signing(KEY, 1, clock=lambda: truly)
    old = ping_by(Signing(KEY, 2, clock=lambda: truly - HOUR_S + 60.0))
    assert ours.accepts(ping_by(theirs))
    first = ping_by(ours)
    set_clock()
    assert ours.accepts(ping_by(theirs))
    assert ours.accepts(ping_by(Signing(KEY, 3, clock=lambda: truly)))
    assert not ours.accepts(old)
    listener = Signing(KEY, 4, clock=lambda: truly)
    assert listener.accepts(first)
    assert listener.accepts(ping_by(ours))
    assert Signing(KEY, 5, clock=lambda: truly).accepts(ping_by(Signing(KEY, 6)))


def test_a_log_from_before_the_clock_was_set_back_has_its_length(tmp_path):
    path = tmp_path / "flight.mcap"
    log = create_log(path)
    for time_ns in (0, 2_000_000_000):
        clock = m.Clock(m.time_from_ns(time_ns))
        log.write(m.Published("/clock", "rosgraph_msgs/msg/Clock", time_ns, clock))
    log.close()
    durations = _Durations()
    durations.learn([path])
    assert durations.of(path) is None  # it may be growing
    ahead = time.time() + HOUR_S
    os.utime(path, (ahead, ahead))
    durations.learn([path])
    assert durations.of(path) == pytest.approx(2.0)
