"""Tests that full garbage collections are rare while a simulation serves clients."""

import gc

from volery.core.collector import spared_objects


def test_present_objects_are_left_out_until_the_end():
    gc.collect()
    before, thresholds = gc.get_freeze_count(), gc.get_threshold()
    with spared_objects():
        assert gc.get_freeze_count() > before + 10_000
        assert gc.get_threshold()[2] > thresholds[2]
        cycle = []
        cycle.append(cycle)
        del cycle
        assert gc.collect() >= 1  # new garbage is found
    assert gc.get_freeze_count() == 0
    assert gc.get_threshold() == thresholds
