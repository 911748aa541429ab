"""Messages in their coded forms: CDR, ROS 1, plain values; and what describes them."""

from __future__ import annotations

import contextlib
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from filling import filled
from rosbags.typesys import Stores, get_typestore

from volery.bridges.topic_patterns import renamer, topic_filter
from volery.core.errors import GraphError, PatternError
from volery.core.patterns import posix_search
from volery.graph import object_count
from volery.graph.codecs.cdr import decode_cdr, encode_cdr
from volery.graph.codecs.definition_files import parse_definition
from volery.graph.codecs.definition_store import DefinitionStore
from volery.graph.codecs.json_codec import JsonCodec
from volery.graph.codecs.json_decoding import decode_plain
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.codecs.ros1_names import ros1_name, ros2_name
from volery.graph.messages import message_type
from volery.graph.object_count import CDR, ROS1, check_objects
from volery.graph.typestore import typestore

TYPES = (
    "std_msgs/msg/String",
    "std_msgs/msg/Header",
    "geometry_msgs/msg/Twist",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/Image",
    "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/MultiEchoLaserScan",
    "sensor_msgs/msg/BatteryState",
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/OccupancyGrid",
    "tf2_msgs/msg/TFMessage",
    "trajectory_msgs/msg/MultiDOFJointTrajectory",
    "diagnostic_msgs/msg/DiagnosticArray",
    "shape_msgs/msg/Plane",
    "std_srvs/srv/SetBool_Request",
    "std_srvs/srv/Trigger_Response",
    "simulation_interfaces/srv/SpawnEntity_Request",
    "simulation_interfaces/srv/GetSimulatorFeatures_Response",
)


@cache
def _seeds(msgtype, form):
    rng = np.random.default_rng(5)
    messages = [filled(msgtype, rng) for _ in range(6)]
    if form == "ros1":
        return [ros1_codec().encode(message, msgtype) for message in messages]
    if form == "plain":
        plain = JsonCodec(non_finite_as_null=False)
        old = JsonCodec(ros1_names=True)
        typed = JsonCodec(arrays=lambda values, _type: values)
        return [f.encode(message, msgtype) for f in (plain, old, typed) for message in messages]
    store = typestore()
    return [
        bytes(store.serialize_cdr(message, msgtype, little_endian=little))
        for message in messages
        for little in (True, True, False)
    ]


def cdr(mutator):
    """What is read can be written and read again, the same."""
    msgtype = mutator.pick(TYPES)
    data = mutator.bytes(_seeds(msgtype, "cdr"))
    try:
        message = decode_cdr(data, msgtype)
    except GraphError:
        return 1
    assert type(message) is message_type(msgtype)
    again = decode_cdr(encode_cdr(message, msgtype), msgtype)
    assert encode_cdr(again, msgtype) == encode_cdr(message, msgtype)
    return 1


def ros1(mutator):
    """What is read can be written; those are the bytes, but for headers' `seq` and bools."""
    msgtype = mutator.pick(TYPES)
    codec = ros1_codec()
    data = mutator.bytes(_seeds(msgtype, "ros1"))
    try:
        message = codec.decode(data, msgtype)
    except GraphError:
        return 1
    again = codec.encode(message, msgtype)
    assert len(again) == len(data)
    assert codec.encode(codec.decode(again, msgtype), msgtype) == again
    return 1


def object_counts(mutator):
    """What the count lets pass becomes no more objects than it may, which are few here."""
    msgtype, form = mutator.pick(TYPES), mutator.pick((CDR, ROS1))
    data = mutator.bytes(_seeds(msgtype, form))
    kept, object_count.MAX_OBJECTS = object_count.MAX_OBJECTS, 10
    try:
        check_objects(data, msgtype, form)
        decode = decode_cdr if form == CDR else ros1_codec().decode
        message = decode(data, msgtype)
    except GraphError:
        return 1
    finally:
        object_count.MAX_OBJECTS = kept
    assert _in_arrays(message) <= 10
    return 1


def _in_arrays(value, *, inside=False):
    """Messages and texts within the variable arrays of a message; fixed ones are not counted."""
    if isinstance(value, list):
        return sum(_in_arrays(item, inside=True) for item in value)
    if isinstance(value, str):
        return int(inside)
    if not hasattr(value, "__msgtype__"):
        return 0
    fields = {name: item for name, item in vars(value).items() if name != "__msgtype__"}
    nested = sum(_in_arrays(item) for item in fields.values())
    return nested + int(inside)


