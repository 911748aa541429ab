"""Writes logs of a run: MCAP with ROS 2 messages (for Foxglove) and ROS 1 .bag.

Both formats are written in chunks of about a megabyte, closed at least every two seconds of wall
time and written to the disk as a whole: a killed run loses only the messages after its last chunk.
The tail of such a file (its index) is missing; `volery.bridges.logs.recovery` writes it.

    log = create_log("flight.mcap")
    graph.subscribe_all(log.write)
    ...
    log.close()
"""

from __future__ import annotations

import io
import os
import time
from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

from volery.bridges.logs.bag_writer import CHUNK_BYTES, bag_writer
from volery.bridges.logs.disk_file import DiskFile
from volery.bridges.logs.file_lock import locked_for_replacing
from volery.core.errors import GraphError, RecordingError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

    from volery.graph.messages import Published

CHUNK_WALL_S = 2.0
"""Age at which the next message closes a chunk, however small the chunk is."""
LIBRARY = "volery"

Compression = Literal["lz4", "zstd", "none"]


def create_log(
    path: str | Path, *, overwrite: bool = False, compression: Compression = "lz4"
) -> LogWriter:
    """Creates a log; the suffix selects the format.

    Parameters
    ----------
    path
        `.mcap` for ROS 2 CDR in MCAP, `.bag` for ROS 1. Missing folders are created.
    overwrite
        Replace an existing file, which is refused otherwise. A file that another process writes
        is never replaced.
    compression
        `zstd` is smaller and slower than `lz4`; a .bag supports `lz4` and `none`.

    Raises
    ------
    RecordingError
            The suffix is unknown, the file exists or is being written, or it cannot be created; no
            partial file remains.

    """
    path = Path(path)
    kind = check_target(path, overwrite=overwrite)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with locked_for_replacing(path):
            path.unlink(missing_ok=True)
            return _begin(kind, path, compression)
    except OSError as error:
        raise RecordingError(f"{path}: cannot create the log: {error.strerror}") from None


def _begin(kind: type[McapLog] | type[BagLog], path: Path, compression: Compression) -> LogWriter:
    """Creates a new log; removes the file again if its first bytes cannot be written."""
    try:
        return kind(path, compression)
    except FileExistsError:
        raise  # of another process, created meanwhile
    except (OSError, RecordingError):
        path.unlink(missing_ok=True)
        raise


def check_target(path: Path, *, overwrite: bool = False) -> type[McapLog] | type[BagLog]:
    """Returns the kind of log that `create_log` creates.

    Raises `RecordingError` if it would refuse to.
    """
    kinds: dict[str, type[McapLog] | type[BagLog]] = {".mcap": McapLog, ".bag": BagLog}
    kind = kinds.get(path.suffix.lower())
    if kind is None:
        raise RecordingError(f"{path}: the name of a log must end in .mcap (ROS 2) or .bag (ROS 1)")
    if path.is_dir():
        raise RecordingError(f"{path}: cannot create the log: it is a folder")
    if os.path.lexists(path) and not overwrite:
        raise RecordingError(f"{path}: exists already; choose another name or overwrite it")
    with locked_for_replacing(path):
        return kind


