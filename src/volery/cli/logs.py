"""`volery info`, `volery recover` and `volery convert`."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from volery.bridges.logs.reader import LogSummary, TopicSummary, summarize
from volery.cli.error_reporting import complain, warn
from volery.cli.tables import print_table
from volery.cli.terminal import echo_line
from volery.core.clock import NS_PER_S
from volery.core.errors import RecordingError, reason_of
from volery.core.plurals import counted
from volery.core.whole_files import new_partial, put_in_place

_FORMATS = {"mcap": "MCAP", "bag": "ROS 1 bag", "ros2bag": "ROS 2 bag", "ulog": "ULog"}
_RECOVERED = ("mcap", "bag")
"""Formats that `volery recover` reads."""


def show_log(path: Path) -> bool:
    """Prints the contents of a log; returns False, after one line on stderr, if the log is damaged.

    The verdicts on the flight follow, if the log has them.

    Raises `RecordingError` if the file is no log.
    """
    from volery.bridges.logs.playback import OF_WHOLE_FLIGHT

    summary = _summary_of(path)
    start, end = summary.start_ns / NS_PER_S, summary.end_ns / NS_PER_S
    echo_line(f"file      {path}")
    echo_line(f"format    {_FORMATS[summary.format]}, {summary.size_bytes / 1e6:.2f} MB")
    echo_line(f"duration  {summary.duration_s:.3f} s ({start:.3f} to {end:.3f} s)")
    echo_line(f"messages  {summary.messages:,}")
    rows = [(t.topic, t.msgtype, f"{t.messages:,}", f"{t.rate_hz:.1f} Hz") for t in summary.topics]
    if rows:
        echo_line("")
        print_table(("topic", "type", "messages", "rate"), rows, right=(2, 3))
    for topic in {each.topic for each in summary.topics}.intersection(OF_WHOLE_FLIGHT):
        _print_verdicts(path, topic)
    if summary.problem:
        recovery = f"; `volery recover {path}` writes what is readable"
        complain(f"{path}: {summary.problem}{recovery if summary.format in _RECOVERED else ''}")
        return False
    return True


def _summary_of(path: Path) -> LogSummary:
    """Summarizes a log as `summarize`, and also ROS 2 bags (`ros2bag`) and ULog (`ulog`).

    Raises `RecordingError` if the file cannot be read, is no log, or exceeds the limits of logs.
    """
    from volery.bridges.logs.bag_files import bag_size
    from volery.logs.sources import log_kind, open_source

    kind = log_kind(path)
    if kind in ("mcap", "bag"):
        return summarize(path)
    source = open_source(path)
    try:
        seconds = (source.end_ns - source.start_ns) / NS_PER_S
        topics = tuple(
            TopicSummary(
                name,
                count.msgtype,
                count.messages,
                max(count.messages - 1, 0) / seconds if seconds > 0.0 else 0.0,
            )
            for name, count in source.topics.items()
        )
        messages = sum(topic.messages for topic in topics)
        return LogSummary(
            path, kind, bag_size(path), source.start_ns, source.end_ns, messages, topics,
            source.problem,
        )  # fmt: skip
    finally:
        source.close()


def _print_verdicts(path: Path, topic: str) -> None:
    """Prints the last verdicts of a log; of a damaged one, those that can be read."""
    from volery.logs import open_log
    from volery.verdicts.live_verdicts import verdicts_of

    last: Any = None
    with open_log(path) as log, suppress(RecordingError):
        for logged in log.messages(topic):
            last = logged.message
    if last is not None:
        echo_line("")
        for verdict in verdicts_of(last.data):
            echo_line(f"{verdict.outcome!s:7} {verdict.describe()}")


def recover_log(path: Path, out: Path | None) -> None:
    """Writes the readable part of a log as a valid log and prints its size."""
    from volery.bridges.logs.recovery import recover

    if out is None and not summarize(path).problem:
        echo_line(f"{path} is whole: nothing to recover")
        return
    recovery = recover(path, out)
    if recovery.problem:
        echo_line(f"{path}: {recovery.problem}")
    echo_line(
        f"{counted(recovery.messages, 'message')} up to {recovery.end_ns / NS_PER_S:.3f} s "
        f"written to {recovery.path}"
    )


def convert_log(path: Path, out: Path, layout: Path, *, overwrite: bool) -> None:
    """Converts a text log of scans to a log of messages and prints the counts."""
    from volery.bridges.logs.log_writer import check_target, create_log
    from volery.bridges.logs.text_layout import TextLayout
    from volery.bridges.logs.text_scans import TextScans
    from volery.scenario.data_files import load_data_file

    check_target(out, overwrite=overwrite)
    scans = TextScans(path, load_data_file(layout, TextLayout))
    made = new_partial(out, out.suffix)
    log = create_log(made)
    try:
        scans.write_to(log)
        log.close()
        put_in_place(made, out, overwrite=overwrite)
    except OSError as error:
        raise RecordingError(f"{out}: cannot be written: {reason_of(error)}") from None
    finally:
        log.close()
        made.unlink(missing_ok=True)
    if scans.left_out:
        warn(f"{path}: {counted(scans.left_out, 'line')} left out; {scans.problem}")
    for warning in scans.warnings:
        warn(f"{path}: {warning}")
    echo_line(
        f"{counted(scans.scans, 'scan')}, {counted(log.messages, 'message')} written to {out}"
    )
