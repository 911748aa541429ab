"""What happens by itself, on simulated time: battery, link, fence, satellites."""

import math

import pytest
from flying_bench import fly

HOLD, RETURN, LAND = (4, 3), (4, 5), (4, 6)
ACCEPTED, DENIED = 0, 2


@pytest.fixture
def flight():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        yield simulation, station


def head_north(station, seconds, speed=3.0):
    station.stream(0.3, station.velocity, speed, 0.0, 0.0)
    assert station.mode(6) == ACCEPTED
    for _ in range(round(seconds / 0.05)):
        if station.present_mode != (6, 0):
            return
        station.velocity(speed, 0.0, 0.0)
        station.seconds(0.05)


@pytest.mark.parametrize(("action", "mode"), [(2, HOLD), (3, RETURN), (5, LAND)])
def test_the_fence_is_acted_on(flight, action, mode):
    simulation, station = flight
    station.set("GF_ACTION", action)
    station.set("GF_MAX_HOR_DIST", 4.0)
    station.up(2.0)
    head_north(station, 6.0)
    assert station.present_mode == mode
    assert "Geofence violation: maximum distance from home" in station.texts
    assert simulation.uavs["uav1"].position_map[1] < 7.0


DEGREE = math.degrees(1.0 / 6.37e6)


def reposition(station, north, height=2.0):
    """Result of COMMAND_INT 192 to a position `north` of home."""
    x, y = round((47.397742 + north * DEGREE) * 1e7), round(8.545594 * 1e7)
    before = len(station.of("COMMAND_ACK"))
    fields = (1, 1, 6, 192, 0, 0, -1.0, 1.0, 0.0, math.nan, x, y, height)
    station.send("command_int", *fields)
    (ack,) = station.of("COMMAND_ACK")[before:]
    return ack.result


def test_a_hold_by_failsafe_ends_the_flight_to_a_position(flight):
    simulation, station = flight
    station.up(2.0)
    assert reposition(station, 60.0) == ACCEPTED
    station.seconds(3.0)
    station.set("GF_MAX_HOR_DIST", 5.0)  # a geofence that is set while it flies beyond it
    station.seconds(4.0)
    assert "Geofence violation: maximum distance from home" in station.texts
    stopped = simulation.uavs["uav1"].position_map[1]
    station.seconds(2.0)
    assert simulation.uavs["uav1"].position_map[1] == pytest.approx(stopped, abs=0.3)
    assert stopped < 30.0
    assert reposition(station, 2.0) == ACCEPTED  # back inside


def test_a_hold_for_a_lost_ground_station_ends_the_flight_to_a_position(flight):
    simulation, station = flight
    station.set("NAV_DLL_ACT", 1)
    station.set("COM_DL_LOSS_T", 5)
    station.send_heartbeat()
    station.up(2.0)
    station.send_heartbeat()
    assert reposition(station, 200.0) == ACCEPTED
    station.seconds(8.5)
    stopped = simulation.uavs["uav1"].position_map[1]
    station.seconds(2.0)
    assert simulation.uavs["uav1"].position_map[1] == pytest.approx(stopped, abs=0.3)


def test_a_position_beyond_the_geofence_is_refused(flight):
    simulation, station = flight
    circle = (5003, 0, (20.0, 0.0, 0.0, 0.0), 47.397742, 8.545594, 0.0)
    assert station.upload([circle], 1) == ACCEPTED
    station.up(2.0)
    assert reposition(station, 60.0) == DENIED
    assert "Reposition is outside geofence" in station.texts
    station.seconds(1.0)
    assert abs(simulation.uavs["uav1"].position_map[1]) < 0.5
    assert reposition(station, 10.0) == ACCEPTED
    station.set("GF_ACTION", 1)  # a geofence that only warns
    assert reposition(station, 60.0) == ACCEPTED


