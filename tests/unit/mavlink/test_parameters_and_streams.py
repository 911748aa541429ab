"""Parameters as PX4 carries them, streams and their rates, what is sent on request."""

import importlib.metadata
import math
import re
import struct
from collections import Counter

import pytest
from flying_bench import NAN, PACKETS, Station, fly

from volery.mavlink.autopilot.messages.streams import RATES_HZ
from volery.mavlink.autopilot.parameters import DEFAULTS, NAMES
from volery.mavlink.codec import Codec, dialect
from volery.mavlink.framing import lengths_of

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4


@pytest.fixture(scope="module")
def station():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        yield station


def test_the_whole_list_comes_and_single_ones(station):
    station.send("param_request_list", 1, 1)
    station.seconds(1.0)
    values = {m.param_id: m for m in station.of("PARAM_VALUE")}
    assert station.of("PARAM_VALUE")[0] is values.pop("_HASH_CHECK")
    assert set(values) == set(NAMES)
    assert {m.param_count for m in values.values()} == {len(NAMES)}
    assert sorted(m.param_index for m in values.values()) == list(range(len(NAMES)))
    station.received.clear()
    station.send("param_request_read", 1, 1, b"COM_DL_LOSS_T", -1)
    whole = station.last("PARAM_VALUE")
    assert whole.param_type == 6
    assert int.from_bytes(whole.get_msgbuf()[10:14], "little") == 10
    station.send("param_request_read", 1, 1, b"", NAMES.index("RTL_RETURN_ALT"))
    assert station.last("PARAM_VALUE").param_value == 60.0
    count = len(station.of("PARAM_VALUE"))
    station.send("param_request_read", 1, 1, b"NO_SUCH", -1)
    station.send("param_request_read", 1, 1, b"", 9999)
    assert len(station.of("PARAM_VALUE")) == count
    faults = [(m.param_id, m.param_index, m.error) for m in station.of("PARAM_ERROR")]
    assert faults == [("NO_SUCH", -1, 1), ("", 9999, 1)]


def crc32(data):
    """Bit by bit, beginning with 0, nothing inverted: as PX4's `crc32part`."""
    remainder = 0
    for byte in data:
        remainder ^= byte
        for _ in range(8):
            remainder = remainder >> 1 ^ (0xEDB88320 if remainder & 1 else 0)
    return remainder


def test_the_check_of_all_parameters_is_px4s_and_ends_a_list(station):
    station.received.clear()
    station.send("param_request_read", 1, 1, b"_HASH_CHECK", -1)
    station.send("param_request_list", 1, 1)
    station.seconds(0.5)
    first, *others = station.of("PARAM_VALUE")
    assert (first.param_type, first.param_index, first.param_count) == (5, 65535, len(NAMES))
    values = {m.param_id: bytes(m.get_msgbuf()[10:14]) for m in others if m.param_type != 5}
    whole = b"".join(name.encode() + values[name] for name in NAMES)
    assert int.from_bytes(first.get_msgbuf()[10:14], "little") == crc32(whole)
    station.received.clear()
    station.send("param_request_list", 1, 1)
    station.send("param_set", 1, 1, b"_HASH_CHECK", first.param_value, 5)
    station.seconds(0.5)
    assert [m.param_id for m in station.of("PARAM_VALUE")] == ["_HASH_CHECK"]
    assert station.last("PARAM_ERROR").error == 5  # it cannot be set


def files(station, opcode, size=0, sequence=9, path=b""):
    """Opcode, size, opcode answered and first byte of the response to a request of MAVLink FTP."""
    head = struct.pack("<HBBBBBBI", sequence, 3, opcode, size, 0, 0, 0, 77)
    station.send("file_transfer_protocol", 0, 1, 1, (head + path).ljust(251, b"\0"))
    response = station.last("FILE_TRANSFER_PROTOCOL")
    number, session, *rest, _, _, offset = struct.unpack_from("<HBBBBBBI", bytes(response.payload))
    assert (number, session, offset) == (sequence + 1 & 0xFFFF, 3, 77)
    assert (response.target_system, response.target_component) == (255, 190)
    return (*rest, response.payload[12])


def test_file_requests_are_answered_that_there_are_none(station):
    path = b"/etc/extras/component_general.json.xz"
    assert files(station, 4, len(path), path=path) == (129, 1, 4, 10)
    assert files(station, 3, 1, 65535, b"/") == (129, 1, 3, 10)
    assert files(station, 5, 239) == (129, 1, 5, 4)  # no such session
    assert files(station, 6, 1, path=b"a") == (129, 1, 6, 1)
    assert files(station, 4, 240) == (129, 1, 4, 3)
    assert files(station, 99) == (129, 1, 99, 7)
    assert files(station, 2) == (128, 0, 2, 0)