class LogWriter(ABC):
    """Writes a log. After the first RecordingError every further `write` repeats it."""

    path: Path
    messages: int
    """Number of readable messages in the file: those of its whole chunks."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file: DiskFile
        self._chunk_since = time.monotonic()
        self._failure: RecordingError | None = None
        self._closed = False
        self.messages = 0
        self._taken = 0

    @property
    def size_bytes(self) -> int:
        """Size of the file, including buffered bytes."""
        return self._file.tell()

    def write(self, published: Published) -> None:
        """Adds a message, at its simulated time of publication."""
        if self._failure is not None:
            raise self._failure
        self._add(published)
        self._taken += 1
        if self._file.pending:
            self._commit()
        elif time.monotonic() - self._chunk_since > CHUNK_WALL_S:
            self.flush()

    def flush(self) -> None:
        """Closes the current chunk and writes it to the disk."""
        if self._failure is not None:
            raise self._failure
        self._end_chunk()
        self._commit()

    def close(self) -> None:
        """Writes the rest and the index; does nothing after a failure or a second time."""
        if self._closed:
            return
        self._closed = True
        try:
            if self._failure is None:
                self.flush()
                self._finish()
                self._file.close()
        finally:
            self._file.discard()

    def abort(self) -> None:
        """Closes the file as a killed run would leave it: whole chunks, no index."""
        self._closed = True
        self._file.discard()

    def _commit(self) -> None:
        try:
            self._file.commit()
        except RecordingError as error:
            self._failure = error
            raise
        self.messages = self._taken  # chunks are committed as soon as they are complete
        self._chunk_since = time.monotonic()

    def _commit_start(self) -> None:
        """Writes the first bytes to the disk; closes the file if that fails."""
        try:
            self._file.commit()
        except RecordingError:
            self._file.discard()
            raise

    @abstractmethod
    def _add(self, published: Published) -> None: ...

    @abstractmethod
    def _end_chunk(self) -> None: ...

    @abstractmethod
    def _finish(self) -> None: ...


class McapLog(LogWriter):
    """Writes MCAP: profile `ros2`, CDR messages, `ros2msg` schemas with every nested definition."""

    def __init__(self, path: Path, compression: Compression = "lz4") -> None:
        from mcap.writer import CompressionType, Writer

        super().__init__(path)
        self._file = DiskFile(path)
        kind = {
            "lz4": CompressionType.LZ4,
            "zstd": CompressionType.ZSTD,
            "none": CompressionType.NONE,
        }[compression]
        stream = cast("io.BufferedWriter", self._file)
        self._writer: Any = Writer(stream, chunk_size=CHUNK_BYTES, compression=kind)
        self._writer.start(profile="ros2", library=LIBRARY)
        self._commit_start()
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._sequences: dict[int, int] = {}

    def _channel(self, topic: str, msgtype: str) -> int:
        schema = self._schemas.get(msgtype)
        if schema is None:
            definition, _ = _ros2_typestore().generate_msgdef(msgtype, ros_version=2)
            schema = self._writer.register_schema(msgtype, "ros2msg", definition.encode())
            self._schemas[msgtype] = schema
        channel: int = self._writer.register_channel(topic, "cdr", schema, {})
        self._channels[topic] = channel
        self._sequences[channel] = 0
        return channel

    def _add(self, published: Published) -> None:
        channel = self._channels.get(published.topic)
        if channel is None:
            channel = self._channel(published.topic, published.msgtype)
        sequence = self._sequences[channel]
        self._sequences[channel] = sequence + 1
        time_ns = published.time_ns
        self._writer.add_message(channel, time_ns, published.cdr, time_ns, sequence)

    def _end_chunk(self) -> None:
        self._writer.flush()

    def _finish(self) -> None:
        self._writer.finish()


class _Opened:
    """Replaces a path for a writer that opens its file by itself."""

    def __init__(self, file: DiskFile) -> None:
        self._file = file

    def open(self, _mode: str) -> DiskFile:
        """Returns the file, which is open already."""
        return self._file


class BagLog(LogWriter):
    """Writes a ROS 1 bag, format 2.0."""

    def __init__(self, path: Path, compression: Compression = "lz4") -> None:
        from volery.graph.codecs.ros1 import ros1_codec

        super().__init__(path)
        if compression == "zstd":
            raise RecordingError(f"{path}: a .bag supports lz4 or no compression")
        writer = bag_writer(path, compressed=compression == "lz4")
        self._file = DiskFile(path)
        writer.path = cast("Path", _Opened(self._file))
        writer.open()
        self._commit_start()
        self._writer = writer
        self._codec = ros1_codec()
        self._connections: dict[str, Any] = {}
        self._sequences: dict[str, int] = {}

    def _add(self, published: Published) -> None:
        topic, msgtype = published.topic, published.msgtype
        connection = self._connections.get(topic)
        if connection is None:
            connection = self._connect(topic, msgtype)
            self._connections[topic] = connection
            self._sequences[topic] = 0
        sequence = self._sequences[topic]
        self._sequences[topic] = sequence + 1
        data = self._codec.encode(published.message, msgtype, sequence)
        self._writer.write(connection, published.time_ns, data)

    def _connect(self, topic: str, msgtype: str) -> Any:
        try:
            definition, md5 = self._codec.definition_text(msgtype), self._codec.md5(msgtype)
        except GraphError as error:
            raise RecordingError(f"{topic} cannot be recorded: {error}") from None
        return self._writer.add_connection(topic, msgtype, msgdef=definition, md5sum=md5)

    def _end_chunk(self) -> None:
        self._writer.write_chunk(self._writer.chunks[-1])

    def _commit(self) -> None:
        super()._commit()
        # A written chunk needs only its number of messages by topic.
        for chunk in self._writer.chunks[-2:-1]:
            counts: Any = {key: range(len(index)) for key, index in chunk.connections.items()}
            chunk.connections = counts

    def _finish(self) -> None:
        self._writer.close()


def _ros2_typestore() -> Typestore:
    from volery.graph.typestore import typestore

    return typestore()
