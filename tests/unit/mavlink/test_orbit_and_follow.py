"""Orbits and follow-me: modes that PX4 has beside its missions."""

import math

import pytest
from flying_bench import NAN, fly

ACCEPTED, REJECTED, DENIED = 0, 1, 2
ORBIT = 34
LATITUDE, LONGITUDE, ALTITUDE = 47.397742, 8.545594, 488.0
M = 1.0 / 111_195.0
"""deg of latitude a metre, within a thousandth."""


@pytest.fixture
def flight():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        station.up(4.0)
        yield simulation.uavs["uav1"], station


def orbit(station, radius=10.0, speed=3.0, facing=0.0, north=0.0, height=6.0):
    """As MAVSDK sends it: relative frame, yet a height above the sea, as PX4 reads it."""
    x, y = round((LATITUDE + north * M) * 1e7), round(LONGITUDE * 1e7)
    params = (radius, speed, facing, NAN, x, y, ALTITUDE + height)
    station.send("command_int", 1, 1, 3, ORBIT, 0, 0, *params)
    return station.last("COMMAND_ACK").result


@pytest.mark.parametrize("radius", [10.0, -10.0])
def test_orbits_round_a_position_facing_it(flight, radius):
    uav, station = flight
    assert orbit(station, radius, north=10.0) == ACCEPTED
    assert station.present_mode == (3, 1)
    station.seconds(12.0)
    turned, last = 0.0, None
    for _ in range(40):
        station.seconds(0.5)
        x, y, z = uav.position_map
        assert math.hypot(x, y - 10.0) == pytest.approx(10.0, abs=0.6)
        assert z == pytest.approx(6.0, abs=0.3)
        angle = math.atan2(y - 10.0, x)
        qx, qy, qz, qw = uav.attitude
        yaw = math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
        assert math.remainder(yaw - angle - math.pi, 2 * math.pi) == pytest.approx(0.0, abs=0.25)
        if last is not None:
            turned += math.remainder(angle - last, 2 * math.pi)
        last = angle
    clockwise = math.copysign(1.0, radius)
    assert turned * -clockwise == pytest.approx(3.0 / 10.0 * 19.5, rel=0.08)
    assert station.command(512, 360.0) == ACCEPTED
    status = station.last("ORBIT_EXECUTION_STATUS")
    assert (status.radius, status.z) == (radius, pytest.approx(ALTITUDE + 6.0))


def test_an_orbit_is_held_within_its_limits(flight):
    uav, station = flight
    assert orbit(station, 0.1, 50.0) == ACCEPTED
    station.seconds(6.0)
    assert math.hypot(*uav.velocity_map[:2]) < 2.0  # sqrt(2 m/s^2 * 1 m)
    assert station.mode(4, 3) == ACCEPTED
    assert station.command(512, 360.0) == DENIED  # there is none any more


def test_orbits_that_cannot_be_are_refused():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        assert orbit(station) == REJECTED  # on the ground
        station.up(4.0)
        assert orbit(station, math.inf) == DENIED
        assert orbit(station, north=1e7) == DENIED
        assert station.present_mode == (4, 3)


def target(station, north, east, velocity=(NAN, NAN, NAN), altitude=ALTITUDE):
    position = (round((LATITUDE + north * M) * 1e7), round((LONGITUDE + east * 1.4772 * M) * 1e7))
    unknown = [NAN] * 3
    rest = (velocity, unknown, [1.0, NAN, NAN, NAN], unknown, unknown, 0)
    station.send("follow_target", 0, 1, *position, altitude, *rest)


def test_follows_a_target_that_moves(flight):
    uav, station = flight
    assert station.mode(4, 8) == ACCEPTED
    assert station.present_mode == (4, 8)
    station.seconds(1.0)
    assert station.set("FLW_TGT_DST", 5.0) == 5.0
    for k in range(40):  # north with 2 m/s
        target(station, k, 0.0)
        station.seconds(0.5)
    x, y, z = uav.position_map
    assert (x, y, z) == pytest.approx((0.0, 40.0 - 5.0, 8.1), abs=0.8)  # behind it
    station.seconds(12.0)  # the target is silent, and counts as standing
    assert math.hypot(*uav.velocity_map[:2]) < 0.1
    assert station.mode(4, 3) == ACCEPTED


def test_stays_on_its_side_of_a_target_that_stands(flight):
    uav, station = flight
    assert station.mode(4, 8) == ACCEPTED
    assert station.set("FLW_TGT_ALT_M", 2) == 2
    for _ in range(24):
        target(station, 0.0, 20.0, (0.0, 0.0, 0.0), ALTITUDE + 4.0)
        station.seconds(0.5)
    assert uav.position_map == pytest.approx([12.0, 0.0, 12.0], abs=0.4)


def test_stays_above_ground_where_the_target_is_below(flight):
    uav, station = flight
    assert station.mode(4, 8) == ACCEPTED
    assert station.set("FLW_TGT_ALT_M", 2) == 2
    for k in range(40):
        target(station, k, 20.0, (2.0, 0.0, 0.0), ALTITUDE - 8.0)
        station.seconds(0.5)
        assert uav.position_map[2] > 0.6
    assert uav.mode.name == "VELOCITY"
    assert uav.position_map[2] < 1.5


@pytest.mark.parametrize("north", [NAN, 1e7])
def test_targets_that_are_none_are_not_followed(flight, north):
    uav, station = flight
    assert station.mode(4, 8) == ACCEPTED
    if math.isnan(north):
        target(station, 0.0, 0.0, altitude=NAN)
        target(station, 0.0, 0.0, altitude=math.inf)
    else:
        station.send(
            "follow_target",
            0,
            1,
            2**31 - 1,
            0,
            0.0,
            [NAN] * 3,
            [NAN] * 3,
            [NAN] * 4,
            [NAN] * 3,
            [NAN] * 3,
            0,
        )
    station.seconds(2.0)
    assert uav.position_map == pytest.approx([0.0, 0.0, 4.1], abs=0.3)