def test_setting_checks_type_and_range(station):
    station.received.clear()
    assert station.set("MIS_TAKEOFF_ALT", 7.5) == 7.5
    assert station.set("MIS_TAKEOFF_ALT", 500.0) == 7.5
    assert station.set("MIS_TAKEOFF_ALT", NAN) == 7.5
    assert station.set("MIS_TAKEOFF_ALT", 3) == 7.5  # an int for a float
    assert station.set("NAV_DLL_ACT", 2) == 2
    assert station.set("NAV_DLL_ACT", 9) == 2
    assert station.set("MAV_SYS_ID", 7) == 1  # fixed
    assert station.set("NO_SUCH", 1.0) is None
    assert "unknown param: NO_SUCH" in station.texts
    assert station.set("NAV_DLL_ACT", 0) == 0
    faults = [message.error for message in station.of("PARAM_ERROR")]
    assert faults == [2, 2, 7, 2, 5, 1]


def test_every_default_is_allowed():
    for name, parameter in DEFAULTS.items():
        assert parameter.low <= parameter.default <= parameter.high, name
        assert len(name) <= 16


@pytest.mark.parametrize("profile", [1, 2])
def test_streams_come_at_their_rates(profile):
    simulation, station = fly(sensors=())
    with simulation:
        station = Station(simulation, link=11, profile=profile)
        station.seconds(1.0)
        station.received.clear()
        station.seconds(10.0)
        counts = Counter(message.get_msgId() for message in station.received)
        silent = {29, 83, 85, 360}  # no barometer; no targets, no orbit; the battery is ideal
        if 147 not in counts:
            silent |= {147}
        assert 436 in RATES_HZ[profile]  # not of pymavlink's, so it is not decoded
        for number, rate in RATES_HZ[profile].items():
            if number == 436:
                continue
            wanted = 0 if number in silent else 10.0 * rate
            assert counts[number] == pytest.approx(wanted, abs=1.0), number


def test_rates_are_those_of_px4():
    """Of v1.18: `onboard` and `normal` in mavlink_main.cpp."""
    onboard, normal = RATES_HZ[1], RATES_HZ[2]
    assert (onboard[30], onboard[31], onboard[331], onboard[111]) == (100.0, 50.0, 30.0, 10.0)
    assert (normal[30], normal[31], normal[24], normal[32]) == (15.0, 10.0, 5.0, 1.0)
    assert not {2, 105, 111, 331} & set(normal)  # SYSTEM_TIME and the like are onboard's


def test_intervals_are_set_reported_and_reset(station):
    assert station.command(511, 30.0, 50_000.0) == ACCEPTED
    station.received.clear()
    station.seconds(1.0)
    assert len(station.of("ATTITUDE")) == pytest.approx(20, abs=1)
    assert station.command(512, 244.0, 30.0) == ACCEPTED
    assert station.last("MESSAGE_INTERVAL").interval_us == 50_000
    assert station.command(511, 30.0, -1.0) == ACCEPTED
    station.received.clear()
    station.seconds(0.5)
    assert not station.of("ATTITUDE")
    assert station.command(510, 30.0) == ACCEPTED
    assert station.last("MESSAGE_INTERVAL").interval_us == -1
    for unknown in (510, 511, 512):
        station.received.clear()
        assert (
            station.command(unknown, 9999.0, 1000.0)
            == ({510: ACCEPTED, 511: FAILED, 512: DENIED}[unknown])
        )
        intervals = [(m.message_id, m.interval_us) for m in station.of("MESSAGE_INTERVAL")]
        assert intervals == ([(9999, -1)] if unknown == 510 else [])
    assert station.command(511, 0.0, 1000.0) == FAILED  # the heartbeat stays as it is
    assert station.command(511, 30.0, 1000.0, 0.0, 0.0, 0.0, 0.0, 2.0) == FAILED
    assert station.command(510, -3.0) == DENIED
    assert station.command(511, NAN, 1000.0) == DENIED
    assert station.command(511, 30.0, 0.0) == ACCEPTED  # this link begins without it


def test_what_is_sent_on_request(station):
    assert station.command(512, 148.0) == ACCEPTED
    version = station.last("AUTOPILOT_VERSION")
    assert version.capabilities & 4
    assert version.capabilities & 16384
    assert version.flight_sw_version.to_bytes(4) == bytes((1, 18, 0, 255))  # the PX4 it is like
    own = [int(part) for part in re.findall(r"\d+", importlib.metadata.version("volery"))[:3]]
    assert list(version.flight_custom_version) == [*reversed(own), 0, 0, 0, 0, 0]
    assert station.command(512, 242.0) == ACCEPTED
    home = station.last("HOME_POSITION")
    assert home.latitude == pytest.approx(473977420, abs=2)
    assert station.command(512, 241.0) == DENIED  # VIBRATION is not known
    assert station.command(9999, 0.0) == UNSUPPORTED
    station.send("ping", 5, 77, 0, 0)
    assert (station.last("PING").seq, station.last("PING").target_system) == (77, 255)
    station.send("timesync", 0, 123456)
    sync = station.last("TIMESYNC")
    assert sync.ts1 == 123456
    assert sync.tc1 == station.simulation.time_ns


def payloads(taken, number, layout):
    """What the frames of a message that pymavlink does not know hold; takes them out of `taken`."""
    found = []
    for message in taken:
        data, at = bytes(message.data), 0
        for length in lengths_of(data):
            frame, at = data[at : at + length], at + length
            if int.from_bytes(frame[7:10], "little") == number:
                found.append(
                    struct.unpack(layout, frame[10:-2].ljust(struct.calcsize(layout), b"\0"))
                )
    return found


