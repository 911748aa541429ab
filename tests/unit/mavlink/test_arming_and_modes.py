"""Arming, take-off, landing, holding, returning: the first commands of a ground station."""

import math

import pytest
from flying_bench import NAN, Station, fly

ARM, TAKE_OFF, LAND, RETURN, REPOSITION, SET_HOME = 400, 22, 21, 20, 192, 179
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


@pytest.mark.parametrize("height", [2.5, 6.0])
def test_a_take_off_ends_at_the_height_that_is_set(flight, height):
    simulation, station = flight
    ground = simulation.uavs["uav1"].position_map[2]
    station.up(height)
    station.seconds(4.0)
    assert station.present_mode == (4, 3)
    risen = simulation.uavs["uav1"].position_map[2] - ground
    assert risen == pytest.approx(height, abs=0.04)


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


@pytest.mark.parametrize(("command", "mode"), [(RETURN, (4, 5)), (LAND, (4, 6))])
def test_is_not_armed_in_modes_that_only_come_down(flight, command, mode):
    _, station = flight
    assert station.command(command) == ACCEPTED
    for force in (0.0, 21196.0):  # which PX4 accepts from no external client
        assert station.command(ARM, 1.0, force) == REJECTED
    assert "Arming denied: mode not suitable for arming" in station.texts
    assert station.present_mode == mode
    assert not station.armed
    assert station.mode(4, 3) == ACCEPTED
    station.up(2.0)
    assert station.command(command) == ACCEPTED
    station.command(512, 1.0)
    assert station.last("SYS_STATUS").onboard_control_sensors_health & 1 << 28  # it may fly so


@pytest.mark.parametrize(
    ("mode", "why"),
    [
        ((6, 0), "no offboard signal"),
        ((4, 4), "no valid mission"),
        ((3, 0), "no manual control input"),
        ((2, 0), "no manual control input"),
    ],
)
def test_modes_that_need_something_are_refused_without_it_and_before_arming(flight, mode, why):
    _, station = flight
    assert station.mode(*mode) == ACCEPTED  # as PX4, which looks at arming
    assert station.present_mode == mode
    assert station.command(ARM, 1.0) == REJECTED
    assert f"Arming denied: {why}" in station.texts
    assert not station.armed
    assert station.mode(4, 3) == ACCEPTED
    station.up(2.0)
    assert station.mode(*mode) == REJECTED
    assert any(text.endswith(f"not possible: {why}") for text in station.texts)
    assert station.present_mode == (4, 3)


def test_modes_that_are_none(flight):
    _, station = flight
    assert station.mode(1) == UNSUPPORTED
    assert station.command(176, 0.0, 4.0, 3.0) == UNSUPPORTED  # no flag of a mode
    assert station.present_mode == (4, 3)


def test_the_old_message_for_modes_is_answered_as_the_command(flight):
    _, station = flight
    for mode, result in ((4 << 16 | 5 << 24, ACCEPTED), (1 << 16, UNSUPPORTED)):
        station.send("set_mode", 1, 1, mode)
        ack = station.last("COMMAND_ACK")
        assert (ack.command, ack.result, ack.progress) == (176, result, 0)
        assert (ack.target_system, ack.target_component) == (255, 190)
    assert station.present_mode == (4, 5)


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


@pytest.mark.parametrize("flags", [0.0, NAN])
def test_a_reposition_without_its_flag_does_not_leave_another_mode(flight, flags):
    _, station = flight
    station.up(3.0)
    position = (47.397742 + math.degrees(20.0 / 6.37e6), 8.545594, 488.0 + 6.0)
    assert station.command(RETURN) == ACCEPTED
    assert station.command(REPOSITION, -1.0, flags, 0.0, NAN, *position) == DENIED
    station.seconds(1.0)
    assert station.present_mode == (4, 5)
    assert station.mode(4, 3) == ACCEPTED
    assert station.command(REPOSITION, -1.0, flags, 0.0, NAN, *position) == ACCEPTED
    assert station.command(RETURN) == ACCEPTED
    assert station.command(REPOSITION, -1.0, 1.0, 0.0, NAN, *position) == ACCEPTED
    assert station.present_mode == (4, 3)


def test_returns_at_the_height_that_is_set(flight):
    simulation, station = flight
    station.set("RTL_RETURN_ALT", 9.0)
    station.set("RTL_DESCEND_ALT", 4.0)
    station.set("RTL_MIN_DIST", 2.0)
    station.up(3.0)
    station.stream(0.3, station.send_position, 0.0, 6.0, -3.0)
    assert station.mode(6) == ACCEPTED
    station.stream(4.0, station.send_position, 0.0, 6.0, -3.0)
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


@pytest.mark.parametrize(
    ("north", "position"), [(0.0, (473977420, 85455940)), (60_000.0, (479373904, 85455940))]
)
def test_home_is_sent_as_it_was_set_and_arming_keeps_it(flight, north, position):
    _, station = flight
    station.send("command_int", 1, 1, 0, SET_HOME, 0, 0, 0.0, NAN, NAN, NAN, *position, 500.0)
    assert station.last("COMMAND_ACK").result == ACCEPTED
    for _ in range(2):
        home = station.last("HOME_POSITION")
        assert (home.latitude, home.longitude, home.altitude) == (*position, 500_000)
        assert home.z == pytest.approx(-12.0, abs=0.2)
        assert home.x == pytest.approx(north, rel=2e-3, abs=0.1)
        assert station.command(ARM, 1.0) == ACCEPTED
        station.seconds(3.0)
    assert station.command(SET_HOME, 1.0) == ACCEPTED
    assert station.last("HOME_POSITION").altitude == pytest.approx(488_100, abs=50)


@pytest.mark.parametrize(
    "position",
    [
        (0.0, 0.0, 0.0),
        (-47.397742, -171.454406, 488.0),  # on the other side of the earth
        (47.4, 8.5, 1e9),
        (47.4, NAN, 488.0),
        (95.0, 8.5, 488.0),
    ],
)
def test_a_home_that_the_map_cannot_hold_is_denied(flight, position):
    _, station = flight
    station.command(512, 242.0)
    before = station.last("HOME_POSITION")
    assert station.command(SET_HOME, 0.0, NAN, NAN, NAN, *position) == DENIED
    station.command(512, 242.0)
    after = station.last("HOME_POSITION")
    assert (after.latitude, after.altitude) == (before.latitude, before.altitude)


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


def test_other_controllers_are_reported(flight):
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
