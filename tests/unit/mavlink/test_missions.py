"""Plans up and down, what is refused of them, and missions flown."""

import math

import pytest
from flying_bench import NAN, Station, fly

ACCEPTED, DENIED = 0, 2
WAYPOINT, LOITER, RETURN, LAND, TAKE_OFF, DELAY, YAW, JUMP, SPEED = (
    *(16, 19, 20, 21, 22, 93, 115, 177, 178),
)
LATITUDE, LONGITUDE = 47.397742, 8.545594
RADIUS_M = 6.37e6


def at(north, east, up, command=WAYPOINT, params=(0.0, 0.0, 0.0, NAN)):
    """An item at a position from the first UAV's start, above home."""
    latitude = LATITUDE + math.degrees(north / RADIUS_M)
    longitude = LONGITUDE + math.degrees(east / RADIUS_M / math.cos(math.radians(LATITUDE)))
    return command, 6, params, latitude, longitude, up


def do(command, *params):
    return command, 2, (*params, *(0.0,) * (4 - len(params))), 0.0, 0.0, 0.0


TOUR = [
    do(SPEED, 1.0, 4.0),
    at(0.0, 0.0, 3.0, TAKE_OFF),
    at(6.0, 0.0, 4.0),
    at(6.0, 6.0, 4.0, WAYPOINT, (1.0, 0.0, 0.0, 90.0)),
    do(DELAY, 1.0),
    do(YAW, 180.0),
    do(JUMP, 3.0, 1.0),
    at(0.0, 6.0, 3.0, LOITER, (0.5, 0.0, 0.0, NAN)),
    at(0.0, 0.0, 3.0),
    at(0.0, 0.0, 0.0, LAND),
]


SURVEY = [
    do(206, 0.0, 0.0, 1.0, 0.0),
    (530, 2, (0.0, 2.0, NAN, NAN), 0.0, 0.0, NAN),
    do(178, 1.0, 5.0),
    at(0.0, 0.0, 3.0, TAKE_OFF),
    (195, 6, (0.0, 0.0, 0.0, 0.0), LATITUDE, LONGITUDE, 1.0),
    at(3.0, 0.0, 3.0),
    do(206, 2.0, 0.0, 1.0, 0.0),
    (205, 2, (-90.0, 0.0, 0.0, 0.0), 0.0, 0.0, 2.0),
    do(1000, -45.0, 0.0, NAN, NAN),
    do(2000, 0.0, 1.0, 0.0, 0.0),
    at(3.0, 3.0, 3.0, WAYPOINT, (0.0, 0.0, 0.0, NAN)),
    do(2001, 0.0),
    do(2500, 0.0),
    do(2501, 0.0),
    do(206, 0.0, 0.0, 1.0, 0.0),
    do(197),
    do(211, 1.0, 0.0),
    do(189),
    at(0.0, 0.0, 5.0, 31, (0.0, 2.0, 0.0, 1.0)),
    do(RETURN),
]


@pytest.fixture
def flight():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        yield simulation, station


def test_a_mission_of_ten_items_is_flown_and_ends_where_it_began(flight):
    simulation, station = flight
    assert station.upload(TOUR) == ACCEPTED
    assert station.command(300, 0.0, 0.0) == ACCEPTED  # arms and begins
    fastest, corner = 0.0, 1e9
    uav = simulation.uavs["uav1"]
    for _ in range(200):
        station.seconds(0.3)
        fastest = max(fastest, math.hypot(*uav.velocity_map[:2]))
        corner = min(corner, math.dist(uav.position_map, (6.0, 6.0, 4.1)))
        if not station.armed and station.of("MISSION_ITEM_REACHED"):
            break
    reached = [message.seq for message in station.of("MISSION_ITEM_REACHED")]
    assert reached == [0, 1, 2, 3, 4, 5, 6, 3, 4, 5, 6, 7, 8, 9]  # the jump goes back once
    assert fastest < 4.3
    assert corner < 0.5
    assert "Mission finished, landed" in station.texts
    assert uav.position_map[:2] == pytest.approx([0.0, 0.0], abs=0.5)
    assert not station.armed


