"""Offboard: what is entered and refused, every kind of setpoint, and their loss."""

import math

import numpy as np
import pytest
from flying_bench import Station, fly

ACCEPTED, REJECTED = 0, 1


@pytest.fixture
def flight():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        station.up(4.0)
        yield simulation, station, simulation.uavs["uav1"]


def enter(station):
    station.stream(0.5, station.send_position, 0.0, 0.0, -4.0)
    assert station.mode(6) == ACCEPTED
    assert station.present_mode == (6, 0)


def test_setpoints_must_come_before_and_must_be_fresh(flight):
    _, station, _ = flight
    assert station.mode(6) == REJECTED
    station.send_position(0.0, 0.0, -4.0)
    station.seconds(0.6)
    assert station.mode(6) == REJECTED
    enter(station)


def test_flies_a_square_and_ends_where_it_began(flight):
    _, station, uav = flight
    enter(station)
    for north, east in ((5.0, 0.0), (5.0, 5.0), (0.0, 5.0), (0.0, 0.0)):
        station.stream(5.0, station.send_position, north, east, -4.0)
        assert uav.position_map[:2] == pytest.approx([east, north], abs=0.5)
    assert uav.position_map == pytest.approx([0.0, 0.0, 4.1], abs=0.3)


def test_velocities_in_map_and_body(flight):
    _, station, uav = flight
    enter(station)
    station.stream(2.5, station.velocity, 2.0, 0.0, 0.0, yaw=math.pi / 2)
    assert uav.velocity_map == pytest.approx([0.0, 2.0, 0.0], abs=0.15)  # north
    x, y, z, w = uav.attitude
    assert math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) == pytest.approx(0.0, abs=0.05)
    station.stream(2.0, station.velocity, 1.0, 0.0, 0.0, mask=1479, frame=8)
    assert uav.velocity_map == pytest.approx([1.0, 0.0, 0.0], abs=0.15)  # forward: it looks east


def test_height_and_velocity_may_be_mixed(flight):
    """As PX4 allows: north by velocity, height by position."""
    _, station, uav = flight
    enter(station)
    fields = (0, 1, 1, 1, 0b110111000011, 0, 0, -6.0, 0, 0, 0, 0, 0, 0, 0.0, 0)
    for _ in range(80):
        fields = (*fields[:4], 0b100111100011, *fields[5:8], 1.0, 0.0, *fields[10:])
        station.send("set_position_target_local_ned", *fields)
        station.seconds(0.05)
    assert uav.velocity_map[1] == pytest.approx(1.0, abs=0.15)
    assert uav.position_map[2] == pytest.approx(6.1, abs=0.3)


def test_a_position_with_a_velocity_is_tracked(flight):
    _, station, uav = flight
    enter(station)
    errors = []
    for k in range(160):
        t = 0.05 * k
        x, y = 3.0 * math.sin(0.5 * t), 3.0 * (1 - math.cos(0.5 * t))
        vx, vy = 1.5 * math.cos(0.5 * t), 1.5 * math.sin(0.5 * t)
        fields = (0, 1, 1, 1, 2496, x, y, -4.0, vx, vy, 0.0, 0, 0, 0, 0.0, 0.0)
        station.send("set_position_target_local_ned", *fields)
        station.seconds(0.05)
        errors.append(math.dist(uav.position_map[:2], (y, x)))
    assert max(errors[60:]) < 0.4


def test_acceleration_attitude_and_rates(flight):
    _, station, uav = flight
    enter(station)
    for _ in range(20):
        fields = (0, 1, 1, 1, 3135, 0, 0, 0, 0, 0, 0, 1.0, 0.0, 0.0, 0.0, 0.0)
        station.send("set_position_target_local_ned", *fields)
        station.seconds(0.05)
    assert uav.velocity_map[1] > 0.5  # NED's north
    up = np.array([0.0, 0.0, 1.0])
    lean = math.degrees(math.atan(1.0 / 9.81))  # what gives 1 m/s^2 without drag, as PX4 has it
    assert tilt_of(uav, up) == pytest.approx(lean, abs=0.6)
    hover = 0.536  # of the iris: its weight over all that its rotors give
    roll = math.radians(10.0)
    q = (math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0)
    for _ in range(12):
        station.send("set_attitude_target", 0, 1, 1, 7, q, 0.0, 0.0, 0.0, hover)
        station.seconds(0.05)
    assert tilt_of(uav, up) == pytest.approx(10.0, abs=1.5)
    for _ in range(30):  # rotors turn a UAV about its own axis slowly
        station.send("set_attitude_target", 0, 1, 1, 128, (1, 0, 0, 0), 0.0, 0.0, 0.5, hover)
        station.seconds(0.02)
    assert uav.omega_body == pytest.approx([0.0, 0.0, -0.5], abs=0.1)  # FRD's z is down


def tilt_of(uav, up):
    from volery.core.rotations import rotate

    return math.degrees(math.acos(float(rotate(uav.attitude, up) @ up)))


def test_starts_from_the_ground_for_setpoints_upwards():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        station.stream(0.3, station.send_position, 0.0, 0.0, -3.0)
        assert station.mode(6) == ACCEPTED
        assert station.command(400, 1.0) == ACCEPTED
        station.stream(7.0, station.send_position, 0.0, 0.0, -3.0)
        assert station.present_mode == (6, 0)
        assert simulation.uavs["uav1"].position_map == pytest.approx([0, 0, 3.1], abs=0.3)


