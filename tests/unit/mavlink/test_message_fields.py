"""Fields of messages and commands act as MAVLink defines them and PX4 obeys them, or are refused.

Expectations come from MAVLink's `common.xml` and PX4's sources, named with each test.
"""

import math

import numpy as np
import pytest
from flying_bench import LINK, NAN, Station, fly

from volery.core import rotations
from volery.mavlink.autopilot.messages.status_messages import status_texts
from volery.mavlink.codec import dialect

ACCEPTED, REJECTED, DENIED, UNSUPPORTED, FAILED, BAD_FRAME = 0, 1, 2, 3, 4, 9
UNUSED = 32767
"""INT16_MAX, "this axis is invalid" in MANUAL_CONTROL."""
HERE = (47.397742, 8.545594)
RADIUS_M = 6.37e6


def degrees(north, east):
    latitude = HERE[0] + math.degrees(north / RADIUS_M)
    return latitude, HERE[1] + math.degrees(east / RADIUS_M / math.cos(math.radians(HERE[0])))


def heading_of(uav):
    """Clockwise from north, deg."""
    return math.degrees(0.5 * math.pi - float(rotations.yaw_of(uav.attitude)))


def is_heading(value, wanted, within=6.0):
    return abs(math.remainder(value - wanted, 360.0)) < within


@pytest.fixture
def ground():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        yield station, simulation.uavs["uav1"]


@pytest.fixture
def air(ground):
    station, uav = ground
    station.up(4.0)
    return station, uav


def steer(station, seconds, x=UNUSED, y=UNUSED, z=UNUSED, r=UNUSED):
    for _ in range(round(seconds / 0.05)):
        station.send("manual_control", 1, x, y, z, r, 0)
        station.seconds(0.05)


# ---------------------------------------------------------------------------------- MANUAL_CONTROL


def test_unused_axes_are_centred_and_the_others_act(air):
    """MANUAL_CONTROL: "a value of INT16_MAX indicates that this axis is invalid"."""
    station, uav = air
    steer(station, 0.2)
    assert station.mode(3) == ACCEPTED
    height, heading = uav.position_map[2], heading_of(uav)
    steer(station, 2.0, x=300, z=500)
    assert uav.velocity_map[0] > 1.5  # it looks to the east
    assert uav.velocity_map[1] == pytest.approx(0.0, abs=0.1)
    steer(station, 1.5, r=1000)
    assert not is_heading(heading_of(uav), heading, 45.0)
    steer(station, 1.0, x=5000, z=-1000)  # out of the range that the definition gives
    assert uav.position_map[2] == pytest.approx(height, abs=0.3)
    assert station.present_mode == (3, 0)


def test_a_second_joystick_waits_until_the_first_is_silent(air):
    """Two ground stations: their sticks must not mix."""
    station, uav = air
    other = Station(station.simulation, system=254, link=LINK + 1)
    steer(station, 0.2)
    assert station.mode(3) == ACCEPTED
    start = uav.position_map.copy()
    for _ in range(30):
        steer(station, 0.05, z=500)
        other.send("manual_control", 1, 1000, 0, 500, 0, 0)
    assert uav.position_map == pytest.approx(start, abs=0.3)
    texts = [text for text in station.texts if "Manual control of system 254 ignored" in text]
    assert len(texts) == 1
    station.seconds(0.6)  # COM_RC_LOSS_T is 0.5 s
    steer(other, 0.2)
    assert station.mode(3) == ACCEPTED
    steer(other, 2.0, x=300, z=500)
    assert uav.velocity_map[0] > 1.5


# -------------------------------------------------------------------------------------- STATUSTEXT


def joined(messages):
    """Texts as a receiver that follows MAVLink's definition of `id` and `chunk_seq` joins them."""
    parts, whole = {}, []
    for message in messages:
        text, ended = message.text, len(message.text) < 50  # the codec cuts it at a NUL
        if message.id == 0:
            whole.append(text)
            continue
        chunks = parts.setdefault(message.id, {})
        chunks[message.chunk_seq] = text
        if ended:
            chunks["last"] = message.chunk_seq
        if "last" in chunks and len(chunks) == chunks["last"] + 2:
            del chunks["last"], parts[message.id]
            whole.append("".join(chunks[k] for k in sorted(chunks)))
    assert not parts, "a text that never ends"
    return whole


