"""How far a run has come, over resets too."""

import pytest

from volery.engine.pacing import Pacer
from volery.runtime.monitoring.progress import ProgressPublisher


def test_what_was_flown_before_a_reset_counts_for_the_factor():
    reports = []
    publisher = ProgressPublisher(reports.append, 60.0, Pacer())
    for time_s in (2.0, 5.0, 1.0, 0.5, 3.0):  # set back from 5 s and from 1 s
        publisher.report(time_s, last=True)
    last = reports[-1]
    assert (last.time_s, last.before_s) == (3.0, 6.0)
    assert last.real_time_factor == pytest.approx(9.0 / last.wall_s)
