"""Maps received messages to their handlers; those of logs, files and simple messages are here."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.modes import follow_target, manual_control, offboard
from volery.mavlink.autopilot.protocols import (
    commands,
    mission_protocol,
    parameter_protocol,
    shell,
)
from volery.mavlink.autopilot.protocols.command_protocol import DENIED, Command, acknowledge
from volery.mavlink.autopilot.state import Source
from volery.mavlink.codec import dialect

_GROUND_STATION = 6
"""Value MAV_TYPE_GCS."""
_UNSET, _UNSET_AS_FLOAT, _NAN_AS_INTEGER = 2**31 - 1, 2.0**31, 0x7FF80000
"""INT32_MAX, also as a float, and the bits of a nan that PX4 recognizes in an integer."""

_FILE_HEADER = struct.Struct("<HBBBBBBI")
"""Sequence, session, opcode, size, answered opcode, end of a burst, padding, offset."""
_FILE_PAYLOAD = 251
_FILE_BYTES = _FILE_PAYLOAD - _FILE_HEADER.size
_ACK, _NAK = 128, 129
_FAIL, _INVALID_SIZE, _INVALID_SESSION, _UNKNOWN_COMMAND, _NOT_FOUND = 1, 3, 4, 7, 10
_FILE_FAULTS = {
    **dict.fromkeys((0, 2), 0),  # none, and terminate all sessions
    **dict.fromkeys((1, 5, 7, 15), _INVALID_SESSION),  # terminate, read, write, burst
    **dict.fromkeys((3, 4, 8, 10, 12, 13, 14, 16), _NOT_FOUND),  # operations on a path
    **dict.fromkeys((6, 9, 11), _FAIL),  # operations that create something
}
"""Error by opcode of FTP; 0: none."""


def _heartbeat(context: AutopilotContext, _source: Source, message: Any) -> None:
    if message.type == _GROUND_STATION:
        context.memory.ground_heartbeat_ns = context.memory.now_ns


def _ping(context: AutopilotContext, source: Source, message: Any) -> None:
    if message.target_system == 0 and message.target_component == 0:
        link, system, component = source
        response = dialect().MAVLink_ping_message(message.time_usec, message.seq, system, component)
        context.links.send(response, link)


def _time_sync(context: AutopilotContext, source: Source, message: Any) -> None:
    """Answers with the simulated time since the start."""
    if message.tc1 == 0:
        response = dialect().MAVLink_timesync_message(context.memory.now_ns, message.ts1)
        context.links.send(response, source[0])


def _deny(context: AutopilotContext, source: Source, message: Any, why: str) -> None:
    """Denies a command whose position has the other message's value for "unset", as PX4 does."""
    context.report(4, f"Command {message.command} denied: {why}")
    acknowledge(context.links, source, message.command, DENIED)


def _command_long(context: AutopilotContext, source: Source, message: Any) -> None:
    params = tuple(float(getattr(message, f"param{k}")) for k in range(1, 8))
    if params[4] == params[5] == _UNSET_AS_FLOAT:
        _deny(context, source, message, "param5 and param6 are INT32_MAX, not nan")
        return
    commands.take(context, source, Command(message.command, params, None))


def _command_int(context: AutopilotContext, source: Source, message: Any) -> None:
    if message.x == message.y == _NAN_AS_INTEGER:
        _deny(context, source, message, "x and y are nan, not INT32_MAX")
        return
    unset = message.x == message.y == _UNSET
    x, y = (math.nan if unset else part * 1e-7 for part in (message.x, message.y))
    params = (message.param1, message.param2, message.param3, message.param4, x, y, message.z)
    commands.take(context, source, Command(message.command, params, int(message.frame)))


def _set_mode(context: AutopilotContext, source: Source, message: Any) -> None:
    """Handles the old SET_MODE message: PX4 executes and acknowledges it as a command."""
    custom = message.custom_mode
    params = (float(message.base_mode), custom >> 16 & 255, custom >> 24 & 255, *(math.nan,) * 4)
    commands.take(context, source, Command(commands.DO_SET_MODE, params, None))


def _data_stream(context: AutopilotContext, source: Source, message: Any) -> None:
    """Ignores the old REQUEST_DATA_STREAM, which MAVProxy sends at its start, as PX4 does."""