@pytest.mark.parametrize("kind", ["position", "velocity", "attitude"])
def test_takes_over_at_once_from_a_take_off(kind):
    """As PX4: the take-off ends where offboard begins, and the setpoint is flown."""
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        assert station.set("MIS_TAKEOFF_ALT", 30.0) == 30.0
        assert station.command(400, 1.0) == station.command(22) == ACCEPTED
        station.seconds(1.2)
        setpoint = {
            "position": lambda: station.send_position(1.0, 0.0, -3.0),
            "velocity": lambda: station.velocity(1.0, 0.0, 0.0),
            "attitude": lambda: station.send(
                "set_attitude_target", 0, 1, 1, 7, (1, 0, 0, 0), 0.0, 0.0, 0.0, 0.536
            ),
        }[kind]
        station.stream(0.2, setpoint)
        assert simulation.uavs["uav1"].mode.name == "TAKE_OFF"
        assert station.mode(6) == ACCEPTED
        station.stream(0.1, setpoint)
        wanted = {"position": "GO_TO", "velocity": "VELOCITY", "attitude": "LOW_LEVEL"}[kind]
        assert simulation.uavs["uav1"].mode.name == wanted
        station.stream(2.9, setpoint, every=0.1)
        assert station.present_mode == (6, 0)
        assert simulation.uavs["uav1"].position_map[2] < 6.0
        if kind == "position":
            station.stream(3.0, setpoint, every=0.1)
            there = simulation.uavs["uav1"].position_map
            assert there == pytest.approx([0.0, 1.0, 3.1], abs=0.3)
        assert not [text for text in station.texts if "takes off" in text]


def test_takes_over_before_a_take_off_has_left_the_ground():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        station.stream(0.2, station.send_position, 0.0, 0.0, -3.0)
        assert station.command(400, 1.0) == station.command(22) == ACCEPTED
        station.stream(0.1, station.send_position, 0.0, 0.0, -3.0)
        assert station.mode(6) == ACCEPTED
        station.stream(6.0, station.send_position, 0.0, 0.0, -3.0, every=0.1)
        assert station.present_mode == (6, 0)
        assert simulation.uavs["uav1"].position_map == pytest.approx([0, 0, 3.1], abs=0.3)


@pytest.mark.parametrize(("action", "mode"), [(0, (4, 3)), (3, (4, 5)), (4, (4, 6)), (5, (4, 3))])
def test_its_loss_leads_to_the_mode_that_is_set(flight, action, mode):
    _, station, _ = flight
    assert station.set("COM_OBL_RC_ACT", action) == action
    enter(station)
    station.stream(0.5, station.velocity, 1.0, 0.0, 0.0)
    station.seconds(0.9)
    assert station.present_mode == (6, 0)
    station.seconds(0.2)
    assert station.present_mode == mode
    assert station.heartbeat.system_status == 5
    assert "Failsafe: offboard control lost" in station.texts


def test_a_second_station_is_ignored_while_the_first_one_flies(flight):
    simulation, station, uav = flight
    other = Station(simulation, system=254, link=8)
    enter(station)
    for _ in range(40):
        station.send_position(0.0, 0.0, -4.0)
        other.send_position(20.0, 20.0, -20.0)
        station.seconds(0.05)
    assert math.dist(uav.position_map, (0.0, 0.0, 4.1)) < 0.5
    warnings = [text for text in station.texts if "254/190 ignored" in text]
    assert len(warnings) == 1
    station.seconds(1.1)
    other.send_position(0.0, 0.0, -5.0)
    assert other.mode(6) == ACCEPTED  # the first one has fallen silent


@pytest.mark.parametrize(
    "fields",
    [
        (1, 2552, math.nan, math.nan, math.nan),
        (1, 2552, math.inf, 0.0, -4.0),
        (1, 2552, 1e9, 0.0, -4.0),
        (1, 2104 | 512, 0.0, 0.0, -4.0),  # a force
        (1, 4095 & ~512, 0.0, 0.0, -4.0),
        (8, 2552, 1.0, 0.0, -4.0),
        (99, 2552, 0.0, 0.0, -4.0),
    ],
)
def test_setpoints_that_say_nothing_do_not_count(flight, fields):
    _, station, uav = flight
    frame, mask, x, y, z = fields
    station.send_position(x, y, z, mask=mask, frame=frame)
    assert station.mode(6) == REJECTED
    station.send("set_attitude_target", 0, 1, 1, 7, (0, 0, 0, 0), 0.0, 0.0, 0.0, 0.5)
    station.send("set_attitude_target", 0, 1, 1, 7, (1, 0, 0, 0), 0.0, 0.0, 0.0, math.nan)
    assert station.mode(6) == REJECTED
    assert np.isfinite(uav.position_map).all()


def test_reaches_the_motors_within_ten_milliseconds():
    """At 250 Hz of physics, in simulated time: attitudes, velocities and positions alike."""
    simulation, station = fly(physics={"rate_hz": 250})
    with simulation:
        station.seconds(0.1)
        station.up(3.0)
        enter(station)
        uav = simulation.uavs["uav1"]
        for k in range(4):
            station.stream(1.0, station.velocity, 0.0, 0.0, 0.0)
            simulation.step(k)
            steady = uav.rotor_reference
            simulation.step()
            drift = np.abs(uav.rotor_reference - steady).max()
            station.velocity(3.0, 0.0, 0.0)
            steady, steps = uav.rotor_reference, 0
            while np.abs(uav.rotor_reference - steady).max() < 1.0 + 5.0 * drift:
                simulation.step()
                steps += 1
            assert steps * 4.0 <= 10.0
