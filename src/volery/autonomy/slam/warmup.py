"""Compiles the kernels of the 3D SLAM; see `volery.autonomy.perception.warmup`."""

from __future__ import annotations

import numpy as np

from volery.autonomy.slam import messages
from volery.autonomy.slam.inertial_kernels import STATES
from volery.autonomy.slam.keyframes import Keyframe
from volery.autonomy.slam.kidnapping_detection import KidnappingDetector
from volery.autonomy.slam.local_maps import Submaps
from volery.autonomy.slam.loop_closure import LoopCloser
from volery.autonomy.slam.matching_kernels import GROUND, UPRIGHT
from volery.autonomy.slam.recovery import Recovery
from volery.autonomy.slam.settings import GRAVITY_M_S2, ScanMatching
from volery.autonomy.slam.sweep import Sweep
from volery.autonomy.slam.tracker import Tracker
from volery.core import rotations
from volery.core.arrays import read_only
from volery.core.clock import NS_PER_S

_PERIOD_NS = NS_PER_S // 200
_NUM_STATIONARY = 100
"""Number of IMU samples until it has stood still for half a second."""


def motion() -> None:
    """Compiles the kernels of the filter: standing still, and a sweep."""
    tracker = Tracker(np.zeros(4))
    readings = iter(range(0, 10 * NS_PER_S, _PERIOD_NS))

    def feel(count: int) -> None:
        for _, time_ns in zip(range(count), readings, strict=False):
            tracker.add_imu(time_ns, np.zeros(3), np.array([0.0, 0.0, GRAVITY_M_S2]))

    feel(2 * _NUM_STATIONARY)
    assert tracker.is_ready
    ranges = read_only(np.array([1.0, 2.0, np.inf], np.float32))
    tracker.add_sweep(Sweep("level", tracker.time_ns, 1e6, 0.0, 0.1, ranges, np.zeros(3)))
    feel(2)
    assert "level" in tracker.match
    level = tracker.state[:3], rotations.IDENTITY, np.zeros(3), np.zeros(3)
    messages.odometry(0, "uav1", level, tracker.covariance[:9, :9])


def loop_closure() -> None:
    """Compiles the kernels of loop closures: a keyframe is matched with older ones."""
    grid = np.stack(np.meshgrid(*2 * (np.linspace(-5.0, 5.0, 10),)), -1).reshape(-1, 2)
    points = np.column_stack([grid, np.zeros(len(grid))])
    kinds = np.where(np.arange(len(grid)) % 4, UPRIGHT, GROUND).astype(np.int8)
    frames = [
        Keyframe(k, np.zeros(3), rotations.IDENTITY.copy(), 0.0, points, kinds, 0) for k in range(8)
    ]
    poses = [np.zeros(4) for _ in frames]
    LoopCloser(ScanMatching()).match(frames, poses, len(frames) - 1, 0, (0.4, 0.01))


def sight() -> None:
    """Compiles the kernels that detect kidnapping: half of the returns have moved."""
    before = np.column_stack([np.linspace(-20.0, 20.0, 80), np.zeros(80)])
    now = before + np.where(np.arange(80) % 2, 3.0, 0.0)[:, None] * np.array([0.0, 1.0])
    eyes = KidnappingDetector()
    for time_ns, points in ((0, before), (NS_PER_S // 4, now)):
        eyes.take(time_ns, points, np.zeros(2), is_level=True)


def lost_motion() -> None:
    """Compiles the kernels that recover attitude and position."""
    recovery, maps, points = Recovery(), Submaps.empty(), np.ones((1, 3))
    state, states = np.zeros(19), np.zeros((2, 19))
    state[9] = 1.0
    aslant = np.eye(STATES)
    for covariance in (aslant, aslant, 0.0 * aslant):
        recovery.find(state, covariance, states, maps, points)
