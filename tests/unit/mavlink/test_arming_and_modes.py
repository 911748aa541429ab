"""Arming, take-off, landing, holding, returning: what a ground station asks for first."""

import math

import pytest
from flying_bench import NAN, Station, fly

ARM, TAKE_OFF, LAND, RETURN, REPOSITION = 400, 22, 21, 20, 192
ACCEPTED, REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3


@pytest.fixture
def flight():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        yield simulation, station


def test_heartbeat_is_that_of_a_px4_quadrotor(flight):
    _, station = flight
    station.seconds(3.0)
    beats = station.of("HEARTBEAT")
    assert len(beats) in (3, 4)
    beat = beats[-1]
    assert (beat.type, beat.autopilot, beat.get_srcSystem(), beat.get_srcComponent()) == (
        2,
        12,
        1,
        1,
    )
    assert beat.base_mode & 1
    assert not beat.base_mode & 128
    assert station.present_mode == (4, 3)
    assert beat.system_status == 3


def test_takes_off_lands_and_disarms_by_itself(flight):
    simulation, station = flight
    station.up(3.0)
    assert station.armed
    assert station.present_mode == (4, 3)
    height = simulation.uavs["uav1"].position_map[2]
    assert height == pytest.approx(3.1, abs=0.2)
    assert station.command(LAND) == ACCEPTED
    assert station.present_mode == (4, 6)
    station.seconds(12.0)
    assert not station.armed
    assert {"Landing detected", "Disarmed by landing"} <= set(station.texts)


def test_take_off_to_an_altitude_above_the_sea(flight):
    simulation, station = flight
    assert station.command(ARM, 1.0) == ACCEPTED
    assert station.command(TAKE_OFF, NAN, NAN, NAN, NAN, NAN, NAN, 488.0 + 4.0) == ACCEPTED
    station.seconds(7.0)
    assert simulation.uavs["uav1"].position_map[2] == pytest.approx(4.0, abs=0.2)


def test_an_armed_vehicle_that_does_not_start_is_disarmed(flight):
    _, station = flight
    assert station.command(ARM, 1.0) == ACCEPTED
    station.seconds(9.0)
    assert station.armed
    station.seconds(2.0)
    assert not station.armed
    assert "Disarmed by auto preflight disarming" in station.texts


def test_disarming_in_the_air_takes_force_and_lets_it_fall(flight):
    simulation, station = flight
    station.up(3.0)
    assert station.command(ARM, 0.0, 0.0) == REJECTED
    assert "Disarming denied: not landed" in station.texts
    assert station.command(ARM, 0.0, 21196.0) == ACCEPTED
    station.seconds(1.5)
    assert not station.armed
    assert simulation.uavs["uav1"].crashed
    assert station.command(ARM, 1.0) == REJECTED
    assert "Arming denied: the vehicle has crashed" in station.texts
    assert station.command(401) == ACCEPTED
    assert "Preflight Fail: the vehicle has crashed" in station.texts


def test_modes_that_need_something_are_refused_without_it(flight):
    _, station = flight
    assert station.mode(6) == REJECTED  # no setpoint has come
    assert station.mode(4, 4) == REJECTED  # no mission
    assert station.mode(3) == REJECTED  # no sticks
    assert station.mode(1) == UNSUPPORTED
    assert station.command(176, 0.0, 4.0, 3.0) == DENIED  # not PX4's kind of mode
    assert station.present_mode == (4, 3)


