"""What the planar SLAM knows of its sensors and of itself (modelling choices, tried on logs)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ReturnSettings:
    """Which returns of a scan count."""

    nearest_m: float = 0.05
    reach_m: float = 30.0
    apart_m: float = 0.04
    """Neighbouring returns nearer to each other than this say the same."""
    most: int = 360
    """Returns of a scan that are matched."""
    most_kept: int = 720
    """Returns of a keyframe."""


@dataclass(frozen=True)
class MatchingSettings:
    """How returns are compared with a map."""

    sigma_m: float = 0.03
    """Of a return about the wall that it met: range, angle, plaster."""
    gate_m: float = 0.4
    """A return farther than this from everything, at first, has met something new."""
    rounds: int = 12
    trust: float = 0.05
    """Share of the returns' information that is believed: their errors have the map's in common."""
    pull: float = 0.3
    """The same against the motion, while a scan is laid onto the map: a few returns of a corner
    must be able to hold it against a guess."""
    unclear: float = 0.01
    """Information along the weaker axis, as a share of that along the stronger one, that rough
    walls alone pretend: so much of it is not believed."""


@dataclass(frozen=True)
class MotionSettings:
    """How it may move."""

    accel_m2_s3: float = 0.3
    """Density of white acceleration of who has no odometry."""
    turn_rad2_s3: float = 1.0
    odometry_m: float = 0.002
    """Standard deviation of a step of the odometry at rest, m and rad, and its shares."""
    odometry_rad: float = 0.002
    odometry_per_m: float = 0.1
    odometry_rad_per_m: float = 0.08
    odometry_rad_per_rad: float = 0.1


@dataclass(frozen=True)
class KeyframeSettings:
    """Which scans become keyframes, and which of them the local map is made of."""

    step_m: float = 0.5
    step_rad: float = 0.35
    step_share: float = 0.75
    """So much less of a scan meets the map than just after the last keyframe."""
    least_m: float = 0.1
    least_rad: float = 0.1
    local_way: float = 10.0
    """Way, m, that the local map reaches back; a turn by 1 rad counts as 0.3 m."""
    local_most: int = 60


@dataclass(frozen=True)
class LoopClosureSettings:
    """When a place counts as seen again."""

    apart_m: float = 10.0
    """Way between a keyframe and one that it may be matched with."""
    around_m: float = 8.0
    """Old keyframes so near to each other are matched together."""
    query_m: float = 4.0
    """So much of the way just travelled is matched with them."""
    share: float = 0.85
    """Of the returns, as a share of how many usually do, that must meet something."""
    least_share: float = 0.42
    most_share: float = 0.62
    least_met: float = 40.0
    far_m: float = 0.5
    far_rad: float = 0.06
    """A closure that moves it farther must be confirmed by a second one."""
    again_m: float = 0.15
    again_rad: float = 0.03
    """How well two closures must agree, and over how much way at most."""
    again_way_m: float = 8.0


@dataclass(frozen=True)
class PlanarSettings:
    """All of them."""

    returns: ReturnSettings = ReturnSettings()
    fitting: MatchingSettings = MatchingSettings()
    moving: MotionSettings = MotionSettings()
    keeping: KeyframeSettings = KeyframeSettings()
    closing: LoopClosureSettings = LoopClosureSettings()
