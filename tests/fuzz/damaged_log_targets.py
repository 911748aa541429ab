"""Whole logs of a flight after damage: read, played, looked into, mended, taken as a flight.

Pieces of a file are flipped, cut off, doubled, exchanged, and records say another length. Every
reader of logs gets the file, and a graph with a subscriber of all topics.
"""

from __future__ import annotations

import contextlib
import json
import shutil
import struct
from functools import cache

import numpy as np
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import Writer as Ros2Writer
from scratch_files import path_of

from volery.bridges.logs.bag_writer import bag_writer
from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.playback import Playback
from volery.bridges.logs.reader import summarize
from volery.bridges.logs.recorded_flight import ORIGIN_TOPIC, read_flight
from volery.bridges.logs.records import LogWalk
from volery.bridges.logs.recovery import recover
from volery.core.errors import GraphError, RecordingError
from volery.graph import command_records
from volery.graph.codecs import definition_store
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.codecs.zero import zero_message
from volery.graph.graph import Graph
from volery.graph.messages import Published, String
from volery.graph.typestore import typestore
from volery.runtime.replay.slam.sources import open_source

definition_store.MAX_FOREIGN = 60  # damaged definitions would be learned for ever

_TYPES = {
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/clock": "rosgraph_msgs/msg/Clock",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/uav1/odom": "nav_msgs/msg/Odometry",
    "/uav1/scan": "sensor_msgs/msg/LaserScan",
    "/uav1/fix": "sensor_msgs/msg/NavSatFix",
    "/rosout": "rcl_interfaces/msg/Log",
}
_STEP_NS = 10_000_000
_TICKS = 60


def _messages():
    """A flight of 0.6 s with a scenario, a command and sensors."""
    origin = {"name": "hover", "seed": 1, "version": "0.1.0", "folder": None, "content": {}}
    yield Published(ORIGIN_TOPIC, "std_msgs/msg/String", 0, String(json.dumps(origin)))
    command = zero_message("volery_interfaces/msg/CommandRecord")
    command.kind, command.name, command.type = "call", "/x", "std_srvs/srv/Trigger"
    yield Published(command_records.TOPIC, "volery_interfaces/msg/CommandRecord", 0, command)
    for tick in range(_TICKS):
        for topic, msgtype in _TYPES.items():
            message = zero_message(msgtype)
            if topic == "/uav1/scan":
                message.ranges = np.arange(90, dtype=np.float32) + tick
            if topic != "/tf_static" or not tick:
                yield Published(topic, msgtype, tick * _STEP_NS, message)


@cache
def _logs(suffix):
    """Logs of one format: packed and plain, each of several chunks."""
    found = []
    for compression in ("lz4", "none", *(("zstd",) * (suffix == ".mcap"))):
        path = path_of(f"whole{suffix}")
        log = create_log(path, overwrite=True, compression=compression)
        for number, message in enumerate(_messages()):
            log.write(message)
            if number % 80 == 79:
                log.flush()
        log.close()
        found.append(path.read_bytes())
    return [*found, _bzipped(path_of("bzipped.bag"))] if suffix == ".bag" else found


def _bzipped(path):
    """A bag as ROS 1 packs it with bz2."""
    path.unlink(missing_ok=True)
    writer = bag_writer(path, compressed=False)
    writer.set_compression(BagWriter.CompressionFormat.BZ2)
    codec, connections = ros1_codec(), {}
    with writer:
        for number, published in enumerate(_messages()):
            topic, msgtype = published.topic, published.msgtype
            if topic not in connections:
                texts = {"msgdef": codec.definition_text(msgtype), "md5sum": codec.md5(msgtype)}
                connections[topic] = writer.add_connection(topic, msgtype, **texts)
            data = codec.encode(published.message, msgtype, number)
            writer.write(connections[topic], published.time_ns, data)
            if number % 80 == 79:
                writer.write_chunk(writer.chunks[-1])
    return path.read_bytes()


@cache
def _sqlite_bags():
    """The SQLite files of ROS 2 bags, of both versions."""
    found = []
    for version in (8, 9):
        folder = path_of(f"bag_{version}")
        shutil.rmtree(folder, ignore_errors=True)
        connections = {}
        with Ros2Writer(folder, version=version) as writer:
            for published in _messages():
                topic, msgtype = published.topic, published.msgtype
                if topic not in connections:
                    connections[topic] = writer.add_connection(
                        topic, msgtype, typestore=typestore()
                    )
                writer.write(connections[topic], published.time_ns, published.cdr)
        (file,) = folder.glob("*.db3")
        found.append(file.read_bytes())
    return found