@pytest.mark.parametrize("length", [1, 49, 50, 51, 99, 100, 101, 150, 250, 400])
def test_texts_arrive_whole(length):
    """STATUSTEXT: "any null character in the text field" means that "this was the last chunk"."""
    text = "".join(chr(97 + k % 26) for k in range(length))
    mav = dialect().MAVLink(None, 1, 1)
    sent = [mav.decode(bytearray(m.pack(mav))) for m in status_texts(4, text, 7)]
    assert joined(sent) == [text]
    assert all(message.id == (7 if length > 50 else 0) for message in sent)


def test_texts_that_follow_each_other_have_ids_of_their_own(ground):
    station, _ = ground
    for text in ("ab" * 40, "ba" * 40, "ba" * 40):
        autopilot_of(station).context.report(6, text)
    station.seconds(0.05)
    longs = station.of("STATUSTEXT")
    assert len({m.id for m in longs if m.id}) == 3
    assert joined(longs)[-3:] == ["ab" * 40, "ba" * 40, "ba" * 40]


def autopilot_of(station):
    return station.simulation.vehicles.nodes[0].core


# --------------------------------------------------------------------------------------- setpoints


def enter(station):
    station.stream(0.3, station.send_position, 0.0, 0.0, -4.0)
    assert station.mode(6) == ACCEPTED


def aim(station, frame=1, mask=0, position=(0, 0, 0), velocity=(0, 0, 0), push=(0, 0, 0), **turn):
    yaw, rate = turn.get("yaw", 0.0), turn.get("rate", 0.0)
    fields = (0, 1, 1, frame, mask, *position, *velocity, *push, yaw, rate)
    station.send("set_position_target_local_ned", *fields)


@pytest.mark.parametrize(
    ("mask", "position", "velocity"),
    [
        (0b0000111111000111, (0, 0, 0), (1, 0, 0)),  # the masks of DroneKit's examples: bit 9 set,
        (0b0000111111111000, (8, 0, -4), (0, 0, 0)),  # without an acceleration to be a force
    ],
)
def test_the_force_bit_without_an_acceleration_says_nothing(air, mask, position, velocity):
    """PX4 refuses forces only where an acceleration is finite."""
    station, uav = air
    enter(station)
    station.stream(1.5, aim, station, 1, mask, position, velocity)
    assert uav.velocity_map[1] > 0.7
    assert station.present_mode == (6, 0)


@pytest.mark.parametrize(
    ("frame", "mask", "why"),
    [
        (7, 2552, "coordinate frame 7 unsupported"),
        (9, 1479, "coordinate frame 9 unsupported"),
        (1, 512, "force not supported"),
        (1, 4095 & ~512, "invalid"),
        (8, 2552, "invalid"),  # a position in a body frame
        (8, 1479 | 32, "invalid"),  # two of three velocities in a body frame
    ],
)
def test_refused_setpoints_name_their_reason_once_a_second(air, frame, mask, why):
    station, _ = air
    station.stream(1.5, aim, station, frame, mask, (1, 1, -4), (1, 1, 0), (1, 1, 0))
    texts = [text for text in station.texts if why in text]
    assert len(texts) == 2
    assert texts[0].startswith("SET_POSITION_TARGET_LOCAL_NED")
    assert station.mode(6) == REJECTED


def test_body_frames_ignore_positions_and_keep_yaw_from_north(air):
    """PX4: no position in BODY_NED; the yaw is that of every frame."""
    station, uav = air
    enter(station)
    mask = 0b0000100111000000  # position, velocity and yaw
    station.stream(3.0, aim, station, 8, mask, (0, 0, 0), (0, 0, 0), yaw=math.radians(180.0))
    assert is_heading(heading_of(uav), 180.0)
    station.stream(2.0, aim, station, 8, mask, (9, 9, 9), (1, 0, 0), yaw=math.radians(180.0))
    assert uav.velocity_map == pytest.approx([0.0, -1.0, 0.0], abs=0.2)


def test_a_position_on_earth_counts_with_all_its_components_only(air):
    """PX4: SET_POSITION_TARGET_GLOBAL_INT without one of x, y, z has no position."""
    station, uav = air
    enter(station)
    x, y = (round(part * 1e7) for part in degrees(30.0, 0.0))
    for _ in range(30):
        mask = 0b0000110111000100
        station.send(
            "set_position_target_global_int",
            *(0, 1, 1, 6, mask, x, y, 4.0, 0.0, 1.0, 0.0, 0, 0, 0, 0.0, 0.0),
        )
        station.seconds(0.05)
    assert uav.velocity_map[:2] == pytest.approx([1.0, 0.0], abs=0.2)
    for frame, why in ((11, "invalid coordinate frame 11"), (1, "invalid coordinate frame 1")):
        station.send(
            "set_position_target_global_int",
            *(0, 1, 1, frame, 2552, x, y, 4.0, 0, 0, 0, 0, 0, 0, 0.0, 0.0),
        )
        assert any(why in text for text in station.texts)