def test_a_survey_passes_by_what_is_for_payloads_and_changes_height_last(flight):
    simulation, station = flight
    assert station.upload(SURVEY) == ACCEPTED
    assert station.command(300, 0.0, 0.0) == ACCEPTED
    uav = simulation.uavs["uav1"]
    highest = {}
    for _ in range(100):
        station.seconds(0.3)
        now = len(station.of("MISSION_ITEM_REACHED"))
        highest[now] = max(highest.get(now, 0.0), uav.position_map[2])
        if now == len(SURVEY):
            break
    reached = [message.seq for message in station.of("MISSION_ITEM_REACHED")]
    assert reached == list(range(len(SURVEY)))
    assert highest[18] > 4.0  # 31 ends at 5 m, within NAV_MC_ALT_RAD
    assert station.present_mode == (4, 5)


def test_a_loiter_of_some_time_names_no_heading(flight):
    simulation, station = flight
    stay = at(0.0, 8.0, 3.0, LOITER, (9.0, 0.0, 0.0, 1.0))  # its fourth is about leaving circles
    assert station.upload([at(0.0, 0.0, 3.0, TAKE_OFF), stay]) == ACCEPTED
    assert station.command(300, 0.0, 0.0) == ACCEPTED
    station.seconds(12.0)
    x, y, z, w = simulation.uavs["uav1"].attitude
    assert math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) == pytest.approx(0.0, abs=0.1)


def test_a_region_of_interest_is_faced_until_there_is_none(flight):
    simulation, station = flight
    assert station.upload(
        [
            at(0.0, 0.0, 3.0, TAKE_OFF),
            (195, 6, (0.0, 0.0, 0.0, 0.0), *at(20.0, 0.0, 0.0)[3:]),
            at(0.0, 30.0, 3.0),
            do(197),
            at(0.0, 60.0, 3.0),
        ]
    ) == (ACCEPTED)
    assert station.command(300, 0.0, 0.0) == ACCEPTED
    uav = simulation.uavs["uav1"]
    yaws = {}
    for _ in range(60):
        station.seconds(0.3)
        x, y, z, w = uav.attitude
        yaws[round(uav.position_map[0] / 4.0)] = math.atan2(
            2 * (w * z + x * y), 1 - 2 * (y * y + z * z)
        )
    assert yaws[5] == pytest.approx(math.atan2(20.0, -20.0), abs=0.15)  # 20 m north-west of there
    assert yaws[14] == pytest.approx(0.0, abs=0.1)  # the path leads east


@pytest.mark.parametrize(
    ("last", "mode", "texts"),
    [([], (4, 4), ["Mission finished, loitering"]), ([do(RETURN)], (4, 5), [])],
)
def test_its_end_in_the_air_is_reported_where_it_stays_there(flight, last, mode, texts):
    _, station = flight
    assert station.upload([at(0, 0, 3, TAKE_OFF), at(4, 0, 3), *last]) == ACCEPTED
    assert station.command(300, 0.0, 0.0) == ACCEPTED
    station.seconds(9.0)
    assert station.last("MISSION_ITEM_REACHED").seq == 1 + len(last)
    assert [text for text in station.texts if text.startswith("Mission finished")] == texts
    assert station.present_mode == mode


