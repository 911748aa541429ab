"""Tests that lazy lists are encoded like other lists in every wire format."""

import pickle

from volery.graph.codecs.json_codec import JsonCodec
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.lazy_list import LazyList
from volery.graph.message_copies import receive_message
from volery.graph.messages import (
    Published,
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    header,
)
from volery.graph.typestore import typestore

TYPE = "tf2_msgs/msg/TFMessage"


def parts():
    for k in range(3):
        transform = Transform(Vector3(float(k), 0.0, -1.0), Quaternion(0.0, 0.0, 0.0, 1.0))
        yield TransformStamped(header(5, "map"), f"uav{k}/base_link", transform)


def test_every_wire_takes_them():
    plain, lazy = TFMessage(list(parts())), TFMessage(LazyList(3, parts))
    assert lazy == plain
    store = typestore()
    assert bytes(store.serialize_cdr(lazy, TYPE)) == bytes(store.serialize_cdr(plain, TYPE))
    assert ros1_codec().encode(lazy, TYPE) == ros1_codec().encode(plain, TYPE)
    assert JsonCodec().encode(lazy, TYPE) == JsonCodec().encode(plain, TYPE)


def test_they_read_like_a_list_and_are_not_made_before():
    made = []

    def make():
        made.append(1)
        return parts()

    rows = LazyList(3, make)
    assert len(rows) == 3
    assert made == []
    assert rows[1].child_frame_id == "uav1/base_link"
    assert [t.child_frame_id for t in rows[1:]] == ["uav1/base_link", "uav2/base_link"]
    assert rows == list(parts())
    assert rows != list(parts())[:2]
    assert "uav2/base_link" in repr(rows)
    kept = pickle.loads(pickle.dumps(rows))
    assert type(kept) is list
    assert rows == kept


def test_a_node_receives_a_list_of_its_own():
    made = list(parts())
    message = TFMessage(LazyList(3, lambda: made))
    first, second = receive_message(message), receive_message(message)
    first.transforms[0].child_frame_id = "changed"
    first.transforms.append(made[0])
    assert second.transforms == made
    assert made[0].child_frame_id == "uav0/base_link"


def test_cdr_of_the_whole_needs_no_parts():
    def make():
        raise AssertionError("the parts are not needed")

    message = TFMessage(LazyList(3, make, lambda: b"cdr"))
    assert Published("/tf", TYPE, 0, message).cdr == b"cdr"
    plain = Published("/tf", TYPE, 0, TFMessage(list(parts()))).cdr
    assert Published("/tf", TYPE, 0, TFMessage(LazyList(3, parts))).cdr == plain
