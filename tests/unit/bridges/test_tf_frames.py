"""Poses of frames in each other."""

import math

import pytest

from volery.bridges.rosbridge.frames import Frames
from volery.graph.messages import Quaternion, Transform, TransformStamped, Vector3, header


def stamped(parent, child, x, y, yaw):
    turn = Quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    return TransformStamped(header(7, parent), child, Transform(Vector3(x, y, 0.0), turn))


@pytest.fixture
def frames():
    made = Frames()
    made.learn(
        [
            stamped("map", "/odom", 10.0, 0.0, math.pi / 2),
            stamped("odom", "base", 1.0, 0.0, 0.0),
            stamped("map", "other", 0.0, 5.0, 0.0),
            stamped("ring_b", "ring_a", 1.0, 0.0, 0.0),
            stamped("ring_a", "ring_b", 1.0, 0.0, 0.0),
        ]
    )
    return made


def test_down_up_and_across_the_tree(frames):
    assert frames.pose("base", "map").position == pytest.approx((10.0, 1.0, 0.0))
    assert frames.pose("map", "base").position == pytest.approx((-1.0, 10.0, 0.0))
    assert frames.pose("other", "base").position == pytest.approx((4.0, 10.0, 0.0))
    assert frames.pose("base", "base").position == (0.0, 0.0, 0.0)


def test_what_is_not_connected_or_goes_round(frames):
    assert frames.pose("base", "nowhere") is None
    assert frames.pose("ring_a", "map") is None


def test_thresholds(frames):
    base, odom = frames.pose("base", "map"), frames.pose("odom", "map")
    assert base.differs(odom, 0.1, 0.5)
    assert not base.differs(odom, 0.1, 1.5)
    assert base.differs(frames.pose("other", "map"), 1.5, 100.0)
    assert not base.differs(frames.pose("other", "map"), 1.6, 100.0)
