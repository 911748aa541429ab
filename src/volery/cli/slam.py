"""`volery slam`: runs the SLAM over a log and writes its map and path as files."""

from __future__ import annotations

import json
import math
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from volery.cli.error_reporting import warn
from volery.cli.output_paths import check_folder
from volery.cli.terminal import echo_line
from volery.core.errors import RecordingError, VoleryError
from volery.core.plurals import counted
from volery.core.whole_files import write_whole

if TYPE_CHECKING:
    from volery.runtime.replay.slam.initial_pose import Pose
    from volery.runtime.replay.slam.offline_slam import OfflineSlam, SlamOptions, SlamResult
    from volery.runtime.replay.slam.sources import LogSource, TextSource

_MAPS = ("map.png", "map.pgm", "map.yaml")
_NAMES = (*_MAPS, "path.tum", "summary.json")
_PLAIN_PERIOD_S = 10.0
"""Time between lines of progress if stderr is no terminal."""
_MAX_RATIO, _MIN_DIFFERENCE_M = 5.0, 5.0
"""Paths by odometry and by scans that differ by more than this factor and distance are
inconsistent."""
_DEGRADED = 0.1
"""Fraction of the log's time with poor tracking above which an unused IMU is suggested."""


@dataclass(frozen=True)
class SlamArguments:
    """Holds the options as they were typed."""

    log: Path
    out: Path
    layout: Path | None
    uav: str | None
    scan: str | None
    odometry: str | None
    imu_topic: str | None
    has_odometry: bool
    has_imu: bool | None
    start: str | None
    level_mount: str | None
    nodding_mount: str | None
    resolution: float
    max_range: float
    loops: bool
    overwrite: bool


def map_log(args: SlamArguments) -> None:
    """Runs the SLAM over a log, writes its results and prints a summary."""
    from volery.bridges.logs.text_layout import TextLayout
    from volery.runtime.replay.slam.offline_slam import SlamOptions
    from volery.runtime.replay.slam.sources import open_source
    from volery.runtime.replay.slam.topic_selection import RequestedTopics, other_uavs
    from volery.scenario.data_files import load_data_file

    _check_folder(args.out, overwrite=args.overwrite)
    layout = None if args.layout is None else load_data_file(args.layout, TextLayout)
    source = open_source(args.log, layout)
    topics = RequestedTopics(
        args.uav, args.scan, args.odometry, args.imu_topic, args.has_odometry, args.has_imu
    )
    start = _numbers(args.start, 4, "--initial-pose")
    options = SlamOptions(
        topics,
        None if start is None else (*start[:3], math.radians(start[3])),
        _numbers(args.level_mount, 3, "--level-mount"),
        _numbers(args.nodding_mount, 3, "--nodding-mount"),
        args.max_range,
        args.loops,
    )
    run = _run(source, options)
    others = other_uavs(source.topics, run.channels.uav)
    echo_line(f"mapping {args.log}{_beginning(run.start, start)}", err=True)
    if others and args.uav is None and args.scan is None:
        warn(f"mapping {run.channels.uav}; the log also has {', '.join(others)}: select with --uav")
    try:
        outcome = run.run(_Progress().show)
    finally:  # a problem of the log often explains why the SLAM failed
        for problem in filter(None, (source.problem, *source.warnings)):
            warn(f"{args.log}: {problem}")
    cell_m = _write(args, outcome)
    _print_summary(args.out, _summary(args, outcome, source.refused, cell_m, run.start))
    _advise(outcome, source.topics)
    _compare_path_lengths(outcome)


def _run(source: LogSource | TextSource, options: SlamOptions) -> OfflineSlam:
    """Returns the SLAM, ready to start; errors say whether the log is damaged."""
    from volery.runtime.replay.slam.offline_slam import OfflineSlam

    try:
        return OfflineSlam(source, options)
    except RecordingError as error:
        if not source.damage:
            raise
        raise RecordingError(f"{error}; the log is {source.damage}") from None


def _beginning(start: Pose | None, start_option: Pose | None) -> str:
    """Returns the initial pose as text if the log defines one."""
    if start is None or start_option is not None:
        return ""
    x, y, z, yaw = _in_degrees(start)
    return (
        f" from {x:g}, {y:g}, {z:g} m, {yaw:g} degrees, from the log; --initial-pose overrides it"
    )


def _in_degrees(start: Pose | None) -> tuple[float, float, float, float]:
    """Returns x, y, z, m, and yaw, degrees, for messages; the map's origin if unknown."""
    x, y, z, yaw = start or (0.0, 0.0, 0.0, 0.0)
    return round(x, 2), round(y, 2), round(z, 2), round(math.degrees(yaw), 1)


class _Progress:
    """Prints the progress, at long intervals if stderr is no terminal."""

    def __init__(self) -> None:
        self._shown_at = time.monotonic()

    def show(self, scans: int, seconds: float) -> None:
        """Prints how much has been read."""
        now = time.monotonic()
        if sys.stderr.isatty() or now - self._shown_at >= _PLAIN_PERIOD_S:
            self._shown_at = now
            echo_line(f"{counted(scans, 'scan')}, {seconds:.0f} s of the log", err=True)


def _advise(outcome: SlamResult, topics: dict[str, str]) -> None:
    """Suggests the log's IMU if it was not used and tracking was poor."""
    from volery.runtime.replay.slam.topic_selection import IMU

    total = sum(outcome.states.values())
    poor = outcome.states.get("degraded", 0.0) + outcome.states.get("lost", 0.0)
    imus = sorted(topic for topic, kind in topics.items() if kind == IMU)
    if imus and not outcome.channels.has_imu and poor > _DEGRADED * total:
        warn(
            f"degraded or lost for {poor / total:.0%} of the time, in the plane; if the vehicle "
            f"leans or flies, the log's IMU ({', '.join(imus)}) may help: --imu"
        )


