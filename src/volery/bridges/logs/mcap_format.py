"""Records of MCAP (mcap.dev/spec, version 0) from bytes. Damaged: `ValueError`."""

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
"""Opcode and length, in front of every record."""
DEFINITIONS = (Opcode.SCHEMA, Opcode.CHANNEL)
READ = (Opcode.CHUNK, Opcode.MESSAGE, *DEFINITIONS)
"""Records that hold messages, or tell what they are."""
_MESSAGE = struct.Struct("<HIQ")
"""Channel, sequence, log time; the publish time follows."""
_MESSAGE_BYTES = 22
_CHUNK = struct.Struct("<QQQIL")
"""Start, end, size uncompressed, CRC-32, length of the compression's name."""
_LENGTH = struct.Struct("<Q")


def unpack_chunk(chunk: memoryview) -> bytes:
    """The records in the body of a chunk."""
    if len(chunk) < _CHUNK.size:
        raise ValueError("the chunk's head is not whole")
    _, _, size, crc, name_bytes = _CHUNK.unpack_from(chunk)
    begin = _CHUNK.size + name_bytes
    if begin + _LENGTH.size > len(chunk):
        raise ValueError("the chunk's head is not whole")
    compression = bytes(chunk[_CHUNK.size : begin]).decode()
    (packed_bytes,) = _LENGTH.unpack_from(chunk, begin)
    data = unpack(compression, chunk[begin + _LENGTH.size :][:packed_bytes], size)
    if crc and zlib.crc32(data) != crc:
        raise ValueError("the chunk's checksum is another one")
    return data


def chunk_content(data: bytes, learn: Callable[[int, bytes], None]) -> Content:
    """The messages among records one behind the other; `learn` gets schemas and channels."""
    heads = []
    position, size = 0, len(data)
    while position < size:
        if position + HEAD.size > size:
            raise ValueError("a record is not whole")
        opcode, length = HEAD.unpack_from(data, position)
        body = position + HEAD.size
        position = body + length
        if position > size:
            raise ValueError("a record is not whole")
        if opcode == Opcode.MESSAGE:
            heads.append(message_head(data, body, position))
            if len(heads) > MAX_CHUNK_MESSAGES:
                raise ValueError(f"more than {MAX_CHUNK_MESSAGES} messages in one chunk")
        elif opcode in DEFINITIONS:
            learn(opcode, data[body:position])
    return Content(tuple(heads), data)


def message_head(data: bytes, begin: int, end: int) -> Head:
    """The message whose record stands from `begin` to `end`."""
    if end - begin < _MESSAGE_BYTES:
        raise ValueError("a message is not whole")
    channel, sequence, time_ns = _MESSAGE.unpack_from(data, begin)
    if time_ns > MAX_TIME_NS:
        raise ValueError(f"a message of {time_ns} ns, later than ROS can tell")
    return Head(channel, time_ns, begin + _MESSAGE_BYTES, end, sequence)


def definition(opcode: int, data: bytes) -> Schema | Channel:
    """The schema or channel in a record."""
    if len(data) > MAX_DEFINITION_BYTES:
        raise ValueError(
            f"a message definition of {len(data)} bytes; at most {MAX_DEFINITION_BYTES} are read"
        )
    stream = ReadDataStream(io.BytesIO(data))
    try:
        found: Schema | Channel
        found = Schema.read(stream) if opcode == Opcode.SCHEMA else Channel.read(stream)
    except Exception as error:  # whatever the reader makes of damaged bytes
        reason = str(error) or "it is not whole"
        raise ValueError(f"a schema or channel is damaged: {reason}") from None
    return found