@pytest.mark.parametrize(
    ("mask", "rates", "thrust", "why"),
    [
        (7, (0.0, 0.0, 0.0), 1.5, "thrust from 0 to 1"),
        (7 | 64, (0.0, 0.0, 0.0), 0.5, "thrust from 0 to 1"),
        (7 | 32, (0.0, 0.0, 0.0), 0.5, "thrust_body not supported"),
        (3, (0.0, 0.0, 0.5), 0.5, "yaw rate with an attitude"),
        (128 | 1, (0.0, 0.0, 0.0), 0.5, "roll and pitch rates"),
        (128, (0.0, NAN, 0.0), 0.5, "out of range"),
    ],
)
def test_refused_attitudes_name_their_reason(ground, mask, rates, thrust, why):
    station, _ = ground
    station.send("set_attitude_target", 0, 1, 1, mask, (1, 0, 0, 0), *rates, thrust)
    texts = [text for text in station.texts if why in text]
    assert texts
    assert texts[0].startswith("SET_ATTITUDE_TARGET")


def test_rates_without_a_yaw_rate_keep_the_present_one(air):
    """PX4's rate controller holds the present rate of an axis whose setpoint is nan."""
    station, uav = air
    enter(station)
    for _ in range(25):
        station.send("set_attitude_target", 0, 1, 1, 128, (1, 0, 0, 0), 0.0, 0.0, 0.8, 0.536)
        station.seconds(0.02)
    turning = uav.omega_body[2]
    assert turning < -0.5  # to the right
    for _ in range(10):
        station.send("set_attitude_target", 0, 1, 1, 128 | 4, (1, 0, 0, 0), 0.3, 0.0, 9.0, 0.536)
        station.seconds(0.02)
    assert uav.omega_body[0] == pytest.approx(0.3, abs=0.1)
    assert uav.omega_body[2] == pytest.approx(turning, abs=0.15)


# ---------------------------------------------------------------------------------------- commands


def test_results_of_commands_on_the_ground(ground):
    """By MAVLink's definitions of the parameters, and PX4's Commander and Navigator."""
    station, _ = ground
    for number, params, result in (
        (400, (0.5e9,), DENIED),
        (185, (0.0,), DENIED),
        (185, (1.0,), DENIED),  # not armed
        (246, (0.0,), ACCEPTED),  # do nothing
        (246, (1.0,), UNSUPPORTED),
        (193, (2.0,), DENIED),  # "values not equal to 0 or 1 are invalid"
        (193, (), DENIED),
        (178, (2.0, 3.0), DENIED),  # climb speed
        (178, (1.0, 4.0, -1.0), ACCEPTED),
        (178, (1.0, 0.0, 50.0), DENIED),  # throttle
        (178, (1.0, -2.0, -1.0), ACCEPTED),
        (224, (3.0,), FAILED),  # "if the sequence number is out of range"
        (224, (0.0, 2.0), DENIED),
        (224, (-2.0,), DENIED),
        (22, (0, 0, 0, 0, 0.0, 0.0, 500.0), DENIED),  # at 0, 0
        (176, (1.0, 3.0, 2.0), UNSUPPORTED),  # PX4's slow position mode
        (176, (1.0, 4.0, 77.0), UNSUPPORTED),
        (176, (16.0,), UNSUPPORTED),  # stabilized
        (512, (242.0, 0, 0, 0, 0, 0, 3.0), DENIED),
        (512, (242.0, 0, 0, 0, 0, 0, 2.0), ACCEPTED),
    ):
        assert station.command(number, *params) == result, (number, params)
    assert any("Unsupported ARM_DISARM param" in text for text in station.texts)


def test_modes_without_a_custom_mode(ground):
    """PX4: flag 4 selects the mission, 64 and 8 position mode; auto without sub mode a mission."""
    station, _ = ground
    for params, mode in (
        ((4.0,), (4, 4)),
        ((64.0 + 8.0,), (3, 0)),
        ((1.0, 4.0, 0.0), (4, 4)),
        ((1.0, 4.0, 3.0), (4, 3)),
    ):
        assert station.command(176, *params) == ACCEPTED
        assert station.present_mode == mode


