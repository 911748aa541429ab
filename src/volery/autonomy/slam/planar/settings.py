"""Parameters of the planar SLAM (modelling choices, tuned on logs)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ReturnSettings:
    """Selection of a scan's returns."""

    nearest_m: float = 0.05
    max_range_m: float = 30.0
    apart_m: float = 0.04
    """Neighbouring returns nearer to each other than this are redundant."""
    max_points: int = 360
    """Max number of returns of a scan that are matched."""
    max_keyframe_points: int = 720
    """Max number of returns of a keyframe."""


@dataclass(frozen=True)
class MatchingSettings:
    """Comparison of returns with a map."""

    sigma_m: float = 0.03
    """Standard deviation of a return about its wall: range, angle, plaster."""
    gate_m: float = 0.4
    """Initial max distance of a match; a return farther from all cells is new."""
    rounds: int = 12
    trust: float = 0.05
    """Fraction of the returns' information that is used: their errors are correlated with the
    map's.
    """
    pull: float = 0.3
    """The same fraction relative to the motion, while a scan is matched: a few returns of a corner
    must outweigh a prediction.
    """
    unclear: float = 0.01
    """Information along the weaker axis, as a fraction of that along the stronger one, that rough
    walls alone produce: it is subtracted.
    """


@dataclass(frozen=True)
class MotionSettings:
    """Motion model."""

    accel_m2_s3: float = 0.3
    """Density of the white acceleration without odometry."""
    turn_rad2_s3: float = 1.0
    odometry_m: float = 0.002
    """Standard deviation of an odometry step at rest, m and rad, and its fractions of the
    motion.
    """
    odometry_rad: float = 0.002
    odometry_per_m: float = 0.1
    odometry_rad_per_m: float = 0.08
    odometry_rad_per_rad: float = 0.1


@dataclass(frozen=True)
class KeyframeSettings:
    """Selection of keyframes, and of those in the local map."""

    step_m: float = 0.5
    step_rad: float = 0.35
    step_fraction: float = 0.75
    """Matched fraction, relative to that after the last keyframe, below which a keyframe is due."""
    min_m: float = 0.1
    min_rad: float = 0.1
    max_local_travelled: float = 10.0
    """Distance, m, that the local map covers; a rotation by 1 rad counts as 0.3 m."""
    max_local_keyframes: int = 60


@dataclass(frozen=True)
class LoopClosureSettings:
    """Acceptance of loop closures."""

    apart_m: float = 10.0
    """Min distance travelled between a keyframe and a loop closure candidate."""
    around_m: float = 8.0
    """Radius within which old keyframes are matched together."""
    query_m: float = 4.0
    """Distance travelled whose keyframes are matched with them."""
    fraction: float = 0.85
    """Min matched fraction, relative to the usual one."""
    min_fraction: float = 0.42
    max_fraction: float = 0.62
    min_matches: float = 40.0
    far_m: float = 0.5
    far_rad: float = 0.06
    """A closure that moves the keyframe farther needs confirmation by a second one."""
    again_m: float = 0.15
    again_rad: float = 0.03
    """Max difference of two closures, and max distance travelled between them."""
    max_travelled_m: float = 8.0


@dataclass(frozen=True)
class PlanarSettings:
    """All parameters."""

    returns: ReturnSettings = ReturnSettings()
    fitting: MatchingSettings = MatchingSettings()
    moving: MotionSettings = MotionSettings()
    keeping: KeyframeSettings = KeyframeSettings()
    loop_closure: LoopClosureSettings = LoopClosureSettings()
