"""The ground station, the UAVs' side of it, and `volery gcs` as a user has it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import signal
import socket
import subprocess
import sys
import threading

import pytest
from live_graph import LiveGraph

from volery.bridges.bridge_host import BridgeHost
from volery.cli.gcs import parse_server
from volery.comms.addresses import ALL, ALL_GROUND, FIRST_GROUND, Identity, batch_address, is_meant
from volery.comms.control_payloads import Reason, Refusal
from volery.comms.payloads import (
    COMMANDS,
    MISSION,
    MISSION_TYPE,
    REPLY,
    REPLY_TYPE,
    SLAM,
    SLAM_TYPE,
    STATE,
    STATE_TYPE,
    decode_named,
    encode_named,
)
from volery.comms.protocol import StationFrame, StationFrameKind
from volery.comms.station.ground_station import GroundStation, address_of
from volery.comms.station.station_bridge import StationBridge
from volery.comms.station.tcp import Station
from volery.core.errors import CommsError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Header, Point, String, Time, Vector3, message_type
from volery_benchmarks.comms import served

State = message_type(STATE_TYPE)
States = message_type("volery_interfaces/msg/VehicleStates")
Response = message_type("std_srvs/srv/Trigger_Response")


def state(name="uav1", mode="HOLD", battery=0.5):
    position, velocity = Point(1.0, -2.0, 3.0), Vector3(3.0, 4.0, 0.0)
    return State(
        name, "f450", "f450", mode, True, False, battery, 12.0, position, velocity, 0.5, -1.0, ""
    )


def frame(name, msgtype, message, source=0, time_ns=0):
    payload = encode_named(name, msgtype, message)
    return StationFrame(StationFrameKind.SENSING, source, FIRST_GROUND, 1, 1, time_ns, payload)


class Desk:
    def __init__(self):
        self.sent = []
        self.ground = GroundStation(self.send)

    def send(self, kind, address, payload):
        assert kind is StationFrameKind.COMMAND
        self.sent.append((address, decode_named(payload)))
        return len(self.sent)


def test_addresses_as_people_write_them() -> None:
    names = {"scout": 7}
    for text, address in (
        ("3", 3),
        ("1.2", 6),
        ("uav4", 3),
        ("scout", 7),
        ("batch2", batch_address(2)),
        ("all", ALL),
    ):
        assert address_of(text, 4, names) == address
    for wrong in ("uav0", "1.4", "batch", "batch99999", "x", "-1", "40000", "0.0.0"):
        with pytest.raises(CommsError):
            address_of(wrong, 4, names)
    assert is_meant(FIRST_GROUND + 3, ALL_GROUND)
    assert not is_meant(3, ALL_GROUND)


def test_lines_become_commands() -> None:
    desk = Desk()
    for line in (
        "take_off uav1",
        "take_off 1.0 2.5",
        "return all",
        "go_to 2 1 -2 3",
        "hold batch0",
    ):
        assert desk.ground.command(line).startswith("sent: ")
    assert desk.ground.command("go_to 2 1 -2 3 90") == "sent: go_to to 2"
    assert [(address, named.name) for address, named in desk.sent] == [
        (0, "take_off"),
        (4, "take_off_to"),
        (ALL, "return_home"),
        (2, "go_to"),
        (batch_address(0), "hold"),
        (2, "go_to"),
    ]
    assert desk.sent[1][1].message.altitude == 2.5
    goal = desk.sent[3][1].message
    assert (goal.position.x, goal.position.y, goal.position.z) == (1.0, -2.0, 3.0)
    assert goal.keep_heading
    turned = desk.sent[5][1].message
    assert not turned.keep_heading
    assert turned.yaw == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    "line", ["fly 1", "land", "go_to 1 2", "take_off 1 nan", "land 1 2", "hold ?"]
)
def test_lines_that_are_no_commands(line: str) -> None:
    desk = Desk()
    with pytest.raises(CommsError):
        desk.ground.command(line)
    assert desk.sent == []


def test_states_replies_and_refusals_are_shown() -> None:
    desk = Desk()
    assert desk.ground.take(frame(STATE, STATE_TYPE, state()), 0) == "uav1: HOLD"
    assert desk.ground.take(frame(STATE, STATE_TYPE, state()), 10**9) is None
    landing = frame(STATE, STATE_TYPE, state(mode="LAND"), time_ns=10**9)
    assert desk.ground.take(landing, 10**9) == "uav1: LAND"
    other = frame(STATE, STATE_TYPE, state("uav6", battery=math.nan), source=5, time_ns=10**9)
    desk.ground.take(other, 10**9)
    first, second = desk.ground.rows(3 * 10**9)
    assert first == (
        *("uav1", "0.0", "LAND", "1.0 -2.0 3.0", "5.0", "50 %", "2.0"),
        *("-", "-", ""),
    )
    assert (second.name, second.address, second.battery) == ("uav6", "1.1", "-")
    said = message_type(REPLY_TYPE)("land: done")
    assert desk.ground.take(frame(REPLY, REPLY_TYPE, said), 0) == "uav1: land: done"
    desk.ground.command("hold 9")
    refused = desk.ground.refused(Refusal(Reason.UNKNOWN, 1, "no station 9"))
    assert refused == "refused: hold to 9: no station 9"
    broken = StationFrame(StationFrameKind.SENSING, 5, 0, 1, 1, 0, b"\x05stat")
    assert "not a message" in desk.ground.take(broken, 0)


def test_missions_and_slams_are_shown_when_they_are_published() -> None:
    desk = Desk()
    desk.ground.take(frame(STATE, STATE_TYPE, state()), 0)
    status = zero_message(MISSION_TYPE)
    status.phase, status.sector = "search", 4
    assert desk.ground.take(frame(MISSION, MISSION_TYPE, status), 0) == "uav1: mission search 4"
    assert desk.ground.take(frame(MISSION, MISSION_TYPE, status), 0) is None
    held = zero_message(MISSION_TYPE)
    held.phase, held.sector, held.problem = "hold", -1, "held by the operator"
    line = desk.ground.take(frame(MISSION, MISSION_TYPE, held), 0)
    assert line == "uav1: mission hold, held by the operator"
    lost = json.dumps({"state": "lost", "problems": ["no imu"], "keyframes": 3})
    assert desk.ground.take(frame(SLAM, SLAM_TYPE, String(lost)), 0) == "uav1: SLAM lost: no imu"
    (row,) = desk.ground.rows(0)
    assert (row.mission, row.slam, row.problem) == ("hold", "lost: no imu", "held by the operator")
    assert desk.ground.take(frame(SLAM, SLAM_TYPE, String("[1]")), 0) == "uav1: SLAM ?"


def test_commands_are_echoed_as_they_were_typed() -> None:
    desk = Desk()
    assert desk.ground.command("take_off 0 4") == "sent: take_off to 0"
    assert desk.ground.command("return 0") == "sent: return to 0"
    done = String("return_home: goes home")
    assert desk.ground.take(frame(REPLY, REPLY_TYPE, done), 0) == "0.0: return: goes home"
    assert desk.ground.command("land all").endswith(" (no state of such a UAV received so far)")
    desk.ground.take(frame(STATE, STATE_TYPE, state()), 0)
    assert desk.ground.command("land all") == "sent: land to all"
    assert desk.ground.command("resume batch1").endswith("so far)")


@pytest.mark.parametrize("name", ["state", "reply"])
def test_known_names_with_other_types_are_shown(name: str) -> None:
    """Programs may send any message under a name of their own."""
    desk = Desk()
    other = frame(name, "geometry_msgs/msg/Point", Point(1.0, 2.0, 3.0))
    assert desk.ground.take(other, 0) == f"0.0: {name} (geometry_msgs/msg/Point)"
    assert desk.ground.rows(0) == []


@pytest.mark.parametrize(
    ("line", "usage"),
    [
        ("go_to uav1 1", "go_to ADDRESS X Y Z [HEADING]"),
        ("hold", "hold ADDRESS"),
        ("return_home uav1", "return ADDRESS"),
        ("take_off_to 0 3", "take_off ADDRESS [ALTITUDE]"),
    ],
)
def test_wrong_usage_is_an_error_with_the_right_one(line: str, usage: str) -> None:
    with pytest.raises(CommsError) as error:
        Desk().ground.command(line)
    assert str(error.value) == f"'{line}': usage: {usage}"


@pytest.mark.parametrize("clock_s", [0, 7, -7, 3600])
def test_what_a_server_has_kept_is_as_old_as_it_is(clock_s: int) -> None:
    """The clock of the station goes after ours by so much."""
    ground, now, tenth, away = Desk().ground, 10**18, 10**8, clock_s * 10**9

    def take(sent: int, came: int) -> str:
        ground.take(frame(STATE, STATE_TYPE, state(), time_ns=now + sent - away), now + came)
        return ground.rows(now + came)[0].age

    if clock_s == 0:  # a backlog first: the clocks are taken for the same
        assert [take(2 * k * tenth, 80 * tenth + k) for k in range(3)] == ["8.0", "7.8", "7.6"]
    for k in range(40, 44):  # one every 0.2 s, as they are made
        age = take(2 * k * tenth, 2 * k * tenth + tenth // 10)
    assert age == "0.0"
    assert take(88 * tenth, 188 * tenth) == "10.0"  # the first of those kept meanwhile
    assert take(186 * tenth, 188 * tenth) == "0.2"
    assert take(188 * tenth, 188 * tenth + tenth // 10) == "0.0"
    assert ground.rows(now + 218 * tenth)[0].age == "3.0"


def test_commands_without_a_server_are_queued_and_named_at_the_end() -> None:
    joined, asked = [True, False], iter((7, 8))
    ground = GroundStation(lambda *_: next(asked), is_joined=lambda: joined.pop(0))
    assert ground.command("hold 0").startswith("sent: hold to 0")
    said = ground.command("land 1")
    assert said.startswith("queued: land to 1")
    assert said.endswith("sent when the server is back")
    assert ground.open_commands({7}.__contains__) == ["land to 1"]


class Gcs:
    """`volery gcs` fed through a pipe."""

    def __init__(self, port: int, *options: str) -> None:
        self.command = [sys.executable, "-m", "volery.cli.app", "gcs", *options]
        self.command += ["--server", f"127.0.0.1:{port}"]

    def __enter__(self):
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(self.command, stdin=pipe, stdout=pipe, text=True, bufsize=1)
        return self

    def __exit__(self, *_error) -> None:
        self.process.kill()
        self.process.communicate()

    def says(self, start: str) -> None:
        line = self.process.stdout.readline()
        assert line.startswith(start), line

    def write(self, line: str) -> None:
        self.process.stdin.write(line + "\n")


def test_gcs_says_that_the_server_is_gone_and_back_and_what_did_not_come() -> None:
    with served() as (first, port), Gcs(port) as gcs:
        gcs.says("joined as ground station")
        first.kill()
        gcs.says("the connection to the server is lost; trying again")
        gcs.write("hold uav1")
        gcs.says("queued: hold to uav1")
        first.wait()
        with served(port) as (second, _):
            gcs.says("the server is back")
            second.kill()
            gcs.says("the connection to the server is lost; trying again")
        gcs.write("land uav2")
        gcs.says("queued: land to uav2")
        gcs.write("quit")
        gcs.says("warning: no acknowledgement of: hold to uav1, land to uav2")
        assert gcs.process.wait(60.0) == 0


PATIENT = """
import volery.cli.gcs
from volery.cli.app import main
volery.cli.gcs._FIRST_S, volery.cli.gcs._OTHERS_S = 60.0, 1.0
main()
"""


def test_a_script_waits_for_the_first_states(graph) -> None:
    vehicles = graph.do(lambda: graph.graph.advertise("/volery/vehicles", States))
    both = States(Header(Time(0, 0), "map"), [state("uav1"), state("uav2")])
    publish = lambda: graph.do(lambda: vehicles.publish(both))  # noqa: E731
    with served() as (_, port), BridgeHost(graph.gateway) as bridges:
        gcs = Gcs(port)
        gcs.command[1:3] = ["-c", PATIENT]
        bridges.open(StationBridge(port=port))
        with gcs, repeated(publish):
            gcs.write("list\nquit")
            lines = list(gcs.process.stdout)
    rows = [line for line in lines if " HOLD " in line]
    assert any(line.startswith("joined as ground station") for line in lines)
    assert [row.split()[0] for row in rows] == ["uav1", "uav2"]


def test_a_wrong_batch_size_is_refused_once() -> None:
    with served() as (_, port):
        command = Gcs(port, "--group-size", "7").command
        done = subprocess.run(command, capture_output=True, text=True, check=False, input="")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("batch") == 1


def test_servers_as_people_write_them() -> None:
    assert parse_server("10.0.0.2:99") == ("10.0.0.2", 99)
    assert parse_server("[::1]:99") == ("::1", 99)
    assert parse_server("base") == ("base", 10200)
    for wrong in ("base:x", ":1", "base:70000"):
        with pytest.raises(CommsError, match="HOST:PORT"):
            parse_server(wrong)


@contextlib.contextmanager
def repeated(action):
    """Do something again and again meanwhile."""
    over = threading.Event()

    def work():
        while not over.wait(0.05):
            action()

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@pytest.fixture
def graph():
    live = LiveGraph()
    yield live
    live.close()


def test_uavs_of_a_graph_are_commanded_by_lines_of_another_process(graph) -> None:
    """Everything there is: a graph's UAVs, a server of its own, `volery gcs` fed through a pipe."""
    asked = []
    vehicles = graph.do(lambda: graph.graph.advertise("/volery/vehicles", States))

    def hold(request):
        asked.append("hold")
        return Response(True, "holds")

    graph.do(lambda: graph.graph.create_service("/uav2/hold", "std_srvs/srv/Trigger", hold))

    def publish():
        message = States(Header(Time(0, 0), "map"), [state("uav1"), state("uav2")])
        graph.do(lambda: vehicles.publish(message))

    with served() as (_, port), BridgeHost(graph.gateway) as bridges:
        bridges.open(StationBridge(port=port))
        command = [sys.executable, "-m", "volery.cli.app", "gcs", "--server", f"127.0.0.1:{port}"]
        gcs = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        try:
            said = [gcs.stdout.readline()]
            assert "joined as ground station" in said[0]
            with repeated(publish):
                while sum(": HOLD" in line for line in said) < 2:
                    said.append(gcs.stdout.readline())
            gcs.stdin.write("hold uav2\nland uav1\nnonsense\n")
            while not any("nonsense" in line for line in said):
                said.append(gcs.stdout.readline())
            while sum("uav" in line and ("holds" in line or "land:" in line) for line in said) < 2:
                said.append(gcs.stdout.readline())
            rest, _ = gcs.communicate("list\nquit\n", timeout=60.0)
        finally:
            gcs.kill()
            gcs.wait()
    assert asked == ["hold"]
    assert "uav2: hold: holds\n" in said
    assert any(line.startswith("uav1: land: ") for line in said)  # no such service in this graph
    assert [line.split()[:3] for line in rest.splitlines() if line.startswith("uav")] == [
        ["uav1", "0.0", "HOLD"],
        ["uav2", "0.1", "HOLD"],
    ]
    assert gcs.returncode == 0