def test_standard_modes_that_are_offered_can_be_set(air):
    """AVAILABLE_MODES names them, MAV_CMD_DO_SET_STANDARD_MODE (262) selects them."""
    station, _ = air
    assert station.command(262, 5.0) == ACCEPTED  # safe recovery
    assert station.present_mode == (4, 5)
    assert station.command(262, 7.0) == ACCEPTED
    assert station.present_mode == (4, 6)
    assert station.command(262, 1.0) == REJECTED  # without sticks
    for unknown in (0.0, 3.0, 99.0, NAN):
        assert station.command(262, unknown) == FAILED
    assert any("standard mode is not offered" in text for text in station.texts)


def whole(station, number, params, x, y, z, frame):
    """Result of a COMMAND_INT."""
    before = len(station.of("COMMAND_ACK"))
    station.send("command_int", 1, 1, frame, number, 0, 0, *params, x, y, z)
    acks = station.of("COMMAND_ACK")[before:]
    assert [ack.command for ack in acks] == [number]
    return acks[0].result


def test_positions_of_commands_have_known_frames_and_markers_of_their_message(air):
    station, uav = air
    unset, nothing = 2**31 - 1, (-1.0, 1.0, 0.0, NAN)
    x, y = (round(part * 1e7) for part in degrees(0.0, 0.0))
    for frame in (1, 7, 8, 10, 11):
        assert whole(station, 192, nothing, x, y, 5.0, frame) == BAD_FRAME
    assert any("frame 11 is not supported" in text for text in station.texts)
    # the bits of a nan in an integer, and INT32_MAX in a float
    assert whole(station, 192, nothing, 0x7FF80000, 0x7FF80000, 5.0, 6) == DENIED
    assert "x and y are nan, not INT32_MAX" in station.texts[-1]
    assert station.command(192, *nothing, float(unset), float(unset), 500.0) == DENIED
    assert "param5 and param6 are INT32_MAX, not nan" in station.texts[-1]
    here = uav.position_map[:2].copy()
    assert whole(station, 192, nothing, unset, unset, 7.0, 6) == ACCEPTED
    station.seconds(5.0)
    assert uav.position_map == pytest.approx([*here, 7.0], abs=0.5)
    assert whole(station, 192, (-1.0, 1.0 + 2.0, 0.0, 0.5), x, y, 5.0, 6) == UNSUPPORTED
    assert station.command(34, 5.0, 1.0, 0.0, 6.28) == DENIED  # a number of turns
    assert station.command(34, 5.0, 1.0, 9.0, 0.0) == DENIED  # no such behaviour
    assert station.command(34, 5.0, 1.0, 0.0, 0.0) == ACCEPTED


def test_a_take_off_ends_at_its_position(ground):
    """MAV_CMD_NAV_TAKEOFF: latitude, longitude; PX4's Navigator flies there."""
    station, uav = ground
    assert station.command(400, 1.0) == ACCEPTED
    altitude = 488.0 + 4.0
    result = whole(
        station, 22, (NAN,) * 4, *(round(part * 1e7) for part in degrees(8.0, 0.0)), altitude, 5
    )
    assert result == ACCEPTED
    station.seconds(3.0)
    assert uav.position_map[1] < 1.0  # it climbs first
    station.seconds(8.0)
    assert uav.position_map == pytest.approx([0.0, 8.0, 4.0], abs=0.5)
    assert station.present_mode == (4, 3)


def test_home_keeps_its_yaw(air):
    """MAV_CMD_DO_SET_HOME: param4, "yaw angle. NaN to use default heading"."""
    station, uav = air
    assert station.command(179, 0.0, NAN, NAN, 90.0 + 120.0, *HERE, 488.0) == ACCEPTED
    w, x, y, z = station.last("HOME_POSITION").q
    assert is_heading(math.degrees(2.0 * math.atan2(z, w)), 210.0, 0.01)
    assert (x, y) == (0.0, 0.0)
    assert station.set("RTL_DESCEND_ALT", 2.0) == 2.0
    assert station.set("RTL_LAND_DELAY", -1.0) == -1.0
    assert station.command(20) == ACCEPTED
    station.seconds(12.0)
    assert is_heading(heading_of(uav), 210.0)


