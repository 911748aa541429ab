"""What comes over MAVLink: frames out of noise, and whole conversations with an autopilot."""

from __future__ import annotations

import math

from volery.mavlink.autopilot.core import Autopilot
from volery.mavlink.autopilot.vehicle import FlightState, VehicleInfo
from volery.mavlink.codec import Codec, Parser, dialect
from volery.mavlink.framing import Framer

_BUILD = VehicleInfo("iris", 4, 0.5, 12.0, 3.0, 1.5, 0.7, 4, 5.0, (47.4, 8.5, 488.0))
_NAN = math.nan
_HERE = (473977420, 85455940)


def _talk():
    make = dialect()
    long, item = make.MAVLink_command_long_message, make.MAVLink_mission_item_int_message
    local = make.MAVLink_set_position_target_local_ned_message
    messages = [
        make.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3),
        long(1, 1, 400, 0, 1.0, *(0.0,) * 6),
        long(1, 1, 22, 0, *(_NAN,) * 7),
        long(1, 1, 176, 0, 1.0, 6.0, *(0.0,) * 5),
        long(1, 1, 511, 0, 30.0, 10000.0, *(0.0,) * 5),
        long(1, 1, 512, 0, 148.0, *(0.0,) * 6),
        make.MAVLink_command_int_message(1, 1, 6, 192, 0, 0, -1.0, 1.0, 0.0, _NAN, *_HERE, 5.0),
        make.MAVLink_command_int_message(1, 1, 0, 179, 0, 0, *(0.0,) * 4, *_HERE, 490.0),
        long(1, 1, 300, 0, *(0.0,) * 7),
        make.MAVLink_set_mode_message(1, 1, 4 << 16 | 4 << 24),
        local(0, 1, 1, 1, 2552, 1.0, 2.0, -3.0, *(0.0,) * 8),
        local(0, 1, 1, 8, 1479, *(0.0,) * 3, 1.0, *(0.0,) * 7),
        make.MAVLink_set_attitude_target_message(0, 1, 1, 7, (1, 0, 0, 0), 0.0, 0.0, 0.0, 0.5),
        make.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0),
        make.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 3.0, 9),
        make.MAVLink_param_request_read_message(1, 1, b"RTL_RETURN_ALT", -1),
        make.MAVLink_param_request_list_message(1, 1),
        make.MAVLink_mission_count_message(1, 1, 2, 0),
        item(1, 1, 0, 6, 22, 0, 1, *(0.0,) * 4, *_HERE, 3.0, 0),
        item(1, 1, 1, 6, 16, 0, 1, *(0.0,) * 4, *_HERE, 3.0, 0),
        item(1, 1, 1, 6, 31, 0, 1, *(0.0,) * 4, *_HERE, 3.0, 0),
        item(1, 1, 1, 6, 195, 0, 1, *(0.0,) * 4, *_HERE, 3.0, 0),
        item(1, 1, 1, 2, 201, 0, 1, *(0.0,) * 4, 0, 0, 0.0, 0),
        long(1, 1, 510, 0, 30.0, *(0.0,) * 6),
        long(1, 1, 512, 0, 435.0, *(0.0,) * 6),
        make.MAVLink_file_transfer_protocol_message(0, 1, 1, bytes(251)),
        make.MAVLink_log_request_list_message(1, 1, 0, 65535),
        make.MAVLink_log_request_data_message(1, 1, 0, 90, 900),
        make.MAVLink_log_request_end_message(1, 1),
        make.MAVLink_log_erase_message(1, 1),
        make.MAVLink_mission_ack_message(1, 1, 15, 0),
        make.MAVLink_mission_request_int_message(1, 1, 0, 0),
        make.MAVLink_mission_clear_all_message(1, 1, 255),
        make.MAVLink_ping_message(1, 1, 0, 0),
        make.MAVLink_timesync_message(0, 5),
    ]
    codec = Codec(255, 190)
    return [codec.pack(message, k) for k, message in enumerate(messages)]


class _Vehicle:
    """Accepts every command whose numbers are finite."""

    def __getattr__(self, name):
        def obey(*commands):
            for part in commands:
                for number in part if isinstance(part, tuple) else (part,):
                    assert number is None or math.isfinite(number), (name, commands)
            return ""

        return obey


_TALK = _talk()
_STREAM = b"".join(_TALK)


def wire(mutator):
    """Frames come out whole and unchanged however the stream is cut, also behind noise."""
    framer, parser = Framer(), Parser()
    stream = mutator.bytes([_STREAM, *_TALK])
    frames = [frame for piece in mutator.cut(stream) for frame in framer.feed(piece)]
    for frame in frames:
        assert frame.data in stream
        parser.decode(frame.data)
    late = Framer()
    assert late.datagram(mutator.noise(200) + _TALK[0])[-1].data == _TALK[0]
    return 1


def autopilot(mutator):
    """An autopilot accepts any message, and never commands a number that is not finite."""
    autopilot = Autopilot(1, _Vehicle(), _BUILD)
    modes = ("LANDED", "TAKE_OFF", "HOLD", "GO_TO", "VELOCITY", "LAND", "LOW_LEVEL", "CRASHED")
    height = 0.0
    for tick in range(12):
        time_ns = tick * 10_000_000 * mutator.pick((1, 5, 100))
        mode = mutator.pick(modes[:7]) if tick else "LANDED"
        height = max(0.0, height + mutator.pick((-0.5, 0.0, 1.0)))
        motion = ((0.0, 0.0, 0.0),) * 3
        autopilot.update(
            FlightState(
                time_ns,
                mode,
                height > 0.0,
                False,
                (0.0, 0.0, height),
                (0.0, 0.0, 0.0, 1.0),
                *motion,
                mutator.pick((1.0, 0.1, math.nan)),
                11.0,
                5.0,
                (0.5,) * 4,
            )
        )
        data = mutator.pick(_TALK) if mutator.chance(0.4) else _with_check(mutator)
        autopilot.receive(mutator.pick((0, 1)), mutator.pick((0, 1, 2, 9)), data, time_ns)
    framer = Framer()
    for _, sent in autopilot.take_sent():
        assert [frame.data for frame in framer.datagram(sent)] == [sent]
    return 12


def _with_check(mutator):
    """A frame whose payload was changed and whose checksum fits again."""
    from volery.mavlink.codec import check_of

    frame = bytearray(mutator.pick(_TALK))
    changed = mutator.bytes([bytes(frame[10:-2])])[:255] or b"\0"
    number = int.from_bytes(frame[7:10], "little")
    frame[1] = len(changed)
    body = bytes(frame[:10]) + changed
    extra = dialect().mavlink_map[number].crc_extra
    return body + check_of(body[1:] + bytes((extra,))).to_bytes(2, "little")
