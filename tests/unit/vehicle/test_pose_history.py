"""Looking back at where a UAV was."""

from __future__ import annotations

import numpy as np
import pytest

from volery.core import rotations
from volery.core.compiled import kernel
from volery.vehicle.pose_history import new_history, pose_at, record


@kernel
def fly(history, steps):
    position, attitude = np.zeros((2, 3)), np.zeros((2, 4))
    for step in range(1, steps + 1):
        t = step * 1e-3
        for i in range(2):
            position[i, 0] = (i + 1) * t
            attitude[i, 2] = np.sin(0.5 * t)
            attitude[i, 3] = np.cos(0.5 * t)
        record(history, step, position, attitude)


@kernel
def look(history, uav, time_ns):
    return pose_at(history, uav, time_ns)


def test_poses_between_steps_and_after_the_ring_has_gone_round():
    history = new_history(np.zeros((2, 3)), [[0, 0, 0, 1.0]] * 2, 1_000_000)
    fly(history, 200)
    for time_ns in (150_000_000, 170_250_000, 200_000_000):
        pose = np.array(look(history, 1, time_ns))
        assert pose[0] == pytest.approx(2e-9 * time_ns, abs=1e-12)
        np.testing.assert_allclose(pose[3:], rotations.from_rpy(0, 0, time_ns * 1e-9), atol=1e-9)


def test_a_fresh_history_holds_the_initial_state_and_opposite_signs_do_not_matter():
    history = new_history([[1, 2, 3.0]], [[0, 0, 0.6, 0.8]], 1_000_000)
    history.attitude[1::2] *= -1.0
    for time_ns in (0, 400_000, 5_000_000):
        pose = np.array(look(history, 0, time_ns))
        np.testing.assert_allclose(pose[:3], [1, 2, 3])
        np.testing.assert_allclose(np.abs(pose[5:]), [0.6, 0.8])
