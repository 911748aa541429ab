"""The SLAM's way: when keyframes are due, and which old ones are tried by one that is lost."""

from __future__ import annotations

import numpy as np

from volery.autonomy.slam.keyframes import Keyframe
from volery.autonomy.slam.settings import Matching
from volery.autonomy.slam.tracker import Tracker
from volery.autonomy.slam.way import Way

S = 1_000_000_000
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])


class Closer:
    """Finds nothing, and notes what it was asked."""

    def __init__(self):
        self.asked = []

    def match(self, _frames, _poses, _newest, older, _reach):
        self.asked.append(older)


def keyframe(number, session=0):
    nothing = np.zeros((0, 3)), np.zeros(0, np.int8)
    return Keyframe(number * S, np.zeros(3), LEVEL, 2.0 * number, *nothing, session)


def flown(count):
    """A way of so many keyframes, and what finds places in it again."""
    way = Way(Matching(), np.zeros(4), has_loops=False)
    way.frames = [keyframe(k) for k in range(count)]
    way.poses = [np.zeros(4) for _ in range(count)]
    way._closer = Closer()
    return way, way._closer


def test_one_that_is_lost_tries_all_it_knows_the_latest_first():
    way, closer = flown(9)
    way.begin_anew()
    way.frames += [keyframe(9 + k, session=1) for k in range(3)]
    for _ in range(9):
        assert way._find_anywhere(len(way.frames) - 1) is None
    assert closer.asked[:9] == [8, 5, 2, 7, 4, 1, 6, 3, 0]
    assert {row: closer.asked.count(row) for row in range(9)} == dict.fromkeys(range(9), 4)


def test_one_that_is_lost_and_holds_still_looks_around_more_often():
    way, _ = flown(2)
    tracker = Tracker(np.zeros(3))
    due = {}
    for lost in (False, True):
        way.is_placed = not lost
        times = [k * S // 2 for k in range(2, 30)]
        for time_ns in times:
            tracker._imu = (S + time_ns, np.zeros(3), np.zeros(3))
            if way._is_due(tracker):
                due[lost] = time_ns / S
                break
    assert due == {False: 10.5, True: 2.5}
