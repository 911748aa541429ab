"""Logs whose commands refer to messages that the file does not describe."""

from __future__ import annotations

import json
import struct
from contextlib import closing

import pytest

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.recorded_flight import ORIGIN_TOPIC, read_flight
from volery.graph import command_records
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Published, String

RECORD = "volery_interfaces/msg/CommandRecord"
STRING = "std_msgs/msg/String"
ORIGIN = {"name": "hover", "seed": 1, "version": "0.1.0", "folder": None, "content": {}}
MARK = "content of the command"
UNKNOWN = 130


def damaged_log(path):
    """A log in which a command's content belongs to a channel that nothing describes."""
    command = zero_message(RECORD)
    command.kind, command.name, command.type, command.follows = "publish", "/x", STRING, True
    with closing(create_log(path, compression="none")) as log:
        log.write(Published(ORIGIN_TOPIC, STRING, 0, String(json.dumps(ORIGIN))))
        log.write(Published(command_records.TOPIC, RECORD, 0, command))
        log.write(Published("/x", STRING, 0, String(MARK)))
    data = bytearray(path.read_bytes())
    at = data.index(MARK.encode())
    if path.suffix == ".bag":
        channel = data.rindex(b"conn=", 0, at) + len(b"conn=")
    else:  # before CDR's 8 bytes: channel, sequence and two times
        channel = at - 8 - 22
        begin = 8 + 9 + struct.unpack_from("<Q", data, 9)[0] + 9  # of the chunk, behind the header
        data[begin + 24 : begin + 28] = bytes(4)  # no checksum
    data[channel] = UNKNOWN
    path.write_bytes(data)


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_a_command_without_its_content_is_read(tmp_path, suffix):
    path = tmp_path / f"damaged{suffix}"
    damaged_log(path)
    (command,) = read_flight(path).commands
    assert (command.taken.name, command.taken.content) == ("/x", None)