def _answer_file_request(context: AutopilotContext, source: Source, message: Any) -> None:
    """Answers MAVLink FTP like a server without files, so that clients do not wait for a timeout.

    Header and answers follow `mavlink_ftp.cpp` of PX4 1.18.
    """
    payload = bytes(message.payload)
    sequence, session, opcode, size, _, _, _, offset = _FILE_HEADER.unpack_from(payload)
    fault = _INVALID_SIZE if size > _FILE_BYTES else _FILE_FAULTS.get(opcode, _UNKNOWN_COMMAND)
    kind, data = (_NAK, bytes((fault,))) if fault else (_ACK, b"")
    head = _FILE_HEADER.pack(sequence + 1 & 0xFFFF, session, kind, len(data), opcode, 0, 0, offset)
    link, system, component = source
    message_class = dialect().MAVLink_file_transfer_protocol_message
    context.links.send(
        message_class(0, system, component, (head + data).ljust(_FILE_PAYLOAD, b"\0")), link
    )


def _list_logs(context: AutopilotContext, source: Source, message: Any) -> None:
    """Handles LOG_REQUEST_LIST."""
    context.log.transfers.list_logs(source[0], message.start, message.end)


def _send_log_data(context: AutopilotContext, source: Source, message: Any) -> None:
    """Handles LOG_REQUEST_DATA; nothing is sent for a missing log, as in PX4."""
    parts = int(message.id), int(message.ofs), int(message.count)
    context.log.transfers.send_data(source[0], *parts)


def _erase_logs(context: AutopilotContext, _source: Source, _message: Any) -> None:
    """Handles LOG_ERASE: deletes all logs except for that of the current flight."""
    context.log.transfers.clear()
    context.log.storage.erase(keeps_newest=context.log.is_recording)


def _end_log_requests(context: AutopilotContext, source: Source, _message: Any) -> None:
    """Handles LOG_REQUEST_END."""
    context.log.transfers.forget(source[0])


def _refuse(context: AutopilotContext, _source: Source, message: Any) -> None:
    """Says once that a message which PX4 obeys is not."""
    kind = message.get_type()
    if kind not in context.memory.refused_messages:
        context.memory.refused_messages.add(kind)
        context.report(4, f"{kind} is not supported and ignored")


_REFUSED = (
    *("ATT_POS_MOCAP", "COMMAND_CANCEL", "DISTANCE_SENSOR"),
    *("GIMBAL_MANAGER_SET_ATTITUDE", "GIMBAL_MANAGER_SET_MANUAL_CONTROL", "HIL_GPS"),
    *("HIL_OPTICAL_FLOW", "HIL_SENSOR", "HIL_STATE_QUATERNION", "LANDING_TARGET"),
    *("OBSTACLE_DISTANCE", "ODOMETRY", "OPTICAL_FLOW_RAD", "PLAY_TUNE", "PLAY_TUNE_V2"),
    *("RC_CHANNELS_OVERRIDE", "SET_ACTUATOR_CONTROL_TARGET", "SET_GPS_GLOBAL_ORIGIN"),
    *("VISION_POSITION_ESTIMATE",),
)
"""Messages that act on a PX4, and for which there is nothing here."""

HANDLERS: dict[str, Callable[[AutopilotContext, Source, Any], None]] = {
    "HEARTBEAT": _heartbeat,
    "PING": _ping,
    "TIMESYNC": _time_sync,
    "COMMAND_LONG": _command_long,
    "COMMAND_INT": _command_int,
    "SET_MODE": _set_mode,
    "REQUEST_DATA_STREAM": _data_stream,
    "PARAM_REQUEST_LIST": parameter_protocol.send_list,
    "PARAM_REQUEST_READ": parameter_protocol.send_one,
    "PARAM_SET": parameter_protocol.set_one,
    "SET_POSITION_TARGET_LOCAL_NED": offboard.take_local,
    "SET_POSITION_TARGET_GLOBAL_INT": offboard.take_global,
    "SET_ATTITUDE_TARGET": offboard.take_attitude,
    "FOLLOW_TARGET": follow_target.take,
    "MANUAL_CONTROL": manual_control.take,
    "MISSION_COUNT": mission_protocol.begin_upload,
    "MISSION_ITEM_INT": mission_protocol.take_item,
    "MISSION_ITEM": mission_protocol.take_item,
    "MISSION_REQUEST_LIST": mission_protocol.begin_download,
    "MISSION_REQUEST_INT": mission_protocol.send_item,
    "MISSION_REQUEST": mission_protocol.send_item,
    "MISSION_ACK": mission_protocol.take_ack,
    "MISSION_CLEAR_ALL": mission_protocol.clear,
    "MISSION_SET_CURRENT": mission_protocol.set_current,
    "FILE_TRANSFER_PROTOCOL": _answer_file_request,
    "LOG_REQUEST_LIST": _list_logs,
    "LOG_REQUEST_DATA": _send_log_data,
    "LOG_REQUEST_END": _end_log_requests,
    "LOG_ERASE": _erase_logs,
    "SERIAL_CONTROL": shell.take,
    **dict.fromkeys(_REFUSED, _refuse),
}