def _compare_path_lengths(outcome: SlamResult) -> None:
    """Warns if the path lengths by odometry and by scans contradict each other."""
    wheels, seen = outcome.wheels_m, outcome.trajectory.length_m
    if wheels is None or abs(wheels - seen) < _MIN_DIFFERENCE_M:
        return
    if max(wheels, seen) > _MAX_RATIO * min(wheels, seen):
        warn(
            f"the path is {wheels:.1f} m long by odometry, by scans "
            f"{seen:.1f} m: check the units, or use --no-odometry"
        )


def _check_folder(out: Path, *, overwrite: bool) -> None:
    there = [name for name in _NAMES if (out / name).exists()]
    if there and not overwrite:
        raise RecordingError(f"{out / there[0]} exists; --overwrite replaces it")
    check_folder(out, "the map")


def _numbers(text: str | None, count: int, option: str) -> Any:
    """Parses the numbers of an option, separated by commas or blanks."""
    if text is None:
        return None
    try:
        found = tuple(float(word) for word in text.replace(",", " ").split())
    except ValueError:
        found = ()
    if len(found) != count or not all(map(math.isfinite, found)):
        raise VoleryError(f"{option}: expects {count} numbers, such as '{','.join(['0'] * count)}'")
    return found


def _write(args: SlamArguments, outcome: SlamResult) -> float | None:
    """Writes the path, and the map if there is one; returns the width of its cells, m."""
    from volery.runtime.replay.slam.trajectory import write_tum

    args.out.mkdir(parents=True, exist_ok=True)
    for name in _MAPS:
        (args.out / name).unlink(missing_ok=True)
    write_tum(args.out / "path.tum", outcome.trajectory)
    try:
        return _write_map(args, outcome)
    except RecordingError as error:
        warn(f"no map is written: {error}")
        return None


def _write_map(args: SlamArguments, outcome: SlamResult) -> float:
    from volery.autonomy.mapping.grid_files import write_grid
    from volery.runtime.replay.slam.map_image import write_image
    from volery.runtime.replay.slam.map_rendering import draw_map

    grid = draw_map(outcome, args.resolution, args.max_range)
    if grid.cell_m > args.resolution:
        rows, columns = grid.odds.shape
        warn(
            f"the map is {columns * grid.cell_m:.0f} m x {rows * grid.cell_m:.0f} m, too large for "
            f"cells of {args.resolution:g} m: cells are {grid.cell_m:g} m wide"
        )
    values = grid.occupancy()
    write_grid(args.out / "map", values, grid.origin, grid.cell_m)
    positions = outcome.trajectory.position[:, :2]
    write_image(args.out / "map.png", values, grid.origin, grid.cell_m, positions)
    return grid.cell_m


def _summary(
    args: SlamArguments,
    outcome: SlamResult,
    refused: int,
    cell_m: float | None,
    start: Pose | None,
) -> dict[str, Any]:
    status = outcome.status
    results = {
        "log": args.log.name,
        "uav": outcome.channels.uav,
        "mode": "imu" if outcome.channels.has_imu else "planar",
        "topics": outcome.channels.names,
        "start": _in_degrees(start),
        "scans": outcome.num_scans,
        "lasted_s": round(outcome.lasted_s, 3),
        "way_m": round(outcome.trajectory.length_m, 2),
        "cell_m": cell_m,
        "keyframes": status.get("keyframes", 0),
        "closures": status.get("closures", 0),
        "sessions": status.get("sessions", 1),
        "refused": status.get("refused", 0) + refused,
        "clock_set": status.get("clock_set", 0),
        "sigma_m": status.get("sigma_m"),
        "states_s": {k: round(v, 1) for k, v in outcome.states.items()},
        "problems_s": {k: round(v, 1) for k, v in outcome.problems.items()},
        "cpu_s": round(outcome.cpu_s, 2),
        "cpu_share": round(outcome.cpu_s / outcome.lasted_s, 4) if outcome.lasted_s else None,
    }
    try:
        text = json.dumps(results, indent=2) + "\n"
        write_whole(args.out / "summary.json", text)
    except OSError as error:
        raise RecordingError(f"{args.out}: {error.strerror}") from None
    return results


def _print_summary(out: Path, r: dict[str, Any]) -> None:
    share = r["cpu_share"]
    echo_line(
        f"{counted(r['scans'], 'scan')} over {r['lasted_s']:.1f} s, "
        f"{r['way_m']:.1f} m path length ({'with' if r['mode'] == 'imu' else 'without'} IMU)"
    )
    echo_line(
        f"{counted(r['keyframes'], 'keyframe')}, {counted(r['closures'], 'closure')}, "
        f"{counted(r['sessions'], 'session')}, {counted(r['refused'], 'message')} refused"
    )
    topics = [topic for topic in r["topics"].values() if topic != "/tf_static"]
    echo_line(f"input     {r['uav']}: {', '.join(topics)}")
    states = ", ".join(f"{name} {_lasting(s)}" for name, s in r["states_s"].items())
    echo_line(f"state     {states or 'none'}")
    for problem, seconds in r["problems_s"].items():
        echo_line(f"problem   {problem}: {_lasting(seconds)}")
    if share is not None:
        echo_line(f"CPU       {r['cpu_s']:.1f} s, {share:.1%} of the log's time")
    for name in _NAMES:
        if name not in _MAPS or r["cell_m"] is not None:
            echo_line(f"written   {out / name}")


def _lasting(seconds: float) -> str:
    """Formats a duration, with tenths below 10 s."""
    return f"{seconds:.1f} s" if seconds < 10.0 else f"{seconds:.0f} s"
