"""Following the motion of a vehicle: an inertial filter that LIDARs and sonar correct.

Everything is in the frame of the odometry, which begins where the vehicle began and never jumps by
what is learnt later on; the pose graph corrects it in the map.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any

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
from volery.core.clock import NS_PER_S
from volery.core.rotation_kernels import moved_points
from volery.core.saved_state import restore_attributes, save_attributes
from volery.core.vectors import norm

Array = NDArray[np.float64]

_KEPT = 64
"""IMU readings by whose states beams are placed: 0.3 s at 200 Hz."""
_STANDING_M_S, _STANDING_NS = 0.3, 2 * NS_PER_S
"""Who believes to be slower, or is near the ground for so long, and is quiet, stands."""
_SHOCK_M_S2 = 30.0
"""Beyond this it hits something: a reading then may be as far off as it is large."""
_LOW_M = 0.35
"""What the sonar says at most where the vehicle stands."""
_DRAWN_M = 0.1
"""What stands is drawn from places that are known so well."""
_RECENT_NS = NS_PER_S
"""A reading of the sonar that is younger tells where the ground is."""


class Tracker:
    """The filter, its maps, and the sweeps that wait for the motion that they were made in.

    `start` (4,): x, y, z in m and yaw in rad where it begins. It begins after standing still for
    half a second, from gravity.
    """

    _STATE = (
        "state", "covariance", "is_ready", "is_standing", "has_flown", "match", "sight",
        "standing_height", "travelled_m", "recovery", "_times", "_states", "_imu", "_waiting",
        "_maps", "_inserted", "_rest", "settling", "_broad", "_near_ground_ns", "_low_since_ns",
        "_range", "_standing_ns", "_is_high", "refused",
    )  # fmt: skip

    def __init__(
        self, start: Array, imu: ImuNoise | None = None, matching: ScanMatching | None = None
    ) -> None:
        self.imu_noise, self.matching = imu or ImuNoise(), matching or ScanMatching()
        self.start = np.asarray(start, np.float64)
        self.state = np.zeros(STATE_NUMBERS)
        self.state[Q + 3] = 1.0
        self.covariance = np.zeros((STATES, STATES))
        self.is_ready = self.is_standing = self.has_flown = False
        self.match: dict[str, Match] = {}
        self.sight = KidnappingDetector()
        self.standing_height = 0.2
        self.travelled_m = 0.0
        self.refused = 0
        self._times = np.zeros(_KEPT, np.int64)
        self._states = np.zeros((_KEPT, STATE_NUMBERS))
        self._imu: tuple[int, Array, Array] | None = None
        self.recovery = Recovery()
        self._waiting: deque[Sweep] = deque()
        self._maps = Submaps()
        self._inserted: dict[str, tuple[int, Array, float]] = {}
        self._rest = StationaryDetector()
        self.settling = rotations.IDENTITY.copy()
        """How it turned on its feet from the first reading on, (4,) in its own axes."""
        self._broad = np.zeros(6)
        self._near_ground_ns: int | None = None
        self._low_since_ns: int | None = None
        self._range: tuple[int, float] | None = None
        self._standing_ns = 0
        self._is_high = False
        """Whether the sonar says that it flies: a hover is as quiet as standing."""
        n = self.imu_noise
        self._noise = np.array(
            [n.gyro_rad_s_sqrt_hz, n.accel_m_s2_sqrt_hz, n.gyro_walk_rad_s2_sqrt_hz,
             n.accel_walk_m_s3_sqrt_hz, self.matching.gravity_walk_rad_sqrt_s]
        )  # fmt: skip

    # ---------------------------------------------------------------------------------- readings

    @property
    def time_ns(self) -> int:
        """Time of the state."""
        return 0 if self._imu is None else self._imu[0]

    @property
    def is_astray(self) -> bool:
        """Whether a gap in the IMU's readings has left open where it is in its own maps."""
        return self.recovery.since_ns is not None

    @property
    def _is_aslant(self) -> bool:
        return self.recovery.is_aslant(self.covariance)

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the place in the plane, in its worse direction of x and y."""
        return math.sqrt(float(max(self.covariance[0, 0], self.covariance[1, 1])))

    def add_imu(self, time_ns: int, gyro: Array, accel: Array) -> list[SweepPoints]:
        """Carry the state on to a reading (rad/s, m/s^2, body axes); what sweeps were due then."""
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
        """Take in a sweep as soon as the motion until its end is known."""
        if not self.is_ready:
            return
        self._waiting.append(sweep)
        while len(self._waiting) > 8:
            self._waiting.popleft()
            self.refused += 1

    def add_range(self, time_ns: int, distance: float) -> None:
        """A reading of the sonar below, m; -inf: too near."""
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

    # ---------------------------------------------------------------------------------- standing

    def _try_to_begin(self, time_ns: int) -> None:
        if self._is_high or not self._rest.is_quiet():
            return
        self.settling = self._rest.turned_before()
        self.state[:] = first_state(self.start, self._rest.mean_accel(), self.settling)
        turn = rotations.matrix(self.state[Q : Q + 4])
        self.covariance[:] = first_covariance(self.imu_noise, turn)
        self._stay(time_ns)
        self.is_ready = self.is_standing = True
        normal = turn[:, 2]
        x, y, z = self.start[:3] - self.standing_height * normal
        self._broad[:] = (z, -normal[0] / normal[2], -normal[1] / normal[2], x, y, z)
        seed_ground(self._maps.ground_keys, self._maps.sums, float(x), float(y), float(z))

    def _stay(self, time_ns: int) -> None:
        """Let it have been here for all the time that states are kept."""
        self._standing_ns = time_ns
        self._times[:] = time_ns - np.arange(_KEPT)[::-1] * 1_000_000
        self._states[:] = self.state

    def _keep_still(self, time_ns: int) -> None:
        """While it stands its velocity is zero, and the gyroscope tells its bias."""
        if time_ns - self._standing_ns < NS_PER_S // 10:
            return
        self._standing_ns = time_ns
        long = self._low_since_ns is not None and time_ns - self._low_since_ns > _STANDING_NS
        low = not self.has_flown or (
            self._near_ground_ns is not None
            and (long or norm(self.state[V : V + 3]) < _STANDING_M_S)
        )
        self.is_standing = low and self._rest.is_quiet()
        if self.is_standing:
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
        points = sweep.points(m.nearest_m, m.reach_m, self._times, self._states)
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
        told, information = np.zeros(4), np.zeros((6, 6))
        before = self.state.copy()
        update(
            self.state, self.covariance, points, kinds, planes, maps.upright_keys, maps.cells,
            m.upright_sigma_m**2, m.ground_sigma_m**2, m.trust, m.rounds, information, told,
        )  # fmt: skip
        carry_along(self._states, before, self.state)
        self.match[sweep.name] = judged(told, self.match.get(sweep.name), self.time_ns)
        is_drawn = self._draw(sweep, points, kinds)
        turned = moved_points(points, self.state[Q : Q + 4], self.state[:3])
        if self.has_flown:
            standing = turned[kinds == UPRIGHT, :2]
            self.sight.take(self.time_ns, standing, self.state[:2], is_level=not sweep.nods)
        return SweepPoints(turned, kinds, is_drawn)

    def _classify(self, points: Array, kinds: NDArray[np.int8], planes: Array, known: int) -> None:
        maps = self._maps
        classify(points, self.state, maps.ground_keys, maps.sums, self._broad, known, kinds, planes)

    def _draw(self, sweep: Sweep, points: Array, kinds: NDArray[np.int8]) -> bool:
        """Let returns enter the map; uprights only of sweeps from a new place, or after a while."""
        m, maps, yaw = self.matching, self._maps, float(rotations.yaw_of(self.state[Q : Q + 4]))
        last = self._inserted.get(sweep.name)
        is_new = (
            last is None
            or norm(self.state[:3] - last[1]) > m.insert_m
            or abs(math.remainder(yaw - last[2], math.tau)) > m.insert_rad
            or self.time_ns - last[0] > m.insert_s * NS_PER_S
        )
        # Or a wrong place would become the right one.
        is_new = is_new and self.match[sweep.name].fits and self.sigma_m < _DRAWN_M
        if is_new:
            self._inserted[sweep.name] = (self.time_ns, self.state[:3].copy(), yaw)
        insert(
            points, kinds, self.state, is_new, maps.upright_keys, maps.cells, maps.ground_keys,
            maps.sums,
        )  # fmt: skip
        return is_new

    def _seed_below(self, distance: float) -> None:
        """Where no LIDAR has seen ground below, the sonar tells of it."""
        maps, plane = self._maps, np.zeros(6)
        slope = self._broad[1:3].copy()
        if broad_plane(self.state, maps.ground_keys, maps.sums, 2, slope, plane) > 0:
            return
        x, y, z = (float(v) for v in self.state[P : P + 3])
        seed_ground(maps.ground_keys, maps.sums, x, y, z - distance)

    def set_clock(self, time_ns: int) -> None:
        """Go on from here at another time; what waits is given up."""
        self._imu = None
        self._waiting.clear()
        self._rest.forget()
        self._near_ground_ns = self._low_since_ns = self._range = None
        self.recovery = Recovery()
        self._stay(time_ns)

    def begin_anew(self, speed_sigma: float, turn_sigma: float) -> None:
        """Forget the maps, and follow the motion in new ones.

        `speed_sigma`, m/s, and `turn_sigma`, rad about each axis, are how far velocity and attitude
        may be off by now.
        """
        self._maps = Submaps()
        self._inserted, self.match, self.sight = {}, {}, KidnappingDetector()
        self.covariance[:3] = self.covariance[:, :3] = 0.0
        self.covariance[np.arange(3), np.arange(3)] = 1e-4
        self.covariance[np.arange(3, 6), np.arange(3, 6)] += speed_sigma**2
        self.covariance[np.arange(6, 9), np.arange(6, 9)] += turn_sigma**2
        self.recovery = Recovery(self.time_ns if self._is_aslant else None)
        if self._range is not None and self.time_ns - self._range[0] < _RECENT_NS:
            self._seed_below(self._range[1])

    # ------------------------------------------------------------------------------------- state

    def get_state(self) -> dict[str, Any]:
        """What a snapshot keeps."""
        return save_attributes(self, self._STATE)

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a kept state."""
        restore_attributes(self, state)