def test_plans_come_back_as_they_went(flight):
    _, station = flight
    fence = [
        (5003, 0, (80.0, 0.0, 0.0, 0.0), LATITUDE, LONGITUDE, 0.0),
        *(
            (5001, 0, (3.0, 0.0, 0.0, 0.0), LATITUDE + a * 1e-4, LONGITUDE + b * 1e-4, 0.0)
            for a, b in ((0, 0), (0, 9), (9, 0))
        ),
    ]
    rally = [(5100, 3, (0.0, 0.0, 0.0, 0.0), LATITUDE, LONGITUDE, 20.0)]
    for kind, items in ((0, TOUR), (0, SURVEY), (1, fence), (2, rally)):
        assert station.upload(items, kind) == ACCEPTED
        station.send("mission_request_list", 1, 1, kind)
        assert station.last("MISSION_COUNT").count == len(items)
        for k, (command, frame, params, x, y, z) in enumerate(items):
            station.send("mission_request_int", 1, 1, k, kind)
            item = station.last("MISSION_ITEM_INT")
            assert (item.seq, item.command, item.frame, item.mission_type) == (
                k,
                command,
                frame,
                kind,
            )
            returned = (item.param1, item.param2, item.param3, item.param4)
            assert returned == pytest.approx(params, nan_ok=True)
            assert (item.x, item.y) == (round(x * 1e7), round(y * 1e7))
            assert item.z == pytest.approx(z, nan_ok=True)
        station.send("mission_ack", 1, 1, 0, kind)
        station.send("mission_request_int", 1, 1, len(items), kind)
        assert station.last("MISSION_ACK").type == 13
    station.send("mission_clear_all", 1, 1, 255)
    assert station.last("MISSION_ACK").type == ACCEPTED
    for kind in (0, 1, 2):
        station.send("mission_request_list", 1, 1, kind)
        assert station.last("MISSION_COUNT").count == 0


@pytest.mark.parametrize(
    ("items", "kind", "result"),
    [
        ([at(0, 0, 3), do(JUMP, 9.0, 1.0)], 0, 6),  # there is no such item
        ([do(SPEED, 1.0, 3.0), do(JUMP, 0.0, -1.0)], 0, 5),  # goes round without flying
        ([at(0, 0, NAN)], 0, 12),
        ([(*at(0, 0, 3)[:3], 95.0, 8.5, 3.0)], 0, 10),
        ([(*at(0, 0, 3)[:3], 47.0, 190.0, 3.0)], 0, 11),
        ([(WAYPOINT, 1, (0, 0, 0, 0), LATITUDE, LONGITUDE, 3.0)], 0, 2),  # a local frame
        ([do(183, 1.0, 1500.0)], 0, 3),  # servos: not of PX4's missions
        ([at(0, 0, 3, 18, (2.0, 0.0, 5.0, 0.0))], 0, 3),  # nor turns
        ([at(0, 0, 3, 189)], 0, 3),  # a marker has no position
        ([do(195)], 0, 3),  # a region of interest has one
        ([do(201, 3.0)], 0, 6),
        ([do(2001, 0.0, 7.0)], 0, 7),  # takes one parameter
        ([(1, *do(197)[1:])], 0, 3),
        ([do(DELAY, NAN)], 0, 6),
        ([(5001, 0, (3.0, 0, 0, 0), LATITUDE, LONGITUDE, 0.0)] * 2, 1, 5),  # a corner is missing
        ([(5003, 0, (-1.0, 0, 0, 0), LATITUDE, LONGITUDE, 0.0)], 1, 6),
        ([at(0, 0, 3)], 1, 3),  # no waypoints in fences
    ],
)
def test_contradictory_plans_are_refused_with_the_reason(flight, items, kind, result):
    _, station = flight
    assert station.upload([at(0, 0, 5)]) == ACCEPTED
    assert station.upload(items, kind) == result
    station.send("mission_request_list", 1, 1, 0)
    assert station.last("MISSION_COUNT").count == 1  # what was there is there still


def test_too_many_items_and_foreign_senders(flight):
    simulation, station = flight
    station.send("mission_count", 1, 1, 501, 0)
    assert station.last("MISSION_ACK").type == 4
    station.send("mission_count", 1, 1, 3, 0)
    other = Station(simulation, system=200, link=9)
    other.send("mission_count", 1, 1, 1, 0)
    assert other.last("MISSION_ACK").type == 14
    other.item(0, at(0, 0, 3))  # not requested
    assert station.last("MISSION_REQUEST_INT").seq == 0