def test_repositions_above_sea_and_keeps_what_is_nan(flight):
    simulation, station = flight
    station.up(4.0)
    before = simulation.uavs["uav1"].position_map
    latitude = 47.397742 + math.degrees(6.0 / 6.37e6)
    fields = (1, 1, 5, REPOSITION, 0, 0, -1.0, 1.0, 0.0, math.radians(45.0))
    station.send("command_int", *fields, round(latitude * 1e7), round(8.545594 * 1e7), 488.0 + 6.0)
    assert station.last("COMMAND_ACK").result == ACCEPTED
    station.seconds(8.0)
    uav = simulation.uavs["uav1"]
    assert uav.position_map == pytest.approx([0.0, 6.0, 6.0], abs=0.3)
    x, y, z, w = uav.attitude
    heading = math.degrees(math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    assert heading == pytest.approx(45.0, abs=3.0)  # 45 deg from north is 45 deg from east
    station.command(REPOSITION, NAN, 1.0, 0.0, NAN, NAN, NAN, NAN)
    station.seconds(1.0)
    assert uav.position_map == pytest.approx([before[0], 6.0, 6.0], abs=0.3)


def test_returns_at_the_height_that_is_set(flight):
    simulation, station = flight
    station.set("RTL_RETURN_ALT", 9.0)
    station.set("RTL_DESCEND_ALT", 4.0)
    station.set("RTL_MIN_DIST", 2.0)
    station.up(3.0)
    station.stream(0.3, station.place, 0.0, 6.0, -3.0)
    assert station.mode(6) == ACCEPTED
    station.stream(4.0, station.place, 0.0, 6.0, -3.0)
    assert station.command(RETURN) == ACCEPTED
    highest, low = 0.0, []
    for _ in range(60):
        station.seconds(0.5)
        x, _, z = simulation.uavs["uav1"].position_map
        highest = max(highest, z)
        low += [z] if abs(x) < 0.4 else []
        if not station.armed:
            break
    assert highest == pytest.approx(9.1, abs=0.4)
    assert not station.armed
    assert simulation.uavs["uav1"].position_map[:2] == pytest.approx([0.0, 0.0], abs=0.3)


def test_cruising_speed_is_that_of_the_parameter(flight):
    simulation, station = flight
    station.set("MPC_XY_CRUISE", 3.0)
    station.up(3.0)
    latitude = 47.397742 + math.degrees(40.0 / 6.37e6)
    fields = (1, 1, 5, REPOSITION, 0, 0, -1.0, 1.0, 0.0, NAN)
    station.send("command_int", *fields, round(latitude * 1e7), round(8.545594 * 1e7), 491.0)
    station.seconds(5.0)
    speed = math.hypot(*simulation.uavs["uav1"].velocity_map[:2])
    assert speed == pytest.approx(3.0, abs=0.2)
    assert station.command(178, 1.0, 5.0) == ACCEPTED
    station.seconds(2.0)
    assert math.hypot(*simulation.uavs["uav1"].velocity_map[:2]) == pytest.approx(5.0, abs=0.3)


def test_tells_who_else_flies_it(flight):
    simulation, station = flight
    simulation.uavs["uav1"].take_off(2.0)
    station.seconds(0.2)
    assert station.armed
    assert station.present_mode == (4, 2)
    station.seconds(5.0)
    assert station.present_mode == (4, 3)
    simulation.uavs["uav1"].land()
    station.seconds(8.0)
    assert not station.armed


def test_sticks_fly_in_position_and_altitude_mode(flight):
    simulation, station = flight
    uav = simulation.uavs["uav1"]

    def push(seconds, x=0, y=0, z=500, r=0):
        for _ in range(round(seconds / 0.05)):
            station.send("manual_control", 1, x, y, z, r, 0)
            station.seconds(0.05)

    push(0.2)
    assert station.mode(3) == ACCEPTED
    assert station.command(ARM, 1.0) == ACCEPTED
    push(2.5, z=900)  # starts
    push(3.0)
    height = uav.position_map[2]
    assert height > 1.0
    push(2.0, x=500)
    assert uav.velocity_map[0] > 2.0  # it looks to the east
    push(3.0)
    assert math.hypot(*uav.velocity_map) < 0.3
    assert station.mode(2) == ACCEPTED
    push(1.5, y=300)
    assert uav.velocity_map[1] < -0.7  # right of east is south
    assert uav.position_map[2] == pytest.approx(height, abs=0.5)
    station.seconds(1.0)  # the sticks fall silent: NAV_RCL_ACT 2
    assert station.present_mode == (4, 5)
    assert "Failsafe: manual control lost" in station.texts


def test_each_vehicle_has_its_own_id_and_ignores_others():
    simulation, first = fly(count=3)
    third = Station(simulation, "uav3")
    with simulation:
        third.seconds(0.2)
        assert third.command(ARM, 1.0) == ACCEPTED
        third.seconds(1.1)
        assert third.armed
        assert third.heartbeat.get_srcSystem() == 3
        first.target = 3
        first.send("command_long", 3, 1, ARM, 0, 1.0, *(NAN,) * 6)
        first.seconds(1.1)
        assert not first.armed
        assert not first.of("COMMAND_ACK")
