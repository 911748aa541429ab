"""Parses records of MCAP (mcap.dev/spec, version 0). Raises `ValueError` if damaged."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from volery.bridges.logs.budgets import MAX_CHUNK_MESSAGES, MAX_DEFINITION_BYTES, MAX_TIME_NS
from volery.bridges.logs.content import Content, Head
from volery.bridges.logs.unpacking import unpack

HEAD = struct.Struct("<BQ")
"""Opcode and length at the start of every record."""
DEFINITIONS = (Opcode.SCHEMA, Opcode.CHANNEL)
READ = (Opcode.CHUNK, Opcode.MESSAGE, *DEFINITIONS)
"""Records with messages or their definitions."""
_MESSAGE = struct.Struct("<HIQ")
"""Channel, sequence, log time; the publish time follows."""
_MESSAGE_BYTES = 22
_CHUNK = struct.Struct("<QQQIL")
"""Start, end, size uncompressed, CRC-32, length of the compression's name."""
_LENGTH = struct.Struct("<Q")


def unpack_chunk(chunk: memoryview) -> bytes:
    """Returns the records in the body of a chunk."""
    if len(chunk) < _CHUNK.size:
        raise ValueError("the chunk's head is incomplete")
    _, _, size, crc, name_bytes = _CHUNK.unpack_from(chunk)
    begin = _CHUNK.size + name_bytes
    if begin + _LENGTH.size > len(chunk):
        raise ValueError("the chunk's head is incomplete")
    compression = bytes(chunk[_CHUNK.size : begin]).decode()
    (packed_bytes,) = _LENGTH.unpack_from(chunk, begin)
    data = unpack(compression, chunk[begin + _LENGTH.size :][:packed_bytes], size)
    if crc and zlib.crc32(data) != crc:
        raise ValueError("the chunk's checksum does not match")
    return data


def chunk_content(data: bytes, learn: Callable[[int, bytes], None]) -> Content:
    """Returns the messages among consecutive records; calls `learn` for schemas and channels."""
    heads = []
    position, size = 0, len(data)
    while position < size:
        if position + HEAD.size > size:
            raise ValueError("a record is incomplete")
        opcode, length = HEAD.unpack_from(data, position)
        body = position + HEAD.size
        position = body + length
        if position > size:
            raise ValueError("a record is incomplete")
        if opcode == Opcode.MESSAGE:
            heads.append(message_head(data, body, position))
            if len(heads) > MAX_CHUNK_MESSAGES:
                raise ValueError(f"more than {MAX_CHUNK_MESSAGES} messages in one chunk")
        elif opcode in DEFINITIONS:
            learn(opcode, data[body:position])
    return Content(tuple(heads), data)


def message_head(data: bytes, begin: int, end: int) -> Head:
    """Returns the message whose record spans `begin` to `end`."""
    if end - begin < _MESSAGE_BYTES:
        raise ValueError("a message is incomplete")
    channel, sequence, time_ns = _MESSAGE.unpack_from(data, begin)
    if time_ns > MAX_TIME_NS:
        raise ValueError(f"a message of {time_ns} ns, later than ROS can represent")
    return Head(channel, time_ns, begin + _MESSAGE_BYTES, end, sequence)


def definition(opcode: int, data: bytes) -> Schema | Channel:
    """Returns the schema or channel in a record."""
    if len(data) > MAX_DEFINITION_BYTES:
        raise ValueError(
            f"a message definition of {len(data)} bytes; at most {MAX_DEFINITION_BYTES} are read"
        )
    stream = ReadDataStream(io.BytesIO(data))
    try:
        found: Schema | Channel
        found = Schema.read(stream) if opcode == Opcode.SCHEMA else Channel.read(stream)
    except Exception as error:  # any error of the reader on damaged bytes
        reason = str(error) or "it is incomplete"
        raise ValueError(f"a schema or channel is damaged: {reason}") from None
    return found