def test_items_may_come_early_and_twice(flight):
    _, station = flight
    items = [at(0, 0, 3), at(0, 0, 4), at(0, 0, 5)]
    station.send("mission_count", 1, 1, 3, 0)
    for sequence in (1, 2, 0, 2, 0):
        station.item(sequence, items[sequence])
    assert not station.of("MISSION_ACK")
    station.received.clear()
    station.seconds(0.4)
    assert station.last("MISSION_REQUEST_INT").seq == 1  # the awaited item is requested again
    for sequence in (1, 1, 2):
        station.item(sequence, items[sequence])
    assert [ack.type for ack in station.of("MISSION_ACK")] == [ACCEPTED]
    station.item(2, items[2])  # the ACK was lost
    assert [ack.type for ack in station.of("MISSION_ACK")] == [ACCEPTED, ACCEPTED]
    station.item(1, items[1])
    assert station.last("MISSION_ACK").type == 1  # no transfer is under way
    for sequence, (*_, height) in enumerate(items):
        station.send("mission_request_int", 1, 1, sequence, 0)
        assert station.last("MISSION_ITEM_INT").z == height


def test_an_upload_that_its_sender_cancels_ends_at_once(flight):
    simulation, station = flight
    assert station.upload([at(0, 0, 5)]) == ACCEPTED
    station.send("mission_count", 1, 1, 3, 0)
    other = Station(simulation, system=200, link=9)
    other.send("mission_ack", 1, 1, 15, 0)  # not his to cancel
    assert other.upload([at(0, 0, 3)]) == 14
    station.send("mission_ack", 1, 1, 15, 1)  # of another kind of plan
    station.send("mission_ack", 1, 1, 1, 0)  # not a cancellation
    assert other.upload([at(0, 0, 3)]) == 14
    station.send("mission_ack", 1, 1, 15, 0)
    station.received.clear()
    station.seconds(1.0)
    assert not station.of("MISSION_REQUEST_INT")
    station.send("mission_request_int", 1, 1, 0, 0)
    assert station.last("MISSION_ITEM_INT").z == 5.0  # what was there is there still
    assert other.upload([at(0, 0, 4)]) == ACCEPTED


def test_items_that_are_lost_are_asked_for_again_and_given_up(flight):
    _, station = flight
    station.send("mission_count", 1, 1, 2, 0)
    station.seconds(1.0)
    asked = [message.seq for message in station.of("MISSION_REQUEST_INT")]
    assert asked == [0] * len(asked)
    assert 3 <= len(asked) <= 5
    station.item(0, at(0, 0, 3))
    assert station.last("MISSION_REQUEST_INT").seq == 1
    station.seconds(5.3)
    assert station.last("MISSION_ACK").type == 15


def test_pausing_setting_the_item_and_going_on(flight):
    simulation, station = flight
    assert station.upload([at(0, 0, 3, TAKE_OFF), at(30, 0, 3), at(0, 0, 3)]) == ACCEPTED
    assert station.command(300, 0.0, 0.0) == ACCEPTED
    station.seconds(6.0)
    assert station.command(193, 0.0) == ACCEPTED
    station.seconds(2.5)
    position = simulation.uavs["uav1"].position_map
    station.seconds(1.0)
    assert simulation.uavs["uav1"].position_map == pytest.approx(position, abs=0.2)
    assert station.command(224, 7.0) == 4  # no such item: FAILED
    assert station.command(224, 2.0) == ACCEPTED
    assert station.mode(4, 4) == ACCEPTED
    station.seconds(6.0)
    assert [m.seq for m in station.of("MISSION_ITEM_REACHED")][-1] == 2


def test_what_cannot_be_started_is_denied(flight):
    _, station = flight
    assert station.command(300, 0.0, 0.0) == DENIED
    assert "Mission start denied: no valid mission" in station.texts
    assert station.upload([at(0, 0, 3, TAKE_OFF), at(4, 0, 3), at(0, 0, 3)]) == ACCEPTED
    for first in (3.0, -2.0, NAN, math.inf):
        assert station.command(300, first, 0.0) == DENIED
    assert not station.armed


