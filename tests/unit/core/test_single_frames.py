"""Tests the conversions of one vehicle against those of arrays."""

import numpy as np
import pytest

from volery.core import frames


@pytest.mark.parametrize("seed", range(5))
def test_they_are_those_of_arrays(seed):
    draws = np.random.default_rng(seed)
    v = draws.normal(size=3)
    q = draws.normal(size=4)
    q /= np.linalg.norm(q)
    assert frames.ned_of_enu(tuple(v)) == pytest.approx(frames.ned_from_enu(v))
    assert frames.frd_of_flu(tuple(v)) == pytest.approx(frames.frd_from_flu(v))
    one, many = np.array(frames.q_ned_frd_of_enu_flu(tuple(q))), frames.q_ned_frd_from_enu_flu(q)
    assert one * np.sign(one @ many) == pytest.approx(many)
    back = np.array(frames.q_enu_flu_of_ned_frd(tuple(one)))
    assert back * np.sign(back @ q) == pytest.approx(q)
