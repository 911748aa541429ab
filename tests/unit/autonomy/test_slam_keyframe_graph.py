"""The SLAM's keyframe graph: when keyframes are due, and which ones relocalization tries."""

from __future__ import annotations

import numpy as np
import pytest

from volery.autonomy.slam.keyframe_graph import KeyframeGraph
from volery.autonomy.slam.keyframes import Keyframe
from volery.autonomy.slam.loop_closure import LoopClosure
from volery.autonomy.slam.pose_graph import PoseGraphEdge
from volery.autonomy.slam.relocalization import PoseHypothesis, chosen
from volery.autonomy.slam.settings import ScanMatching
from volery.autonomy.slam.tracker import Tracker

S = 1_000_000_000
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])


class Closer:
    """Finds nothing, and notes what it was asked."""

    def __init__(self):
        self.asked, self.extents = [], []

    def find(self, _frames, _poses, _newest, older, extent):
        self.asked.append(older)
        self.extents.append(extent)


class Guesser:
    """Finds steps (4,) from some keyframes to the newest one."""

    def __init__(self, steps, margin=0.06):
        self.steps, self.margin = steps, margin

    def find(self, _frames, _poses, newest, older, _extent):
        if older not in self.steps:
            return None
        edge = PoseGraphEdge(older, newest, np.array(self.steps[older]), np.ones(4), True)
        return LoopClosure(edge, 0.2, 100.0, self.margin)


def keyframe(number, session=0):
    nothing = np.zeros((0, 3)), np.zeros(0, np.int8)
    return Keyframe(number * S, np.zeros(3), LEVEL, 2.0 * number, *nothing, session)


def flown(count):
    """Returns a graph of so many keyframes, and what finds loop closures in it."""
    graph = KeyframeGraph(ScanMatching(), np.zeros(4), has_loops=False)
    graph.frames = [keyframe(k) for k in range(count)]
    graph.poses = [np.zeros(4) for _ in range(count)]
    graph._closer = Closer()
    return graph, graph._closer


def find(graph, count):
    """What so many rounds of looking find."""
    edges = [
        graph.relocalization.find(graph._closer, graph.frames, graph.poses) for _ in range(count)
    ]
    return [edge for edge in edges if edge is not None]


def lost_after(count, **how):
    """Returns a graph that was lost after so many keyframes, 7 m apart, and has three since."""
    graph, closer = flown(count)
    graph.poses = [np.array([7.0 * k, 0.0, 0.0, 0.0]) for k in range(count)]
    graph.restart(**how)
    graph.frames += [keyframe(count + k, session=1) for k in range(3)]
    graph.poses += [np.zeros(4) for _ in range(3)]
    return graph, closer


def test_one_that_is_lost_tries_all_it_knows_the_latest_first():
    graph, closer = lost_after(9)
    assert not find(graph, 9)
    assert closer.asked[:9] == [8, 5, 2, 7, 4, 1, 6, 3, 0]
    assert {row: closer.asked.count(row) for row in range(9)} == dict.fromkeys(range(9), 6)
    headings = [radians for _, radians in closer.extents]
    assert headings == [0.2] * 9 + [np.pi] * 45  # around the heading of the gyroscope, then any


def test_keyframes_since_it_may_have_been_elsewhere_are_not_tried():
    graph, closer = lost_after(9, doubted_since_ns=6 * S)
    assert not find(graph, 7)
    assert set(closer.asked) == set(range(7))


def test_keyframes_of_a_session_that_was_never_placed_are_not_tried():
    graph, closer = lost_after(9)
    graph.restart()
    graph.frames += [keyframe(12 + k, session=2) for k in range(3)]
    graph.poses += [np.zeros(4) for _ in range(3)]
    assert not find(graph, 9)
    assert set(closer.asked) == set(range(9))


def guess(older, x, margin, newer=26):
    """A guess that the keyframe `newer` lies at (x, 0, 0)."""
    edge = PoseGraphEdge(older, newer, np.array([x - 7.0 * older, 0.0, 0.0, 0.0]), np.ones(4), True)
    return PoseHypothesis(edge, margin, np.array([x, 0.0, 0.0, 0.0]))


@pytest.mark.parametrize(
    ("guesses", "at"),
    [
        ([], None),
        ([guess(11, 30.0, 0.25)], 30.0),
        ([guess(11, 30.0, 0.1)], None),
        ([guess(11, 30.0, 0.13), guess(4, 30.4, 0.08)], 30.0),
        ([guess(11, 30.0, 0.15), guess(8, 30.4, 0.15)], None),  # they have returns in common
        ([guess(11, 30.0, 0.15), guess(4, 30.6, 0.15)], None),
        ([guess(11, 30.0, 0.22), guess(4, 50.0, 0.12)], None),  # which contradict each other
        ([guess(11, 30.0, 0.2), guess(4, 50.0, 0.12), guess(3, 30.1, 0.1)], 30.0),
        ([guess(11, 30.0, 0.25, newer=25)], None),  # it was seen before: is it still?
        ([guess(11, 30.0, 0.2, newer=25), guess(10, 30.2, 0.06)], 30.2),
    ],
)
def test_guesses_that_agree_and_are_not_contradicted_are_a_find(guesses, at):
    found = chosen(guesses, 26, np.zeros(4))
    if at is None:
        assert found is None
    else:
        assert found.to == 26
        assert 7.0 * found.origin + found.measured[0] == pytest.approx(at)


@pytest.mark.parametrize(("hint", "is_found"), [((29.6, -0.5), True), ((27.0, 0.0), False)])
def test_a_hint_makes_a_weak_guess_sure(hint, is_found):
    found = chosen([guess(11, 30.0, 0.1)], 26, np.zeros(4), np.array(hint))
    assert (found is not None) == is_found


def test_a_find_is_of_the_newest_keyframe():
    graph, _ = lost_after(24)
    graph._closer = Guesser({11: [1.0, 0.0, 0.0, 0.0]}, margin=0.25)
    found = find(graph, 6)
    assert found
    assert {(edge.origin, edge.to) for edge in found} == {(11, 26)}


def test_one_that_is_lost_and_holds_still_looks_around_more_often():
    graph, _ = flown(2)
    tracker = Tracker(np.zeros(3))
    due = {}
    for lost in (False, True):
        graph.is_placed = not lost
        times = [k * S // 2 for k in range(2, 30)]
        for time_ns in times:
            tracker._imu = (S + time_ns, np.zeros(3), np.zeros(3))
            if graph._is_due(tracker):
                due[lost] = time_ns / S
                break
    assert due == {False: 10.5, True: 2.5}
