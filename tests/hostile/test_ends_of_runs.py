"""How commands end: signals, one file for two writers, full disks."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import resource
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from child_process import start_child

from volery.bridges.logs.file_lock import locked_for_reading
from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.reader import summarize
from volery.bridges.logs.recovery import recover
from volery.core.errors import RecordingError
from volery.graph.messages import Published, String

FORMATS = [".mcap", ".bag"]
TERM, HUP, INT = signal.SIGTERM, signal.SIGHUP, signal.SIGINT
HANG_S = 600.0
CLI = [sys.executable, "-m", "volery"]
FAKES = Path(__file__).parents[1] / "unit" / "cli"
FLIES = f"""
import sys
sys.path.insert(0, {str(FAKES)!r})
import volery
from fake_simulation import FakeSimulation
FakeSimulation.wall_s_per_step = 0.001
volery.Simulation = FakeSimulation
from volery.cli.app import main
main()
"""


def begin(command, **options):
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return start_child([*map(str, command)], **{**pipes, **options})


@contextlib.contextmanager
def flying(log, *words):
    """`volery run` of a simulation that costs nothing, when its log has begun to grow."""
    command = [sys.executable, "-c", FLIES, "run", "hover", "--seconds", "30000"]
    process = begin([*command, "--record", log, *words])
    try:
        until(lambda: log.exists() and log.stat().st_size > 100_000, process)
        yield process
    finally:
        ended(process)


def until(holds, process):
    for _ in range(int(HANG_S / 0.05)):
        if holds():
            return
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    raise AssertionError("it does not begin")


def ended(process):
    """Whatever became of it, it is gone afterwards."""
    if process.poll() is None:
        process.kill()
        process.wait()
    for pipe in (process.stdout, process.stderr):
        if pipe is not None:
            pipe.close()


def write(path, messages=50, size=2000):
    log = create_log(path, compression="none")
    for k in range(messages):
        log.write(Published("/text", "std_msgs/msg/String", k, String("x" * size)))
    log.close()
    return path


def bad_end(path):
    """The file of a run that was killed."""
    path.write_bytes(write(path).read_bytes()[:-40])
    return path


# ---------------------------------------------------------------------------------------- signals


@pytest.mark.parametrize(
    ("number", "code", "how"),
    [
        (TERM, 143, "by SIGTERM"),
        pytest.param(HUP, 129, "by SIGHUP: its terminal has closed", marks=pytest.mark.slow),
    ],
)
def test_a_signal_ends_a_flight_with_its_files(tmp_path, number, code, how):
    log, report = tmp_path / "flight.mcap", tmp_path / "report"
    with flying(log, "--report", report) as process:
        process.send_signal(number)
        out, err = process.communicate(timeout=HANG_S)
    assert (process.returncode, err) == (code, "")
    assert f"Stopped {how}: flew" in out
    assert summarize(log).problem == ""
    assert f"Stopped {how}: this report shows" in (report / "index.html").read_text()


@pytest.mark.parametrize("number", [TERM, pytest.param(HUP, marks=pytest.mark.slow)])
def test_the_second_signal_ends_it_at_once(tmp_path, number):
    """Nothing of the report; the log is whole, or as that of a killed run."""
    log, report = tmp_path / "flight.mcap", tmp_path / "report"
    with flying(log, "--report", report) as process:
        for _ in range(3):
            process.send_signal(number)
            time.sleep(0.01)
        _, err = process.communicate(timeout=HANG_S)
    assert process.returncode in (128 + number, -number)
    assert "Traceback" not in err
    assert summarize(log).messages > 50


@pytest.mark.slow
def test_a_reader_that_has_gone_is_no_success():
    """`set -o pipefail; volery test ... | head -1` must not pass."""
    with subprocess.Popen(
        [*CLI, "list"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        process.stdout.close()
        assert process.wait(HANG_S) == 128 + signal.SIGPIPE
        assert process.stderr.read() == ""


def test_nohup_is_respected(tmp_path):
    log = tmp_path / "flight.mcap"
    program = f"import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n{FLIES}"
    words = [sys.executable, "-c", program, "run", "hover", "--seconds", "30000", "--record", log]
    process = begin(words)
    try:
        until(lambda: log.exists() and log.stat().st_size > 100_000, process)
        process.send_signal(HUP)
        size = log.stat().st_size
        until(lambda: log.stat().st_size > size + 100_000, process)  # it flies on
        process.send_signal(TERM)
        process.communicate(timeout=HANG_S)
        assert process.returncode == 143
    finally:
        ended(process)


@pytest.mark.slow
def test_a_terminal_that_closes_leaves_log_and_report(tmp_path):
    log, report = tmp_path / "flight.mcap", tmp_path / "report"
    command = [sys.executable, "-c", FLIES, "run", "hover", "--seconds", "30000"]
    command += ["--record", str(log), "--report", str(report)]
    leader, terminal = pty.openpty()
    ends = {"stdin": terminal, "stdout": terminal, "stderr": terminal, "start_new_session": True}
    take_terminal = f"import fcntl, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0)\n{FLIES}"
    command[2] = take_terminal
    process = begin(command, **ends)
    try:
        os.close(terminal)
        until(lambda: log.exists() and log.stat().st_size > 100_000, process)
        os.close(leader)
        assert process.wait(timeout=HANG_S) == 129
    finally:
        ended(process)
    assert summarize(log).problem == ""
    assert (report / "index.html").exists()


@pytest.mark.slow
@pytest.mark.parametrize("number", [TERM, HUP, INT])
@pytest.mark.parametrize("command", ["serve", "play", "comms", "node"])
def test_every_command_that_stays_ends_by_a_signal(tmp_path, command, number):
    """Servers that end by a signal return 0; a node names the signal."""
    log = write(tmp_path / "flight.mcap")
    words, sign = {
        "serve": (["serve", "--port", "0", "--recordings-dir", tmp_path], "flying"),
        "play": (["play", log, "--bridge", "rosbridge=0"], "playing"),
        "comms": (["comms", "--port", "0"], "open "),
        "node": (["node", "gap_following", "--via", NOWHERE], ""),
    }[command]
    output = tmp_path / "said"
    with output.open("w") as file:
        process = begin([*CLI, *words], stdout=file, stderr=file)
        try:
            until(lambda: sign in output.read_text() and output.stat().st_size, process)
            process.send_signal(number)
            code = process.wait(timeout=HANG_S)
        finally:
            ended(process)
    assert code == (128 + number if command == "node" else 0), output.read_text()
    assert "Traceback" not in output.read_text()


@pytest.mark.slow
def test_the_real_simulation_ends_by_sigterm(tmp_path):
    log = tmp_path / "flight.mcap"
    process = begin([*CLI, "run", "hover", "--speed", "1", "--record", log])
    try:
        until(lambda: log.exists() and log.stat().st_size > 5_000, process)
        process.send_signal(TERM)
        out, err = process.communicate(timeout=HANG_S)
    finally:
        ended(process)
    assert process.returncode == 143, err
    assert "Stopped by SIGTERM: flew" in out
    assert summarize(log).problem == ""


NOWHERE = "rosbridge://127.0.0.1:9"


# ------------------------------------------------------------------------------------------ locks


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_log_has_one_writer(tmp_path, suffix):
    path = tmp_path / f"flight{suffix}"
    first = create_log(path)
    with pytest.raises(RecordingError, match="is being written or recovered by another process"):
        create_log(path, overwrite=True)
    with pytest.raises(RecordingError, match="is being written by another process; end that first"):
        recover(path, tmp_path / f"other{suffix}")
    first.close()
    assert summarize(path).problem == ""
    create_log(path, overwrite=True).close()
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_a_log_that_is_recovered_is_not_overwritten(tmp_path):
    path = write(tmp_path / "flight.mcap")
    with locked_for_reading(path), pytest.raises(RecordingError, match="another process"):
        create_log(path, overwrite=True)
    assert summarize(path).messages == 50


def test_a_killed_writer_holds_no_lock(tmp_path):
    path = tmp_path / "flight.mcap"
    with flying(path) as process:
        command = [*CLI, "run", "hover", "--seconds", "1", "--record", path, "--overwrite"]
        done = begin(command)
        out, err = done.communicate(timeout=HANG_S)
        assert (done.returncode, out) == (2, "")
        assert "flight.mcap: is being written" in err
        process.kill()
        process.wait()
        assert recover(path).messages > 50


def test_a_file_system_without_locks_is_written(tmp_path, monkeypatch):
    def knows_no_locks(*_):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(fcntl, "flock", knows_no_locks)
    path = write(tmp_path / "flight.mcap")
    assert recover(path).messages == 50


# ------------------------------------------------------------------------------------- full disks


@contextmanager
def small_disk(size):
    """No file of this process grows beyond `size` bytes, that of the tests' output included."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@pytest.mark.parametrize("suffix", FORMATS)
