"""Tracks the motion of a vehicle: an inertial filter corrected by LIDARs and sonar.

All poses are in the frame of the odometry, which begins at the start pose and never jumps when
later data corrects the map; the pose graph corrects it in the map.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.inertial_kernels import STATE_NUMBERS, STATES, P, Q, V, move, remember
from volery.autonomy.slam.kidnapping_detection import KidnappingDetector
from volery.autonomy.slam.local_maps import Submaps
from volery.autonomy.slam.match import Match, judged
from volery.autonomy.slam.matching_kernels import (
    UPRIGHT,
    broad_plane,
    carry_along,
    classify,
    insert,
    seed_ground,
    update,
)
from volery.autonomy.slam.recovery import GAP_S, Recovery
from volery.autonomy.slam.settings import ImuNoise, ScanMatching
from volery.autonomy.slam.stationarity import (
    StationaryDetector,
    first_covariance,
    first_state,
    hold_still,
)
from volery.autonomy.slam.sweep import Sweep, SweepPoints
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.rotation_kernels import moved_points
from volery.core.saved_state import SavedAttributes
from volery.core.vectors import norm

_KEPT = 64
"""Number of IMU samples whose states are stored to place beams: 0.3 s at 200 Hz."""
_STATIONARY_M_S, _STATIONARY_NS = 0.3, 2 * NS_PER_S
"""Max estimated speed, or min time near the ground, of a quiet vehicle that counts as standing."""
_SHOCK_M_S2 = 30.0
"""Acceleration of a collision: a sample's error may then be as large as its value."""
_LOW_M = 0.35
"""Max range of the sonar while the vehicle stands."""
_DRAWN_M = 0.1
"""Max standard deviation of a position from which uprights are inserted."""
_RECENT_NS = NS_PER_S
"""Max age of a sonar range that gives the ground height."""