def test_a_polygon_to_stay_in_and_a_circle_to_stay_out(flight):
    _, station = flight
    stretch = DEGREE / math.cos(math.radians(47.397742))

    def corner(command, first, north, east):
        position = (47.397742 + north * DEGREE, 8.545594 + east * stretch)
        return command, 0, (first, 0.0, 0.0, 0.0), *position, 0.0

    box = [corner(5001, 4.0, n, e) for n, e in ((-5, -5), (5, -5), (5, 5), (-5, 5))]
    assert station.upload(box, 1) == ACCEPTED
    station.set("GF_ACTION", 2)
    station.up(2.0)
    head_north(station, 5.0)
    assert "Geofence violation: the area to stay in" in station.texts
    assert station.present_mode == HOLD
    assert station.upload([corner(5004, 30.0, 20.0, 0.0)], 1) == ACCEPTED
    station.seconds(0.5)
    assert station.present_mode == HOLD


@pytest.mark.parametrize(("action", "mode"), [(1, HOLD), (2, RETURN), (3, LAND)])
def test_a_lost_ground_station_is_acted_on(flight, action, mode):
    _, station = flight
    station.set("NAV_DLL_ACT", action)
    station.set("COM_DL_LOSS_T", 5)
    station.send_heartbeat()
    station.up(2.0)
    station.send_heartbeat()
    head_north(station, 4.0, speed=0.5)
    assert station.present_mode == (6, 0)
    for _ in range(30):
        station.velocity(0.5, 0.0, 0.0)
        station.seconds(0.05)
    assert station.present_mode == mode
    assert "Failsafe: connection to ground station lost" in station.texts
    assert station.mode(4, 3) == ACCEPTED
    station.seconds(1.0)
    assert station.present_mode == HOLD  # the operator that takes over keeps control


def test_a_ground_station_that_was_never_connected_is_a_lost_one(flight):
    _, station = flight
    station.up(2.0)
    station.set("NAV_DLL_ACT", 2)
    station.seconds(0.2)
    assert station.present_mode == RETURN
    assert station.texts.count("Failsafe: connection to ground station lost") == 1


def test_without_its_ground_station_it_is_not_armed_where_that_counts(flight):
    _, station = flight
    station.set("COM_DL_LOSS_T", 5)
    station.set("NAV_DLL_ACT", 1)
    why = "Arming denied: no connection to the ground control station"
    assert station.command(400, 1.0) == 1
    assert station.texts.count(why) == 1
    station.send_heartbeat()
    assert station.command(400, 1.0) == ACCEPTED
    assert station.command(400, 0.0) == ACCEPTED
    station.seconds(5.2)
    assert station.command(400, 1.0) == 1  # lost again
    assert station.texts.count(why) == 2
    station.set("NAV_DLL_ACT", 0)
    assert station.command(400, 1.0) == ACCEPTED


def test_a_low_battery_warns_returns_and_lands(flight):
    simulation, station = flight
    station.set("COM_LOW_BAT_ACT", 3)
    station.up(2.0)
    core = simulation.vehicles.nodes[0].core
    memory = core.context.memory
    update = core.update
    drained = {"charge": 0.5, "voltage": 11.0, "current": 9.0}
    core.update = lambda state: update(state._replace(**drained))
    for drained["charge"], mode in ((0.14, HOLD), (0.06, RETURN), (0.04, LAND)):
        station.seconds(0.3)
        assert station.present_mode == mode
    assert memory.failsafe
    assert {"Low battery level", "Critical battery level", "Emergency battery level"} <= set(
        station.texts
    )
    station.command(512, 147.0)
    assert station.last("BATTERY_STATUS").charge_state == 4
    station.command(512, 1.0)
    assert station.last("SYS_STATUS").battery_remaining == 4


def test_without_satellites_it_is_not_armed_and_lands():
    simulation, station = fly(sensors=[{"kind": "gnss"}])
    with simulation:
        station.seconds(1.0)
        station.up(2.0)
        simulation.faults.inject({"kind": "gnss_loss", "uav": "uav1"})
        station.seconds(4.0)
        assert station.present_mode == HOLD
        station.seconds(2.5)
        assert station.present_mode == LAND
        assert "Failsafe: position lost, landing" in station.texts
        station.command(512, 24.0)
        assert station.last("GPS_RAW_INT").fix_type == 1
        station.seconds(9.0)
        assert not station.armed
        assert station.command(400, 1.0) == 1
        assert "Arming denied: no satellite fix" in station.texts
        station.set("COM_ARM_WO_GPS", 1)
        assert station.command(400, 1.0) == ACCEPTED
