"""Tests that full garbage collections are rare while a simulation serves clients."""

import gc
from contextlib import ExitStack

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


def test_the_last_of_overlapping_contexts_restores_the_collector():
    thresholds = gc.get_threshold()
    first, second = ExitStack(), ExitStack()
    first.enter_context(spared_objects())
    second.enter_context(spared_objects())
    first.close()
    assert gc.get_threshold()[2] > thresholds[2]
    assert gc.get_freeze_count() > 10_000
    second.close()
    assert gc.get_threshold() == thresholds
    assert gc.get_freeze_count() == 0