def test_modes_and_versions_are_sent_in_messages_that_pymavlink_lacks(station):
    taken = []
    graph = station.simulation.graph
    graph.subscribe("/uav1/mavlink/out", lambda published: taken.append(published.message), PACKETS)
    assert station.command(512, 300.0) == ACCEPTED
    assert station.command(519, 1.0) == ACCEPTED
    assert station.command(512, 436.0) == ACCEPTED
    assert station.command(512, 435.0, 5.0) == ACCEPTED
    assert station.command(512, 435.0, 11.0) == DENIED
    assert payloads(taken, 300, "<HHH16s") == [(200, 100, 200, bytes(16))] * 2
    assert payloads(taken, 436, "<IIB") == [(50593792, 50593792, 0)]  # hold is no standard mode
    hold = (50593792, 1, 10, 5, 0, b"Hold".ljust(35, b"\0"))
    assert payloads(taken, 435, "<IIBBB35s") == [hold]
    assert station.command(512, 435.0, 0.0) == ACCEPTED
    modes = payloads(taken, 435, "<IIBBB35s")[1:]
    assert [mode[3] for mode in modes] == list(range(1, 11))
    assert {mode[4]: mode[0] >> 16 for mode in modes}[7] == 0x0604  # landing


def test_pressure_is_sent_where_there_is_a_barometer(station):
    assert station.command(512, 29.0) == DENIED
    simulation, other = fly(sensors=[{"kind": "barometer"}])
    with simulation:
        other.seconds(1.0)
        assert other.command(512, 29.0) == ACCEPTED
        message = other.last("SCALED_PRESSURE")
        assert message.press_abs == pytest.approx(956.0, abs=3.0)  # 488 m above the sea
        assert message.temperature != 0


def test_the_old_message_for_modes_is_answered(station):
    station.received.clear()
    station.send("set_mode", 1, 1, 4 << 16 | 3 << 24)
    responses = [(ack.command, ack.result) for ack in station.of("COMMAND_ACK")]
    assert responses == [(176, ACCEPTED)]


def test_odometry_is_sent_with_covariances_that_are_not_known(station):
    assert station.command(512, 331.0) == ACCEPTED
    odometry = station.last("ODOMETRY")
    assert (odometry.frame_id, odometry.child_frame_id) == (1, 1)
    assert odometry.q == pytest.approx([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)], abs=1e-4)
    assert math.isnan(odometry.pose_covariance[0])
    assert math.isnan(odometry.velocity_covariance[0])


def test_health_is_all_well_and_position_agrees_with_the_map(station):
    assert station.command(512, 1.0) == ACCEPTED
    status = station.last("SYS_STATUS")
    present = status.onboard_control_sensors_present
    assert present & status.onboard_control_sensors_health == present
    for number in (33, 32, 30, 31, 24, 245, 105):
        assert station.command(512, float(number)) == ACCEPTED
    position = station.last("GLOBAL_POSITION_INT")
    assert position.lat == pytest.approx(473977420, abs=2)
    assert position.hdg == pytest.approx(9000, abs=10)  # looks east
    assert station.last("ATTITUDE").yaw == pytest.approx(math.pi / 2, abs=1e-3)
    q = station.last("ATTITUDE_QUATERNION")
    assert (q.q1, q.q4) == pytest.approx((math.sqrt(0.5), math.sqrt(0.5)), abs=1e-3)
    assert station.last("HIGHRES_IMU").zacc == pytest.approx(-9.80665, abs=1e-3)
    assert station.last("LOCAL_POSITION_NED").z == pytest.approx(0.0, abs=0.01)
    assert station.last("EXTENDED_SYS_STATE").landed_state == 1


def test_frames_are_those_of_pymavlink():
    """The quick way to pack against the library's own, and back."""
    common = dialect()
    messages = [
        common.MAVLink_attitude_message(1, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0),
        common.MAVLink_heartbeat_message(2, 12, 29, 50593792, 3, 3),
        common.MAVLink_system_time_message(0, 0),
        common.MAVLink_statustext_message(6, b"words", 0, 0),
        common.MAVLink_extended_sys_state_message(0, 0),
        common.MAVLink_mission_current_message(0, 65535, 1, 2),
        common.MAVLink_highres_imu_message(1, *(0.5,) * 13, 63, 3),
        common.MAVLink_attitude_target_message(1, 7, [1.0, 0.0, 0.5, 0.0], 0.1, 0.2, 0.3, 0.6),
        common.MAVLink_battery_status_message(0, 1, 1, 0, [4000] * 10, 5, 6, 7, 80, 0, 1, [1] * 4),
    ]
    codec, theirs = Codec(7), common.MAVLink(None, 7, 1)
    for k, message in enumerate(messages):
        theirs.seq = k
        expected = bytes(message.pack(theirs))
        assert codec.pack(message, k) == expected
        assert codec.pack(message, k) == expected  # from what was kept for other links
