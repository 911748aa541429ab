"""Number fields of received messages: as `array.array` where that defines it, else as numpy."""

import array
import copy
import pickle

import numpy as np
import pytest

from volery.graph.message_copies import copy_message, receive_message
from volery.graph.messages import Image, LaserScan, message_type
from volery.graph.number_sequence import MAX_COPIED_BYTES

VALUES = [1.5, 2.0, 2.0, 0.5, 9.0, 7.0, -1.0]


def ranges(values=VALUES):
    return receive_message(copy_message(LaserScan(ranges=values))).ranges


TWIN = array.array("f", VALUES)

EXPRESSIONS = [
    "r[:3] + r[-3:]",
    "not r",
    "r.index(2.0)",
    "r.index(2.0, 2)",
    "r.count(2.0)",
    "r == r[:]",
    "r != r[:2]",
    "r == r[::-1]",
    "list(r)",
    "[type(v) for v in r]",
    "type(r[0])",
    "r[1:5:2]",
    "r * 2",
    "2 * r[:1]",
    "2.0 in r",
    "5.0 in r",
    "max(r), min(r), sum(r), sorted(r), len(r)",
    "list(enumerate(r))",
    "list(zip(r, r[1:]))",
    "list(reversed(r))",
    "bytes(r)",
    "memoryview(r).nbytes",
    "r.tobytes(), r.tolist(), r.itemsize, r.typecode",
    "str(r)",
    "bool(r[:0])",
]


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_what_array_defines(expression):
    found, expected = eval(expression, {"r": ranges()}), eval(expression, {"r": TWIN})
    if isinstance(expected, array.array):
        assert found.tolist() == expected.tolist()
        assert isinstance(found, np.ndarray)
    else:
        assert found == expected
        assert type(found) is type(expected)


def test_sequences_join_with_arrays_of_the_node():
    assert (ranges() + TWIN).tolist() == (TWIN + ranges()).tolist() == VALUES * 2
    grown = ranges()
    grown += grown[:1]
    assert grown.tolist() == [*VALUES, 1.5]
    assert ranges() == TWIN
    with pytest.raises(ValueError, match="not in the sequence"):
        ranges().index(77.0)


def test_a_list_neither_joins_nor_adds():
    """rclpy's `array.array` refuses it as well; numpy would add."""
    for wrong in ([1.0], (1.0,) * len(VALUES)):
        for join in (lambda odd: ranges() + odd, lambda odd: odd + ranges()):
            with pytest.raises(TypeError, match=r"list\(values\) \+ \[...\]"):
                join(wrong)
    assert [*ranges(), 1.0] == list(ranges()) + [1.0]  # noqa: RUF005


def test_everything_else_is_numpy_with_plain_results():
    r, plain = ranges(), np.array(VALUES, np.float32)
    np.testing.assert_array_equal(r + 1.0, plain + 1.0)
    np.testing.assert_array_equal(r / 2 + r / 4, plain / 2 + plain / 4)
    np.testing.assert_array_equal(1.0 - r, 1.0 - plain)
    np.testing.assert_array_equal(r[r < 2.0], plain[plain < 2.0])
    np.testing.assert_array_equal(r == 2.0, plain == 2.0)
    assert type(np.sqrt(np.abs(r))) is np.ndarray
    half = r.reshape(-1, 1)
    np.testing.assert_array_equal(half + half, plain.reshape(-1, 1) * 2)
    assert (r[[0, 1]] + r[[0, 1]]).tolist() == [3.0, 4.0]
    assert float(r.min()) == -1.0
    assert np.frombuffer(r, np.float32).tolist() == VALUES


def test_a_node_may_write_into_what_it_receives():
    message = copy_message(LaserScan(ranges=VALUES))
    mine, other = receive_message(message), receive_message(message)
    mine.ranges[0] = np.inf
    mine.header.frame_id = "changed"
    assert other.ranges[0] == message.ranges[0] == 1.5
    assert other.header.frame_id == message.header.frame_id == ""


def test_large_arrays_are_shared():
    message = copy_message(Image(data=np.zeros(MAX_COPIED_BYTES + 1, np.uint8)))
    received = receive_message(message)
    assert np.shares_memory(np.asarray(received.data), message.data)
    with pytest.raises(ValueError, match="modify a copy"):
        received.data[0] = 1
    part = received.data[:4]
    part[0] = 1
    assert message.data[0] == 0


@pytest.mark.parametrize(
    "twin", [copy.copy, copy.deepcopy, lambda r: pickle.loads(pickle.dumps(r))]
)
def test_copies_behave_alike(twin):
    assert (twin(ranges())[:1] + twin(ranges())[:1]).tolist() == [1.5, 1.5]


def test_received_messages_can_be_published():
    again = copy_message(receive_message(copy_message(LaserScan(ranges=VALUES))))
    assert type(again.ranges) is np.ndarray
    assert again.ranges.tolist() == VALUES


def test_fixed_arrays_stay_arrays_of_numpy():
    received = receive_message(copy_message(message_type("sensor_msgs/msg/Imu")()))
    assert type(received.orientation_covariance) is np.ndarray
    received.orientation_covariance[0] = 1.0
