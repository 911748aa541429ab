"""Lone returns of scans are left out, surfaces and thin things stay."""

import copy

import numpy as np

from volery.autonomy.perception.speckle_filter import SpeckleFilter
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import LaserScan

INF = np.inf


def scan_of(ranges):
    scan = zero_message("sensor_msgs/msg/LaserScan")
    scan.ranges = np.asarray(ranges, np.float32)
    return scan


def kept(echoes, ranges):
    return np.flatnonzero(np.isfinite(echoes.left_out(scan_of(ranges)).ranges)).tolist()


def empty(beams=40, **returns):
    ranges = np.full(beams, INF)
    for beam, distance in returns.items():
        ranges[int(beam[1:])] = distance
    return ranges


def test_a_single_drop_is_left_out_and_a_wall_stays():
    ranges = np.where(np.arange(40) < 20, 5.0 + 0.05 * np.arange(40), INF)
    ranges[10], ranges[30] = 3.0, 4.0
    assert kept(SpeckleFilter(), ranges) == [k for k in range(20) if k != 10]


def test_a_thin_thing_is_confirmed_by_the_next_scan():
    echoes = SpeckleFilter()
    assert kept(echoes, empty(b10=6.0)) == []
    assert kept(echoes, empty(b12=6.1)) == [12]  # turned by two beams, nearer by 10 cm
    assert kept(echoes, empty(b15=6.0)) == []  # too far aside
    assert kept(echoes, empty(b15=6.3)) == []  # another range
    assert kept(echoes, empty()) == []
    assert kept(echoes, empty(b15=6.3)) == []  # too long ago


def test_close_by_more_is_needed():
    """Two drops near each other are no twig; three beams, or the same again, are."""
    assert kept(SpeckleFilter(), empty(b10=1.0, b11=1.05)) == []
    echoes = SpeckleFilter()
    twig = empty(b10=1.0, b11=1.02)
    assert kept(echoes, twig) == []
    assert kept(echoes, twig) == [10, 11]
    assert kept(SpeckleFilter(), empty(b10=1.0, b11=1.0, b12=1.0, b13=1.0)) == [11, 12]


def test_rows_do_not_wrap_around_and_lengths_may_change():
    assert kept(SpeckleFilter(), empty(b0=5.0, b39=5.0)) == []
    echoes = SpeckleFilter()
    assert kept(echoes, empty(b5=5.0)) == []
    assert kept(echoes, empty(50, b5=5.0)) == []
    assert kept(echoes, []) == []


def test_nan_stays_nothing_and_the_message_untouched():
    ranges = np.array([np.nan, 5.0, 5.0, np.nan, -INF, INF], np.float32)
    scan = scan_of(ranges)
    found = SpeckleFilter().left_out(scan).ranges
    assert found.tolist() == [INF, 5.0, 5.0, INF, INF, INF]
    np.testing.assert_array_equal(scan.ranges, ranges)
    assert isinstance(scan, LaserScan)


def test_scarce_particles_hardly_pass_and_a_copy_goes_on_alike():
    """Of 1 % false returns over 10 m few pass: about 0.01 x 9 beams x 0.03 of each."""
    rng = np.random.default_rng(5)
    scans = [
        np.where(rng.random(1081) < 0.01, rng.uniform(2.0, 12.0, 1081), INF) for _ in range(200)
    ]
    echoes = SpeckleFilter()
    passed = [len(kept(echoes, ranges)) for ranges in scans[:100]]
    twin = copy.deepcopy(echoes)
    rest = [kept(echoes, ranges) for ranges in scans[100:]]
    assert rest == [kept(twin, ranges) for ranges in scans[100:]]
    share = (sum(passed) + sum(map(len, rest))) / (200 * 1081 * 0.01)
    assert 0.5 * 0.0027 < share < 2.0 * 0.0027
