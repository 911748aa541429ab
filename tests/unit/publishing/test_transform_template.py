"""CDR of many transforms that is written from arrays is that of the encoder of single ones."""

import numpy as np
import pytest

from volery.graph.codecs.cdr import decode_cdr, encode_cdr
from volery.graph.messages import Published, TFMessage
from volery.publishing.transforms import transforms_in_map, transforms_of_odometry

TYPE = "tf2_msgs/msg/TFMessage"
FRAMES = [f"uav{number}/base_link" for number in range(1, 130)] + ["ä", "person", ""]


def published(message):
    return Published("/tf", TYPE, 0, message)


@pytest.mark.parametrize("count", [1, 31, 32, len(FRAMES)])
@pytest.mark.parametrize("time_ns", [0, 1, 86_400_000_000_007, 2_147_483_647_999_999_999])
def test_bytes_are_those_of_single_transforms(count, time_ns):
    frames = FRAMES[-count:]
    poses = np.random.default_rng(count).normal(size=(count, 7))
    poses[0] = np.nan
    message = transforms_in_map(time_ns, frames, poses)
    assert published(message).cdr == encode_cdr(TFMessage(list(message.transforms)), TYPE)
    assert (message.transforms.cdr is not None) == (count >= 32)


def test_transforms_of_odometry():
    names = [f"uav{number}" for number in range(1, 100)]
    poses = np.random.default_rng(3).normal(size=(len(names), 7))
    message = transforms_of_odometry(5 * 10**8, names, poses)
    read = list(message.transforms)
    assert [t.header.frame_id for t in read] == [f"{name}/odom" for name in names]
    assert [t.child_frame_id for t in read] == [f"{name}/base_link" for name in names]
    assert published(message).cdr == encode_cdr(TFMessage(read), TYPE)
    assert all(one is other for one, other in zip(read, message.transforms, strict=True))


def test_a_template_is_filled_for_each_message():
    frames = FRAMES[:50]
    first = np.random.default_rng(1).normal(size=(50, 7))
    data = published(transforms_in_map(10**9, frames, first)).cdr
    later = published(transforms_in_map(2 * 10**9, frames, first + 1.0)).cdr
    for bytes_, sec, poses in ((data, 1, first), (later, 2, first + 1.0)):
        read = decode_cdr(bytes_, TYPE).transforms
        assert [t.child_frame_id for t in read] == frames
        assert {t.header.stamp.sec for t in read} == {sec}
        np.testing.assert_array_equal([t.transform.translation.x for t in read], poses[:, 0])
        np.testing.assert_array_equal([t.transform.rotation.w for t in read], poses[:, 6])