def plain_values(mutator):
    """What is read fits CDR."""
    msgtype = mutator.pick(TYPES)
    value = mutator.plain(mutator.pick(_seeds(msgtype, "plain")))
    try:
        message = decode_plain(value, msgtype)
    except GraphError:
        return 1
    back = decode_cdr(encode_cdr(message, msgtype), msgtype)
    assert encode_cdr(back, msgtype) == encode_cdr(message, msgtype)
    JsonCodec().encode(message, msgtype)
    return 1


_DEFINITIONS = (
    b'std_msgs/Header header\nfloat64[36] covariance\nstring<=20 name "x" # comment\n',
    b"# all\nint8 A=1\nuint8 B = 0x10\nstring C=a # b\nbool D=true\nfloat32 E=1.5e3\nbyte b\n",
    b"Header header\ntime t\nduration d\ngeometry_msgs/Point[] points\nint32[<=5] few [1, 2]\n",
    b"float32 x 1.5\nstring s 'q'\nbool[2] two [true, false]\nchar c\n",
    b"string[] names [\"a\", 'b']\nfloat64[<=3] some [1, 2.5]\nbool ok true\n",
    b"int64 a\nint64 b\n---\nint64 sum\n",
    b"int32 order\n---\nint32[] sequence\n---\nint32[] partial\nstd_msgs/String text\n",
    b"MyOther other\nuint64 class\nint8 from\nwstring w\nbyte[4] bytes\n",
)
_NAMES = ("my_pkg/msg/My", "my_pkg/srv/My", "my_pkg/action/My")


def definitions(mutator):
    """Definition files: what is read makes types whose messages can be coded."""
    text = mutator.bytes(_DEFINITIONS).decode(errors="replace")
    name = mutator.pick(_NAMES)
    try:
        parse_definition(text, name, "fuzz")
    except GraphError:
        return 1
    if mutator.chance(0.9):  # making classes of it takes a hundred times as long
        return 1
    _, kind, _ = name.split("/")
    store = DefinitionStore(_base(), __name__)
    with tempfile.TemporaryDirectory(prefix="volery-fuzz-") as folder:
        path = Path(folder, "my_pkg", kind, f"My.{kind}")
        path.parent.mkdir(parents=True)
        path.write_text(text, encoding="utf-8")
        try:
            names = store.add_folder(Path(folder))
        except GraphError:
            return 1
    for made in names:
        store.get_msgdef(made)
    return 1


@cache
def _base():
    return get_typestore(Stores.ROS2_JAZZY)


_PATTERNS = (b"/**", b"/uav*/laser/**", b"/a?c", b"/**/b/**", b"/uav1/odom", b"/a/**b", b"/*/*/*")
_TOPICS = (b"/uav1/laser/horizontal/scan", b"/a", b"/abc", b"/a/b", b"/uav1/odom", b"/")


def patterns(mutator):
    """Topic patterns and new names."""
    pattern = mutator.bytes(_PATTERNS).decode(errors="replace")
    topic = mutator.bytes(_TOPICS).decode(errors="replace")
    try:
        found = topic_filter([pattern])(topic)
    except GraphError:
        found = None
    if not {"*", "?"} & set(pattern) and found is not None:
        assert found == (pattern == topic)
    with contextlib.suppress(GraphError):
        assert isinstance(renamer({pattern: topic})(topic), str)
    return 1


_FILTERS = (b"^uav[[:digit:]]+$", b"(a|b)*c{2,5}", b"(|||){14}x", b"[^[:alpha:]_]", b"(a+)+$")


def filters(mutator):
    """Filters of names, which are POSIX extended regular expressions."""
    pattern = mutator.bytes(_FILTERS).decode(errors="surrogateescape")
    with contextlib.suppress(PatternError):
        assert posix_search(pattern)("uav12" + 300 * "a") in (True, False)
    return 1


_TYPE_NAMES = tuple(name.encode() for name in (*TYPES, "std_msgs/String", "rosapi/Topics"))


def type_names(mutator):
    """Names of types in both generations: what is renamed comes back."""
    name = mutator.bytes(_TYPE_NAMES).decode(errors="replace")
    for kind in ("msg", "srv", "action"):
        try:
            new = ros2_name(name, kind)
            assert ros2_name(ros1_name(new), kind).count("/") == 2
        except GraphError:
            continue
    return 1