def test_recover_on_a_full_disk_leaves_nothing(tmp_path, suffix):
    path = tmp_path / f"flight{suffix}"
    log = create_log(path, compression="none")
    for k in range(60):
        log.write(Published("/text", "std_msgs/msg/String", k, String(os.urandom(20_000).hex())))
    log.abort()
    expected = pytest.raises(RecordingError, match="cannot write the log: File too large")
    with small_disk(40_000), expected:
        recover(path)
    assert list(tmp_path.iterdir()) == [path]
    assert recover(path).messages > 10


@pytest.mark.parametrize("suffix", FORMATS)
def test_recover_that_is_stopped_leaves_nothing(tmp_path, monkeypatch, suffix):
    from volery.bridges.logs import records

    path = bad_end(tmp_path / f"flight{suffix}")
    plain = records.LogWalk._records

    def stopped(walk, found):
        for number, record in enumerate(plain(walk, found)):
            if number == 5:
                raise KeyboardInterrupt
            yield record

    monkeypatch.setattr(records.LogWalk, "_records", stopped)
    with pytest.raises(KeyboardInterrupt):
        recover(path)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_log_that_cannot_be_begun_leaves_nothing(tmp_path, suffix):
    with small_disk(10), pytest.raises(RecordingError, match="File too large"):
        create_log(tmp_path / f"flight{suffix}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_run_on_a_full_disk_ends_with_one_line(tmp_path, suffix):
    log = tmp_path / f"flight{suffix}"
    program = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (900_000, -1))\n{FLIES}"
    command = [sys.executable, "-c", program, "run", "hover", "--seconds", "30000"]
    process = begin([*command, "--record", log])
    out, err = process.communicate(timeout=HANG_S)
    assert process.returncode == 2
    assert len(err.splitlines()) == 1
    assert f"error: {log}: cannot write the log: File too large; the first" in err
    assert "The log could not be written: flew" in out
    assert summarize(log).messages > 10