def _is_answer(line: str | None) -> bool:
    return line is not None and ("done" in line or "no mission" in line)


def test_a_mission_takes_what_would_go_against_it(graph) -> None:
    """Hold, land, return and resume are the mission's where there is one; go_to is held before."""
    asked, shown = [], []

    def offer(service: str, srvtype: str = "std_srvs/srv/Trigger") -> None:
        response = message_type(f"{srvtype}_Response")

        def answer(_request):
            asked.append(service)
            return response(True, "")

        graph.do(lambda: graph.graph.create_service(service, srvtype, answer))

    for name in ("hold", "land", "return_home"):
        offer(f"/uav1/{name}")
        offer(f"/uav2/{name}")
        offer(f"/uav1/task_manager/{name}")
    offer("/uav1/task_manager/resume")
    offer("/uav1/go_to", COMMANDS["go_to"])
    vehicles = graph.do(lambda: graph.graph.advertise("/volery/vehicles", States))
    missions = graph.do(lambda: graph.graph.advertise("/uav1/mission", MISSION_TYPE))

    both = States(Header(Time(0, 0), "map"), [state("uav1"), state("uav2")])
    status = zero_message(MISSION_TYPE)
    status.phase = "wait"

    async def command() -> None:
        station = Station(Identity.ground(0), lambda f: shown.append(ground.take(f, 0)), port=port)
        ground = GroundStation(station.send)
        await station.start()

        async def until(true) -> None:
            for _ in range(1200):
                graph.do(lambda: vehicles.publish(both))
                graph.do(lambda: missions.publish(status))
                if true():
                    return
                await asyncio.sleep(0.05)
            raise AssertionError((asked, shown))

        await until(lambda: "uav1: mission wait 0" in shown and "uav2: HOLD" in shown)
        lines = ("hold 0", "land 0", "return 0", "resume 0", "go_to 0 1 2 3", "hold 1", "resume 1")
        for count, line in enumerate(lines):
            ground.command(line)
            await until(
                lambda count=count: sum("done" in t or "no m" in t for t in shown if t) > count
            )
        await station.stop()

    with served() as (_, port), BridgeHost(graph.gateway) as bridges:
        bridges.open(StationBridge(port=port))
        asyncio.run(command())
    mission = "/uav1/task_manager"
    assert asked == [
        *(f"{mission}/{name}" for name in ("hold", "land", "return_home", "resume", "hold")),
        "/uav1/go_to",
        "/uav2/hold",
    ]
    assert [text for text in shown if text][-1] == "uav2: resume: uav2 has no mission"


def test_the_server_ends_in_good_order() -> None:
    with served() as (process, _):
        process.send_signal(signal.SIGTERM)
        assert process.wait(60.0) == 0
        assert "stations 0 here" in process.stdout.read()


def test_gcs_without_a_server_says_what_to_do() -> None:
    with socket.socket() as silent:  # bound, but it does not listen: connections are refused
        silent.bind(("127.0.0.1", 0))
        server = f"127.0.0.1:{silent.getsockname()[1]}"
        command = [sys.executable, "-m", "volery.cli.app", "gcs", "--server", server]
        done = subprocess.run(command, capture_output=True, text=True, check=False, input="")
    assert done.returncode == 2
    assert "start one with volery comms" in done.stderr