class Tracker(SavedAttributes):
    """Holds the filter, its maps, and the sweeps that wait for the motion during them.

    `start` (4,): x, y, z in m and yaw in rad of the start pose. Tracking begins after half a second
    at rest, from gravity.
    """

    STATE = (
        "state", "covariance", "is_ready", "is_stationary", "has_flown", "match", "sight",
        "landed_height_m", "travelled_m", "recovery", "_times", "_states", "_imu", "_waiting",
        "_maps", "_inserted", "_rest", "settling", "_broad", "_near_ground_ns", "_low_since_ns",
        "_range", "_stationary_ns", "_is_high", "refused",
    )  # fmt: skip

    def __init__(
        self, start: Array, imu: ImuNoise | None = None, matching: ScanMatching | None = None
    ) -> None:
        self.imu_noise, self.matching = imu or ImuNoise(), matching or ScanMatching()
        self.start = np.asarray(start, np.float64)
        self.state = np.zeros(STATE_NUMBERS)
        self.state[Q + 3] = 1.0
        self.covariance = np.zeros((STATES, STATES))
        self.is_ready = self.is_stationary = self.has_flown = False
        self.match: dict[str, Match] = {}
        self.sight = KidnappingDetector()
        self.landed_height_m = 0.2
        self.travelled_m = 0.0
        self.refused = 0
        self._times = np.zeros(_KEPT, np.int64)
        self._states = np.zeros((_KEPT, STATE_NUMBERS))
        self._imu: tuple[int, Array, Array] | None = None
        self.recovery = Recovery()
        self._waiting: deque[Sweep] = deque()
        self._maps = Submaps.empty()
        self._inserted: dict[str, tuple[int, Array, float]] = {}
        self._rest = StationaryDetector()
        self.settling = rotations.IDENTITY.copy()
        """Rotation between the first sample and the start, (4,) in body axes."""
        self._broad = np.zeros(6)
        self._near_ground_ns: int | None = None
        self._low_since_ns: int | None = None
        self._range: tuple[int, float] | None = None
        self._stationary_ns = 0
        self._is_high = False
        """Whether the sonar indicates flight: a hover is as quiet as standing."""
        n = self.imu_noise
        self._noise = np.array(
            [n.gyro_rad_s_sqrt_hz, n.accel_m_s2_sqrt_hz, n.gyro_walk_rad_s2_sqrt_hz,
             n.accel_walk_m_s3_sqrt_hz, self.matching.gravity_walk_rad_sqrt_s]
        )  # fmt: skip

    # ------------------------------------------------------------------------------------ samples

    @property
    def time_ns(self) -> int:
        """Time of the state, ns."""
        return 0 if self._imu is None else self._imu[0]

    @property
    def is_astray(self) -> bool:
        """Whether a gap in the IMU data has made the pose in the own maps uncertain."""
        return self.recovery.since_ns is not None

    @property
    def _is_aslant(self) -> bool:
        return self.recovery.is_aslant(self.covariance)

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the horizontal position, in the worse of x and y, m."""
        return math.sqrt(float(max(self.covariance[0, 0], self.covariance[1, 1])))

    def add_imu(self, time_ns: int, gyro: Array, accel: Array) -> list[SweepPoints]:
        """Propagates to a sample (rad/s, m/s^2, body axes); returns the sweeps due by then."""
        if self._imu is not None and time_ns <= self._imu[0]:
            self.refused += 1
            return []
        before, self._imu = self._imu, (time_ns, gyro, accel)
        self._rest.add(gyro, accel)
        if not self.is_ready:
            self._rest.add_turn(time_ns, gyro)
            self._try_to_begin(time_ns)
            return []
        if before is not None:
            self._move(before, time_ns, gyro, accel)
        self._keep_still(time_ns)
        done = []
        while self._waiting and self._waiting[0].last_ns <= time_ns:
            seen = self._take_in(self._waiting.popleft())
            if seen is not None:
                done.append(seen)
        return done

    def add_sweep(self, sweep: Sweep) -> None:
        """Queues a sweep until the motion up to its end is known."""
        if not self.is_ready:
            return
        self._waiting.append(sweep)
        while len(self._waiting) > 8:
            self._waiting.popleft()
            self.refused += 1

    def add_range(self, time_ns: int, distance: float) -> None:
        """Adds a range of the sonar below, m; -inf: too near."""
        self._is_high = distance >= _LOW_M
        if distance < _LOW_M:
            self._near_ground_ns = time_ns
            self._low_since_ns = self._low_since_ns or time_ns
            return
        self._low_since_ns = None
        if math.isfinite(distance) and self.is_ready and self.has_flown:
            self._near_ground_ns = None
            self._range = time_ns, distance
            self._seed_below(distance)

    def _move(
        self, before: tuple[int, Array, Array], time_ns: int, gyro: Array, accel: Array
    ) -> None:
        dt = (time_ns - before[0]) / NS_PER_S
        here = self.state[:3].copy()
        mean_gyro, mean_accel = 0.5 * (before[1] + gyro), 0.5 * (before[2] + accel)
        known = min(dt, GAP_S)
        move(self.state, self.covariance, mean_gyro, mean_accel, known, self._noise)
        shock = math.hypot(*accel)
        if shock > _SHOCK_M_S2:
            self.covariance[np.arange(3, 6), np.arange(3, 6)] += (shock * known) ** 2
        if dt > known:
            span = before[0], time_ns
            self.recovery.coast(self.state, self.covariance, span, dt - known, self._noise)
        self.recovery.keep_upright(self.state, self.covariance, time_ns)
        self.travelled_m += float(np.hypot(*(self.state[:2] - here[:2])))
        remember(self._times, self._states, time_ns, self.state)

    # -------------------------------------------------------------------------------------- at rest

    def _try_to_begin(self, time_ns: int) -> None:
        if self._is_high or not self._rest.is_quiet():
            return
        self.settling = self._rest.turned_before()
        self.state[:] = first_state(self.start, self._rest.mean_accel(), self.settling)
        turn = rotations.matrix(self.state[Q : Q + 4])
        self.covariance[:] = first_covariance(self.imu_noise, turn)
        self._stay(time_ns)
        self.is_ready = self.is_stationary = True
        normal = turn[:, 2]
        x, y, z = self.start[:3] - self.landed_height_m * normal
        self._broad[:] = (z, -normal[0] / normal[2], -normal[1] / normal[2], x, y, z)
        seed_ground(self._maps.ground_keys, self._maps.sums, float(x), float(y), float(z))

    def _stay(self, time_ns: int) -> None:
        """Fills the stored states with the current one."""
        self._stationary_ns = time_ns
        self._times[:] = time_ns - np.arange(_KEPT)[::-1] * 1_000_000
        self._states[:] = self.state

    def _keep_still(self, time_ns: int) -> None:
        """Applies zero velocity and the gyroscope's bias while the vehicle stands."""
        if time_ns - self._stationary_ns < NS_PER_S // 10:
            return
        self._stationary_ns = time_ns
        long = self._low_since_ns is not None and time_ns - self._low_since_ns > _STATIONARY_NS
        low = not self.has_flown or (
            self._near_ground_ns is not None
            and (long or norm(self.state[V : V + 3]) < _STATIONARY_M_S)
        )
        self.is_stationary = low and self._rest.is_quiet()
        if self.is_stationary:
            hold_still(self.state, self.covariance, self._rest.mean_gyro(), self.imu_noise)
        else:
            self.has_flown = True

    # ------------------------------------------------------------------------------------ sweeps

    def _take_in(self, sweep: Sweep) -> SweepPoints | None:
        m = self.matching
        in_gap = self.recovery.is_in_gap(sweep.first_ns, sweep.last_ns)
        if sweep.first_ns < self._times[0] or in_gap:
            self.refused += 1
            return None
        points = sweep.points(m.nearest_m, m.max_range_m, self._times, self._states)
        if self.is_astray:
            self.sight = KidnappingDetector()
            if not self.recovery.find(
                self.state, self.covariance, self._states, self._maps, points
            ):
                return None
        maps, slope = self._maps, self._broad[1:3].copy()
        known = broad_plane(self.state, maps.ground_keys, maps.sums, 6, slope, self._broad)
        kinds, planes = np.empty(len(points), np.int8), np.zeros((len(points), 3))
        self._classify(points, kinds, planes, known)
        sums, information = np.zeros(4), np.zeros((6, 6))
        before = self.state.copy()
        update(
            self.state, self.covariance, points, kinds, planes, maps,
            m.upright_sigma_m**2, m.ground_sigma_m**2, m.trust, m.rounds, information, sums,
        )  # fmt: skip
        carry_along(self._states, before, self.state)
        self.match[sweep.name] = judged(sums, self.match.get(sweep.name), self.time_ns)
        is_drawn = self._draw(sweep, points, kinds)
        turned = moved_points(points, self.state[Q : Q + 4], self.state[:3])
        if self.has_flown:
            uprights = turned[kinds == UPRIGHT, :2]
            self.sight.take(self.time_ns, uprights, self.state[:2], is_level=not sweep.nods)
        return SweepPoints(turned, kinds, is_drawn)

    def _classify(self, points: Array, kinds: NDArray[np.int8], planes: Array, known: int) -> None:
        maps = self._maps
        classify(points, self.state, maps.ground_keys, maps.sums, self._broad, known, kinds, planes)

    def _draw(self, sweep: Sweep, points: Array, kinds: NDArray[np.int8]) -> bool:
        """Inserts returns into the map; uprights only from a new pose, or after a while."""
        m, yaw = self.matching, float(rotations.yaw_of(self.state[Q : Q + 4]))
        last = self._inserted.get(sweep.name)
        is_new = (
            last is None
            or norm(self.state[:3] - last[1]) > m.insert_m
            or abs(math.remainder(yaw - last[2], math.tau)) > m.insert_rad
            or self.time_ns - last[0] > m.insert_s * NS_PER_S
        )
        # Else a wrong pose would become part of the map.
        is_new = is_new and self.match[sweep.name].fits and self.sigma_m < _DRAWN_M
        if is_new:
            self._inserted[sweep.name] = (self.time_ns, self.state[:3].copy(), yaw)
        insert(points, kinds, self.state, is_new, self._maps)
        return is_new

    def _seed_below(self, distance: float) -> None:
        """Seeds the ground map from the sonar if no LIDAR has observed the ground below."""
        maps, plane = self._maps, np.zeros(6)
        slope = self._broad[1:3].copy()
        if broad_plane(self.state, maps.ground_keys, maps.sums, 2, slope, plane) > 0:
            return
        x, y, z = (float(v) for v in self.state[P : P + 3])
        seed_ground(maps.ground_keys, maps.sums, x, y, z - distance)

    def set_clock(self, time_ns: int) -> None:
        """Continues from here at another time; drops waiting sweeps."""
        self._imu = None
        self._waiting.clear()
        self._rest.forget()
        self._near_ground_ns = self._low_since_ns = self._range = None
        self.recovery = Recovery()
        self._stay(time_ns)

    def restart(self, speed_sigma: float, turn_sigma: float) -> None:
        """Clears the maps and continues in new ones.

        `speed_sigma`, m/s, and `turn_sigma`, rad about each axis, are the standard deviations of
        velocity and attitude by now.
        """
        self._maps = Submaps.empty()
        self._inserted, self.match, self.sight = {}, {}, KidnappingDetector()
        self.covariance[:3] = self.covariance[:, :3] = 0.0
        self.covariance[np.arange(3), np.arange(3)] = 1e-4
        self.covariance[np.arange(3, 6), np.arange(3, 6)] += speed_sigma**2
        self.covariance[np.arange(6, 9), np.arange(6, 9)] += turn_sigma**2
        self.recovery = Recovery(self.time_ns if self._is_aslant else None)
        if self._range is not None and self.time_ns - self._range[0] < _RECENT_NS:
            self._seed_below(self._range[1])

    # ------------------------------------------------------------------------------------- state
