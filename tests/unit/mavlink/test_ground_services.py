"""Requests of stations beside flying: gripper, calibration, shell, failures."""

import numpy as np
import pytest
from flying_bench import NAN, fly

ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED = range(5)
GRIPPER, CALIBRATE, INJECT = 211, 241, 420
RELEASE, GRAB = 0.0, 1.0
GYRO, ACCELEROMETER, BAROMETER, GPS, AIRSPEED, BATTERY, MOTOR = (
    0.0,
    1.0,
    3.0,
    4.0,
    8.0,
    100.0,
    101.0,
)
OK, OFF, STUCK, GARBAGE, WRONG = 0.0, 1.0, 2.0, 3.0, 4.0


@pytest.fixture
def flight():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        yield simulation, station


@pytest.mark.parametrize("command", [5003, 5004])
def test_a_fence_takes_a_circle_without_a_radius_which_holds_nothing(flight, command):
    _, station = flight
    assert station.upload([(command, 3, (0.0, 0.0, 0.0, 0.0), 47.397742, 8.545594, 0.0)], 1) == 0
    negative = (command, 3, (-1.0, 0.0, 0.0, 0.0), 47.397742, 8.545594, 0.0)
    assert station.upload([negative], 1) != 0
    inside = station.command(400, 1.0), station.command(22)
    station.seconds(4.0)
    assert inside == (ACCEPTED, ACCEPTED)
    assert any("eofence" in text for text in station.texts) == (command == 5003)


def test_the_gripper_releases_and_grabs(flight):
    _, station = flight
    for action in (RELEASE, GRAB):
        assert station.command(GRIPPER, 1.0, action) == ACCEPTED
    for action in (NAN, 2.0, -1.0):
        assert station.command(GRIPPER, 1.0, action) == DENIED


def calibrate(station, *params):
    return station.command(CALIBRATE, *(*params, *(0.0,) * (7 - len(params))))


@pytest.mark.parametrize(("params", "sensor"), [((1.0,), "gyro"), ((0, 0, 0, 0, 2.0), "level")])
def test_a_calibration_reports_its_progress(flight, params, sensor):
    _, station = flight
    assert calibrate(station, *params) == ACCEPTED
    assert calibrate(station, *params) == REJECTED  # one at a time
    station.seconds(2.5)
    texts = [text for text in station.texts if text.startswith("[cal] ")]
    assert texts[0] == f"[cal] calibration started: 2 {sensor}"
    assert texts[1:-1] == [f"[cal] progress <{percent}>" for percent in range(5, 101, 5)]
    assert texts[-1] == f"[cal] calibration done: {sensor}"
    assert calibrate(station, *params) == ACCEPTED


def test_a_calibration_is_cancelled_refused_and_fails(flight):
    _, station = flight
    assert calibrate(station, 1.0) == ACCEPTED
    station.seconds(0.5)
    assert calibrate(station) == ACCEPTED
    station.seconds(3.0)
    assert station.texts[-1] == "[cal] calibration cancelled"
    assert calibrate(station, 0.0, 1.0) == UNSUPPORTED  # no one can turn it
    assert calibrate(station, 1.0) == ACCEPTED
    assert station.command(400, 1.0) == ACCEPTED
    station.seconds(0.5)
    assert "[cal] calibration failed: gyro" in station.texts
    assert calibrate(station, 1.0) == REJECTED


def shell(station, text, flags=2):
    before = len(station.of("SERIAL_CONTROL"))
    data = list(text.encode().ljust(70, b"\0"))
    station.send("serial_control", 10, flags, 0, 0, len(text), data)
    pieces = station.of("SERIAL_CONTROL")[before:]
    assert all((piece.device, piece.flags) == (10, 1) for piece in pieces)
    return b"".join(bytes(piece.data[: piece.count]) for piece in pieces).decode()


def test_the_shell_replies(flight):
    _, station = flight
    reply = shell(station, "help\n")
    assert "param show" in reply
    assert reply.endswith("pxh> ")
    assert shell(station, "param sho") == ""
    assert "MIS_TAKEOFF_ALT: 2.5" in shell(station, "w MIS_TAKE*\n")
    assert "Invalid command: rm -rf /" in shell(station, "rm -rf /\n")
    assert shell(station, "help\n", flags=0) == ""
    assert "SYS_FAILURE_EN" in shell(station, "param show\n")


def test_the_shell_keeps_no_endless_lines(flight):
    simulation, station = flight
    (autopilot,) = (node for node in simulation.vehicles.nodes if node.get_name() == "autopilot")
    for _ in range(8):
        shell(station, "x" * 70)
        assert all(len(line) <= 200 for line in autopilot.core.context.memory.shells.values())
    assert "param show" in shell(station, "\nhelp\n") + shell(station, "help\n")


def test_failures_take_the_parameter(flight):
    _, station = flight
    for kind in (OFF, OK):
        assert station.command(INJECT, GPS, kind, 0.0) == DENIED
    assert station.set("SYS_FAILURE_EN", 1) == 1
    for unit, kind in (
        (AIRSPEED, OFF),
        (AIRSPEED, OK),
        (BATTERY, OFF),
        (GPS, WRONG),
        (MOTOR, STUCK),
    ):
        assert station.command(INJECT, unit, kind, 0.0) == UNSUPPORTED
    assert station.command(INJECT, MOTOR, OFF, 5.0) == UNSUPPORTED
    assert station.command(INJECT, NAN, INJECT, NAN) == UNSUPPORTED
    assert station.command(INJECT, 3.0, STUCK, 0.0) == FAILED
    assert "has no sensor 'pressure'" in station.texts[-1]


