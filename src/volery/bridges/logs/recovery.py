"""Copies a truncated log to a whole file with an index."""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from volery.bridges.logs.bag_writer import CHUNK_BYTES, bag_writer
from volery.bridges.logs.disk_file import DiskFile
from volery.bridges.logs.file_lock import locked_for_reading
from volery.bridges.logs.log_writer import LIBRARY
from volery.bridges.logs.records import LogRecord, LogTopic, LogWalk, log_format
from volery.core.errors import RecordingError
from volery.core.whole_files import new_partial, put_in_place


@dataclass(frozen=True)
class Recovery:
    """Result of a recovery."""

    path: Path
    messages: int
    end_ns: int
    problem: str
    """Problem of the original; empty if there was none."""


def recovered_name(path: Path) -> Path:
    """Returns the default output of `recover`: `flight.mcap` becomes `flight.recovered.mcap`."""
    return path.with_name(f"{path.stem}.recovered{path.suffix}")


def recover(path: str | Path, out: str | Path | None = None) -> Recovery:
    """Copies every readable message into a new log of the same format.

    Raises
    ------
    RecordingError
            The file is no log, holds no readable message or is being written, or the new one exists
            already or cannot be written; no partial file remains.

    """
    path = Path(path)
    kind = log_format(path)
    out = recovered_name(path) if out is None else Path(out)
    if out.exists():
        raise RecordingError(f"{out}: exists already; choose another name")
    with locked_for_reading(path):
        walk = LogWalk(path)
        records = iter(walk)
        first = next(records, None)
        if first is None:
            problem = f" ({walk.problem})" if walk.problem else ""
            raise RecordingError(f"{path}: holds no readable message{problem}; nothing is written")
        count, end_ns = _write(kind, itertools.chain([first], records), out)
    return Recovery(out, count, end_ns, walk.problem)


def _write(kind: str, records: Iterable[LogRecord], out: Path) -> tuple[int, int]:
    """Writes a log under another name first, so that `out` is complete or does not exist."""
    made = new_partial(out, out.suffix)
    try:
        try:
            found = (write_mcap if kind == "mcap" else _to_bag)(records, made)
            put_in_place(made, out, overwrite=False)
        finally:
            made.unlink(missing_ok=True)
    except FileExistsError:
        raise RecordingError(f"{out}: exists already; choose another name") from None
    except OSError as error:
        raise RecordingError(
            f"{out}: cannot write the log: {error.strerror}; no partial file remains"
        ) from None
    return found


def write_mcap(records: Iterable[LogRecord], out: Path) -> tuple[int, int]:
    """Writes records as they are; returns their number and the last time, ns."""
    from mcap.writer import CompressionType, Writer

    file = DiskFile(out)
    try:
        stream = cast("io.BufferedWriter", file)
        writer: Any = Writer(stream, chunk_size=CHUNK_BYTES, compression=CompressionType.LZ4)
        writer.start(profile="ros2", library=LIBRARY)
        schemas: dict[tuple[str, str, str], int] = {}
        channels: dict[LogTopic, int] = {}
        count = end_ns = 0
        for topic, time_ns, data, sequence in records:
            if topic not in channels:
                key = (topic.msgtype, topic.definition, topic.schema_encoding)
                if key not in schemas:
                    text = topic.definition.encode(errors="surrogateescape")
                    schemas[key] = (
                        writer.register_schema(topic.msgtype, topic.schema_encoding, text)
                        if any(key)
                        else 0  # a channel without schema
                    )
                channels[topic] = writer.register_channel(
                    topic.topic, topic.encoding, schemas[key], {}
                )
            writer.add_message(channels[topic], time_ns, data, time_ns, sequence)
            count, end_ns = count + 1, max(end_ns, time_ns)
            if file.pending:
                file.commit()
        writer.finish()
        file.close()
    finally:
        file.discard()
    return count, end_ns


def _to_bag(records: Iterable[LogRecord], out: Path) -> tuple[int, int]:
    writer = bag_writer(out)
    connections: dict[LogTopic, Any] = {}
    count = end_ns = 0
    with writer:
        for topic, time_ns, data, _ in records:
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic.topic, topic.msgtype, msgdef=topic.definition, md5sum=topic.digest
                )
            writer.write(connections[topic], time_ns, data)
            count, end_ns = count + 1, max(end_ns, time_ns)
    return count, end_ns