def test_messages_that_a_px4_obeys_and_this_one_does_not_are_named_once(ground):
    station, _ = ground
    for _ in range(5):
        station.send("rc_channels_override", 1, 1, *(1500,) * 8)
    texts = [text for text in station.texts if "RC_CHANNELS_OVERRIDE" in text]
    assert texts == ["RC_CHANNELS_OVERRIDE is not supported and ignored"]


def test_commands_plans_and_parameters_name_their_vehicle(ground):
    """PX4 executes no command for system 0 but 519 and 520, and no plan or parameter."""
    station, _ = ground
    station.send("command_long", 0, 1, 400, 0, 1.0, *(NAN,) * 6)
    station.send("mission_count", 0, 1, 0, 0)
    station.send("param_request_read", 0, 1, b"MAV_SYS_ID", -1)
    assert not station.of("COMMAND_ACK") + station.of("MISSION_ACK") + station.of("PARAM_VALUE")
    assert "COMMAND_LONG to system 0 ignored: this one is 1" in station.texts
    station.send("command_long", 0, 77, 520, 0, 1.0, *(NAN,) * 6)
    assert station.last("COMMAND_ACK").result == ACCEPTED
    station.send("mission_count", 1, 190, 0, 0)
    assert station.last("MISSION_ACK").type == 0


# ---------------------------------------------------------------------------------------- missions

TAKE_OFF, WAYPOINT, LAND, YAW, JUMP, SPEED = 22, 16, 21, 115, 177, 178


def at(north, east, up, command=WAYPOINT, params=(0.0, 0.0, 0.0, NAN), frame=6):
    return command, frame, params, *degrees(north, east), up


def do(command, *params):
    return command, 2, (*params, *(0.0,) * (4 - len(params))), 0.0, 0.0, 0.0


def send_plan(station, items, current=-1, stays=()):
    """Uploads a mission whose item `current` is marked, and in which those of `stays` stay."""
    before = len(station.of("MISSION_ACK"))
    station.send("mission_count", 1, 1, len(items), 0)
    for sequence, (command, frame, params, x, y, z) in enumerate(items):
        fields = (frame, command, int(sequence == current), int(sequence not in stays), *params)
        position = [part if isinstance(part, int) else round(part * 1e7) for part in (x, y)]
        station.send("mission_item_int", 1, 1, sequence, *fields, *position, z, 0)
        if len(station.of("MISSION_ACK")) > before:
            break
    return station.last("MISSION_ACK").type


def test_the_item_marked_as_current_is_the_first_one(air):
    """MISSION_ITEM_INT: `current`; PX4 starts at the item so marked."""
    station, uav = air
    assert send_plan(station, [at(0.0, 9.0, 4.0), at(6.0, 0.0, 4.0)], current=1) == 0
    assert station.mode(4, 4) == ACCEPTED
    station.seconds(6.0)
    assert uav.position_map[:2] == pytest.approx([0.0, 6.0], abs=0.6)


def test_a_mission_stays_at_an_item_that_does_not_continue(air):
    """MISSION_ITEM_INT: `autocontinue`; PX4 goes on only with another item chosen."""
    station, uav = air
    plan = [at(4.0, 0.0, 4.0), at(4.0, 8.0, 4.0)]
    assert send_plan(station, plan, stays=(0,)) == 0
    assert station.mode(4, 4) == ACCEPTED
    station.seconds(9.0)
    assert uav.position_map[:2] == pytest.approx([0.0, 4.0], abs=0.5)
    assert [m.seq for m in station.of("MISSION_ITEM_REACHED")] == [0]
    assert station.present_mode == (4, 4)
    station.send("mission_set_current", 1, 1, 1)
    assert station.last("MISSION_CURRENT").seq == 1
    station.seconds(6.0)
    assert uav.position_map[:2] == pytest.approx([8.0, 4.0], abs=0.5)
    station.send("mission_set_current", 1, 1, 9)
    assert "WPM: WP CURR CMD: Not in list" in station.texts


def test_jumps_are_counted_on_unless_the_mission_is_reset(ground):
    """DO_SET_MISSION_CURRENT: "jump repeat counters are not reset unless param2 is set"."""
    station, _ = ground
    plan = [at(1.0, 0.0, 3.0, TAKE_OFF), do(93, 0.1), do(JUMP, 1.0, 3.0), at(0.0, 0.0, 3.0)]
    assert send_plan(station, plan) == 0
    mission = autopilot_of(station).context.memory.mission
    mission.jumps_left[2] = 1
    assert station.command(224, 1.0, 0.0) == ACCEPTED
    assert autopilot_of(station).context.memory.mission.jumps_left == {2: 1}
    assert station.command(224, -1.0, 1.0) == ACCEPTED
    assert autopilot_of(station).context.memory.mission.jumps_left == {}
    assert station.last("MISSION_CURRENT").seq == 1