def fix_of(station):
    assert station.command(512, 24.0) == ACCEPTED
    return station.last("GPS_RAW_INT").fix_type


def test_a_uav_without_a_receiver_loses_its_fix_and_has_it_again(flight):
    _, station = flight
    station.set("SYS_FAILURE_EN", 1)
    station.up(3.0)
    assert station.command(INJECT, GPS, OFF, 0.0) == ACCEPTED
    station.seconds(3.0)
    assert fix_of(station) == 1
    assert station.command(INJECT, GPS, OK, 0.0) == ACCEPTED
    station.seconds(1.0)
    assert fix_of(station) == 3


def test_a_receiver_loses_its_satellites():
    simulation, station = fly(sensors=[{"kind": "gnss"}, {"kind": "barometer"}])
    with simulation:
        station.seconds(1.0)
        assert fix_of(station) == 3
        station.set("SYS_FAILURE_EN", 1)
        assert station.command(INJECT, GPS, OFF, 0.0) == ACCEPTED
        assert station.command(INJECT, 3.0, STUCK, 1.0) == ACCEPTED
        station.seconds(3.0)
        assert fix_of(station) == 1


def test_a_motor_fails_of_the_own_uav_alone():
    simulation, station = fly(count=2)
    with simulation:
        station.seconds(0.1)
        station.set("SYS_FAILURE_EN", 1)
        assert station.command(INJECT, MOTOR, OFF, 2.0) == ACCEPTED
        station.seconds(0.1)
        health = simulation._engine.fleet.state.rotor_health[:, :4]
        assert np.array_equal(health, [[1.0, 0.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0]])


def health(simulation):
    return simulation._engine.fleet.state.rotor_health[0, :4].tolist()


def test_motors_work_again():
    planned = {"kind": "motor", "uav": "uav1", "rotor": 3, "thrust_factor": 0.7}
    simulation, station = fly(faults=[planned])
    with simulation:
        station.seconds(0.1)
        station.set("SYS_FAILURE_EN", 1)
        for _ in range(2):  # which does not count twice
            assert station.command(INJECT, MOTOR, OFF, 0.0) == ACCEPTED
        station.seconds(0.1)
        assert health(simulation) == [0.0] * 4
        assert station.command(INJECT, MOTOR, OK, 2.0) == ACCEPTED
        station.seconds(0.1)
        assert health(simulation) == [0.0, 1.0, 0.0, 0.0]
        assert station.command(INJECT, MOTOR, OK, 0.0) == ACCEPTED
        station.seconds(0.1)
        assert health(simulation) == [1.0, 1.0, 1.0, 0.7]  # the scenario's fault stays
        assert station.command(INJECT, MOTOR, OK, 0.0) == ACCEPTED
        station.seconds(0.1)
        assert health(simulation) == [1.0, 1.0, 1.0, 0.7]


def test_sensors_work_again():
    simulation, station = fly(sensors=[{"kind": "imu"}, {"kind": "barometer"}])
    topics = []
    for topic in ("imu", "pressure"):
        simulation.graph.subscribe(f"/uav1/{topic}", lambda m, topic=topic: topics.append(topic))
    with simulation:
        station.seconds(0.5)
        station.set("SYS_FAILURE_EN", 1)

        def published():
            topics.clear()
            station.seconds(0.5)
            return set(topics)

        for unit in (GYRO, ACCELEROMETER, BAROMETER):
            assert station.command(INJECT, unit, OFF, 0.0) == ACCEPTED
        station.seconds(0.1)
        assert published() == set()
        assert station.command(INJECT, BAROMETER, OK, 1.0) == ACCEPTED
        assert station.command(INJECT, GYRO, OK, 0.0) == ACCEPTED
        assert published() == {"pressure"}  # the accelerometer, of the same sensor, fails on
        assert station.command(INJECT, ACCELEROMETER, OK, 0.0) == ACCEPTED
        assert published() == {"imu", "pressure"}


def test_a_receiver_that_is_stuck_or_lost_has_its_fix_again():
    simulation, station = fly(sensors=[{"kind": "gnss"}])
    fixes = []
    simulation.graph.subscribe("/uav1/fix", lambda m: fixes.append(m.message))
    with simulation:
        station.seconds(1.0)
        station.set("SYS_FAILURE_EN", 1)

        def num_positions():
            station.seconds(2.0)
            fixes.clear()
            station.seconds(6.0)
            return len({fix.latitude for fix in fixes if fix.status.status >= 0})

        assert num_positions() > 10
        assert station.command(INJECT, GPS, STUCK, 0.0) == ACCEPTED
        assert num_positions() == 1
        assert station.command(INJECT, GPS, OFF, 0.0) == ACCEPTED  # in place of the other
        assert num_positions() == 0
        assert station.command(INJECT, GPS, OK, 0.0) == ACCEPTED
        assert num_positions() > 10
        assert fix_of(station) == 3