def test_a_mission_is_started_from_the_item_that_is_asked_for(flight):
    _, station = flight
    assert station.upload([at(0, 0, 3, TAKE_OFF), at(4, 0, 3), at(0, 0, 3)]) == ACCEPTED
    for first, current in ((2.0, 2), (-1.0, 2), (0.0, 0)):
        assert station.command(300, first, 0.0) == ACCEPTED
        station.command(512, 42.0)
        assert station.last("MISSION_CURRENT").seq == current
    assert station.armed
    assert station.present_mode == (4, 4)


def test_a_mission_that_leaves_the_fence_is_not_begun(flight):
    _, station = flight
    assert station.upload([at(0, 0, 3, TAKE_OFF), at(50, 0, 3)]) == ACCEPTED
    station.set("GF_MAX_HOR_DIST", 20.0)
    assert station.command(300, 0.0, 0.0) == DENIED
    assert any("Geofence violation for waypoint 2" in text for text in station.texts)
    station.set("GF_MAX_HOR_DIST", 0.0)
    assert station.command(300, 0.0, 0.0) == ACCEPTED


@pytest.mark.parametrize(
    ("items", "text"),
    [
        ([at(0, 0, 0, LAND), at(5, 0, 3)], "Mission rejected: starts with landing"),
        (
            [at(5, 0, 3), at(0, 0, 3, TAKE_OFF), at(5, 5, 3)],
            "Mission rejected: takeoff not first waypoint item",
        ),
        ([at(0, 0, -1, TAKE_OFF)], "Mission rejected: Takeoff altitude below home altitude!"),
    ],
)
def test_missions_that_cannot_be_flown_are_reported_and_not_started(flight, items, text):
    _, station = flight
    assert station.upload(items) == ACCEPTED  # as PX4, which keeps them
    assert text in station.texts
    station.received.clear()
    assert station.command(300, 0.0, 0.0) == DENIED
    assert any(text in each for each in station.texts)
    station.received.clear()
    assert station.mode(4, 4) == ACCEPTED
    assert station.command(400, 1.0) == 1
    assert f"Arming denied: {text}" in station.texts
    station.command(512, 0.0)
    assert not station.armed


def test_a_far_first_waypoint_is_reported_and_may_be_flown(flight):
    _, station = flight
    assert station.upload([at(0, 0, 3, TAKE_OFF), at(50, 0, 3)]) == ACCEPTED
    assert not [text for text in station.texts if "far away" in text]
    station.set("MIS_DIST_1WP", 100.0)
    assert station.upload([at(300, 0, 3)]) == ACCEPTED
    assert "First waypoint far away from home: 300m. Correct mission loaded?" in station.texts
    assert station.mode(4, 4) == ACCEPTED


def test_a_plan_that_comes_in_flight_is_looked_at_too(flight):
    simulation, station = flight
    station.set("GF_MAX_HOR_DIST", 20.0)
    assert station.upload([at(0, 0, 3, TAKE_OFF), at(15, 0, 3)]) == ACCEPTED
    assert station.command(300, 0.0, 0.0) == ACCEPTED
    station.seconds(5.0)
    assert station.upload([at(0, 0, 3, TAKE_OFF), at(50, 0, 3)]) == ACCEPTED
    assert "Geofence violation for waypoint 2" in station.texts
    assert station.present_mode == (4, 3)
    station.seconds(6.0)
    assert simulation.uavs["uav1"].position_map[1] < 20.0
    assert station.upload([at(0, 0, 3, TAKE_OFF), at(15, 0, 3)]) == ACCEPTED
    assert station.mode(4, 4) == ACCEPTED
    circle = (5004, 0, (4.0, 0.0, 0.0, 0.0), at(15, 0, 0)[3], LONGITUDE, 0.0)
    assert station.upload([circle], 1) == ACCEPTED  # a fence about the goal
    assert station.present_mode == (4, 3)