def test_a_take_off_and_a_landing_of_a_mission_have_position_and_heading(ground):
    """MAV_CMD_NAV_TAKEOFF: position; MAV_CMD_NAV_LAND: "desired yaw angle"."""
    station, uav = ground
    land = at(6.0, 5.0, 0.0, LAND, (0.0, 0.0, 0.0, 180.0))
    assert send_plan(station, [at(6.0, 0.0, 3.0, TAKE_OFF), land]) == 0
    assert station.command(300, 0.0, 0.0) == ACCEPTED
    for _ in range(60):
        station.seconds(0.25)
        if station.of("MISSION_ITEM_REACHED"):
            break
    assert uav.position_map[:2] == pytest.approx([0.0, 6.0], abs=2.0)
    station.seconds(12.0)
    assert uav.position_map[:2] == pytest.approx([5.0, 6.0], abs=0.6)
    assert is_heading(heading_of(uav), 180.0)


def test_a_speed_of_a_mission_returns_to_the_default(air):
    """DO_CHANGE_SPEED: PX4 resets the speed without a positive one; speeds of climb are refused."""
    station, uav = air
    assert send_plan(station, [do(SPEED, 2.0, 1.0), at(4.0, 0.0, 4.0)]) == 6  # invalid param1
    far = at(90.0, 0.0, 4.0)
    for reset, speed in (((), 2.0), ((do(SPEED, 1.0, -1.0),), 5.0), ((do(SPEED, 1.0, -2.0),), 5.0)):
        assert send_plan(station, [do(SPEED, 1.0, 2.0), *reset, far]) == 0
        assert station.mode(4, 4) == ACCEPTED
        station.seconds(3.5)
        assert np.hypot(*uav.velocity_map[:2]) == pytest.approx(speed, abs=0.3)


def test_turns_keep_rate_and_direction(air):
    """MAV_CMD_CONDITION_YAW: angular speed, direction, relative or from north."""
    station, uav = air
    assert is_heading(heading_of(uav), 90.0)
    # from east, counter-clockwise to south: 270 deg at 30 deg/s
    assert send_plan(station, [do(YAW, 180.0, 30.0, -1.0, 0.0)]) == 0
    assert station.mode(4, 4) == ACCEPTED
    headings = []
    for _ in range(24):
        station.seconds(0.5)
        headings.append(heading_of(uav))
    assert is_heading(headings[5], 0.0, 15.0)  # after 3 s
    assert is_heading(headings[-1], 180.0)
    assert [m.seq for m in station.of("MISSION_ITEM_REACHED")] == [0]
    for turn in ((NAN, 0, 0, 0), (9, -1, 0, 0), (9, 0, 2, 0), (9, 0, 0, 3)):
        assert send_plan(station, [do(YAW, *map(float, turn))]) in (6, 7, 8, 9)


def test_positions_of_missions_may_be_missing_and_have_frames_of_px4(ground):
    """INT32_MAX is no latitude; PX4 knows no terrain frames: MAV_MISSION_UNSUPPORTED_FRAME."""
    station, _ = ground
    unset = 2**31 - 1
    take_off = (TAKE_OFF, 6, (0.0, 0.0, 0.0, NAN), unset, unset, 3.0)
    assert send_plan(station, [take_off]) == 0
    for frame in (1, 8, 10, 11):
        assert send_plan(station, [at(0.0, 0.0, 3.0, TAKE_OFF, frame=frame)]) == 2


def test_a_second_link_receives_what_is_sent_to_everyone(ground):
    """MAV_CMD_REQUEST_MESSAGE: param7, 2: broadcast."""
    station, _ = ground
    other = Station(station.simulation, system=254, link=8)
    assert station.command(512, 148.0, 0, 0, 0, 0, 0, 0.0) == ACCEPTED
    assert not other.of("AUTOPILOT_VERSION")
    assert station.command(512, 148.0, 0, 0, 0, 0, 0, 2.0) == ACCEPTED
    assert other.of("AUTOPILOT_VERSION")