def damaged_db3(mutator):
    """SQLite files of ROS 2 bags, damaged, as `volery slam` reads them."""
    path = path_of("damaged.db3")
    path.write_bytes(_damaged(mutator, _sqlite_bags(), _page_cells))
    with contextlib.suppress(RecordingError):
        source = open_source(path)
        for message in source.messages({*source.topics}):
            assert message.topic in source.topics
    return 1


def _page_cells(data):
    """The counts and offsets in the heads of SQLite's pages, and the file's page size."""
    found, size = [(16, ">H"), (28, ">I")], 4096
    for page in range(len(data) // size):
        begin = page * size + (100 if page == 0 else 0)
        found += [(begin + 1, ">H"), (begin + 3, ">H"), (begin + 5, ">H"), (begin + 8, ">I")]
        found += [(begin + 12, ">H")] * (begin + 14 <= len(data))
    return found


def damaged_mcap(mutator):
    """MCAP files of a flight, damaged."""
    return _check(_damaged(mutator, _logs(".mcap"), _mcap_lengths), "damaged.mcap")


def damaged_bag(mutator):
    """ROS 1 bags of a flight, packed by lz4, bz2 or not at all, damaged."""
    return _check(_damaged(mutator, _logs(".bag"), _bag_lengths), "damaged.bag")


def _damaged(mutator, logs, lengths):
    random = mutator.random
    data = bytearray(mutator.pick(logs))
    for _ in range(mutator.pick((1, 1, 1, 2, 3, 6))):
        size = len(data)
        if size < 64:
            break
        at, other = random.randrange(20, size), random.randrange(20, size)
        piece = random.randrange(1, max(2, size // mutator.pick((4, 16, 200))))
        fate = random.randrange(8)
        if fate <= 2:
            data[at] ^= 1 << random.randrange(8)
        elif fate == 3:
            del data[at:]
        elif fate == 4:
            data[at:at] = data[other : other + piece]
        elif fate == 5:
            first, last = min(at, other), max(at, other)
            moved = data[last : last + piece]
            data[last : last + piece] = data[first : first + piece]
            data[first : first + piece] = moved
        elif fate == 6:
            del data[at : at + piece]
        else:
            position, form = mutator.pick(lengths(data))
            limit = 1 << 8 * struct.calcsize(form)
            (length,) = struct.unpack_from(form, data, position)
            near = (
                length + random.randrange(-9, 10),
                random.getrandbits(16),
                random.getrandbits(63),
            )
            struct.pack_into(form, data, position, mutator.pick(near) % limit)
    return bytes(data)


def _mcap_lengths(data):
    """Where the lengths of the records stand, as far as they can be followed."""
    found, position = [(9, "<Q")], 8
    while position + 9 <= len(data):
        found.append((position + 1, "<Q"))
        position += 9 + struct.unpack_from("<Q", data, position + 1)[0]
    return found


def _bag_lengths(data):
    found, position = [(13, "<I")], 13
    while position + 4 <= len(data):
        found.append((position, "<I"))
        position += 4 + struct.unpack_from("<I", data, position)[0]
    return found


def _check(data, name):
    path = path_of(name)
    path.write_bytes(data)
    with contextlib.suppress(RecordingError):
        summary = summarize(path)
        assert summary.messages >= 0
        assert summary.duration_s >= 0.0
    _walk(path)
    _mend(path)
    with contextlib.suppress(RecordingError):
        read_flight(path)
    with contextlib.suppress(RecordingError):
        _play(path)
    return 1


def _walk(path):
    decoder = LogDecoder()
    with contextlib.suppress(RecordingError):
        for record in LogWalk(path):
            with contextlib.suppress(GraphError):
                decoder.decode(record)


def _mend(path):
    out = path.with_name(f"mended-{path.name}")
    out.unlink(missing_ok=True)
    try:
        recovery = recover(path, out)
    except RecordingError:
        assert not out.exists()
        return
    mended = summarize(out)
    assert mended.messages == recovery.messages
    assert not mended.problem
    with contextlib.closing(Playback(out)) as playback:
        assert sum(topic.messages for topic in playback.topics) == recovery.messages


def _play(path):
    """On a graph with a subscriber of everything; forward, to the middle, and on."""
    with contextlib.closing(Playback(path)) as playback:
        graph = Graph(lambda: playback.now_ns)
        playback.open(graph)
        received = []
        graph.subscribe_all(lambda published: received.append(published.topic))
        for time_ns in (playback.start_ns, (playback.start_ns + playback.end_ns) // 2):
            playback.seek(time_ns)
            _play_on(playback, graph)
        playback.show_to_newcomers()
        assert playback.position_ns <= playback.end_ns


def _play_on(playback, graph):
    for _ in range(1000):
        over = playback.advance(playback.end_ns)
        graph.deliver()
        if over:
            return
    raise AssertionError("the log does not end")
