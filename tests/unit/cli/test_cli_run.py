from __future__ import annotations

import errno
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from child_process import start_child
from fake_simulation import FakeSimulation
from typer.testing import CliRunner, Result

import volery
from volery.bridges.logs.reader import summarize
from volery.cli.app import app

Invoke = Callable[..., Result]


@pytest.fixture
def invoke(monkeypatch: pytest.MonkeyPatch) -> Iterator[Invoke]:
    monkeypatch.setitem(vars(volery), "Simulation", FakeSimulation)
    FakeSimulation.made.clear()
    runner = CliRunner()

    def run(*words: object) -> Result:
        result = runner.invoke(app, [str(word) for word in words])
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result

    yield run
    assert all(simulation.closed for simulation in FakeSimulation.made)


def test_run_writes_log_and_report(invoke: Invoke, tmp_path: Path) -> None:
    log, report = tmp_path / "new" / "flight.mcap", tmp_path / "report"
    result = invoke("run", "hover", "--seconds", 5, "--record", log, "--report", report, "--digest")
    assert result.exit_code == 0, result.output
    # a UAV crashed, which is a result and no failure
    assert "uav1 hit tree 7 at 2.50 m/s" in result.stdout
    assert re.search(r"^Flew 5\.0 s with 1 UAV in .* x real time\)$", result.stdout, re.MULTILINE)
    assert f"log     {log}" in result.stdout
    assert f"report  {report / 'index.html'}" in result.stdout
    assert "digest  " + "ab" * 32 in result.stdout
    assert result.stderr == ""
    assert "\x1b" not in result.stdout
    assert summarize(log).messages == 400
    assert summarize(log).problem == ""
    page = (report / "index.html").read_text()
    assert "ab" * 32 in page
    assert "LIDARs saw" in page


def test_the_exit_code_reports_failures_that_are_asked_for(invoke: Invoke) -> None:
    words = "run", "hover", "--seconds", 0.5, "--fail-on"
    result = invoke(*words, "crash,contact")
    assert result.exit_code == 1
    assert "failed: first contact: 0.500 s  uav1 hit tree 7 at 2.50 m/s" in result.stderr
    assert "crashed" not in result.stderr
    assert "Flew 0.5 s" in result.stdout
    assert invoke(*words, "crash").exit_code == 0  # a touch that it survived
    refused = invoke(*words, "wreck")
    assert refused.exit_code == 2
    assert "--fail-on: crash, contact, expectation, node-error, not 'wreck'" in refused.stderr


def test_options_reach_the_simulation(invoke: Invoke) -> None:
    result = invoke("run", "hover", "--seconds", 0.5, "--seed", 9, "--speed", 50, "--threads", 2)
    assert result.exit_code == 0, result.output
    (simulation,) = FakeSimulation.made
    assert (simulation.scenario.seed, simulation.scenario.duration_s) == (9, 0.5)
    assert (simulation.clock.speed, simulation.threads) == (50.0, 2)
    assert "log" not in result.stdout
    invoke("run", "hover", "--seconds", 0.5)
    assert FakeSimulation.made[-1].clock.speed is None


def test_ros1_log(invoke: Invoke, tmp_path: Path) -> None:
    log = tmp_path / "flight.bag"
    assert invoke("run", "hover", "--seconds", 1, "--record", log).exit_code == 0
    assert summarize(log).messages == 80


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("run", "hovr"), "no scenario 'hovr'.*did you mean 'hover'"),
        (("run", "nowhere.toml"), "nowhere.toml: no such file"),
        (("run", "hover", "--seconds", "-1"), "--seconds: a run lasts"),
        (("run", "hover", "--seconds", "nan"), "--seconds: 0, or a number"),
        (("run", "hover", "--uavs", "0"), "--uavs.*at least 1"),
        (("run", "hover", "--seed", "-3"), "seed"),
        (("run", "hover", "--speed", "fast"), "--speed.*positive number or max"),
        (("run", "hover", "--speed", "0"), "--speed"),
        (("run", "hover", "--speed", "nan"), "--speed"),
        (("run", "hover", "--record", "log.txt"), r"log.txt.*\.mcap.*\.bag"),
        (("run", "hover", "--record", "exists.mcap"), "exists already.*--overwrite"),
        (
            ("run", "hover", "--record", "a/b/x.mcap"),
            "a/b/x.mcap: cannot.*folder .*a/b does not exist.*mkdir",
        ),
        (
            ("run", "hover", "--record", "/nosuchroot/x.mcap"),
            "folder /nosuchroot does not exist; create it with `mkdir -p",
        ),
        (
            ("run", "hover", "--report", "a/b/report"),
            "a/b/report: cannot.*folder .*a/b does not exist.*mkdir",
        ),
        (("run", "hover", "--report", "/nosuchroot/x"), "folder /nosuchroot does not exist"),
        (("run", "hover", "--report", "exists.mcap"), "exists.mcap is not a folder"),
        (("run", "hover", "--record", "exists.mcap/x.bag"), "exists.mcap/x.bag: cannot create"),
    ],
)
def test_mistakes_are_one_line(
    invoke: Invoke,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("exists.mcap").write_text("precious")
    result = invoke(*words)
    assert result.exit_code == 2
    assert re.match(f"error: .*{message}", result.stderr), result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert Path("exists.mcap").read_text() == "precious"
    assert os.listdir() == ["exists.mcap"]
    assert not Path("/nosuchroot").exists()


@pytest.mark.parametrize(
    "words",
    [("run",), ("run", "hover", "--threads", "0"), ("run", "hover", "--uavs", "two"), ("fly",)],
)
def test_wrong_usage(invoke: Invoke, words: tuple[str, ...]) -> None:
    result = invoke(*words)
    assert result.exit_code == 2
    assert "Traceback" not in result.output


def test_overwrite(invoke: Invoke, tmp_path: Path) -> None:
    log = tmp_path / "flight.mcap"
    log.write_text("old")
    words = ("run", "hover", "--seconds", 1, "--record", log, "--overwrite")
    assert invoke(*words).exit_code == 0
    assert summarize(log).messages == 80


@pytest.mark.parametrize("suffix", [".mcap", ".bag"])
def test_full_disk(
    invoke: Invoke, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    true_pwrite = os.pwrite

    def full(descriptor: int, data: bytes, offset: int) -> int:
        if offset > 1_000_000:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return true_pwrite(descriptor, data, offset)

    monkeypatch.setattr(os, "pwrite", full)
    log, report = tmp_path / f"flight{suffix}", tmp_path / "report"
    result = invoke("run", "hover", "--seconds", 60, "--record", log, "--report", report)
    assert result.exit_code == 2
    errors = result.stderr.strip().splitlines()
    assert len(errors) == 1
    assert re.match(rf"error: .*flight\{suffix}: .*No space left on device", errors[0])
    left = summarize(log)
    assert 100 < left.messages < 4800
    assert f", {left.messages:,} messages)" in result.stdout
    assert "cut off" in left.problem
    assert "The log could not be written" in (report / "index.html").read_text()


INTERRUPTED = """
import sys
sys.path.insert(0, sys.argv.pop(1))
import volery
from fake_simulation import FakeSimulation
FakeSimulation.wall_s_per_step = 0.001
volery.Simulation = FakeSimulation
from volery.cli.app import main
main()
"""


def test_one_missing_folder_is_made(invoke: Invoke, tmp_path: Path) -> None:
    log, report = tmp_path / "logs" / "flight.mcap", tmp_path / "reports" / "first"
    result = invoke("run", "hover", "--seconds", 1, "--record", log, "--report", report)
    assert result.exit_code == 0, result.output
    assert log.exists()
    assert (report / "index.html").exists()


def wait_for(process: subprocess.Popen[str], condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 600.0
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.02)


def test_ctrl_c_while_kernels_compile(tmp_path: Path) -> None:
    """One line, no traceback, nothing left behind: the real simulation with an empty cache."""
    log, report = tmp_path / "new" / "flight.mcap", tmp_path / "report"
    cache = tmp_path / "cache"
    command = [sys.executable, "-m", "volery", "run", "hover"]
    command += ["--record", str(log), "--report", str(report)]
    with start_child(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "VOLERY_CACHE_DIR": str(cache)},
    ) as process:
        wait_for(process, lambda: any(cache.glob("volery/kernels/*/*/*.nbi")))
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=900)
    # Python ends by the signal itself where it met it in an `exec`; shells call that 130 too.
    assert process.returncode in (130, -signal.SIGINT), err
    assert out == "hover: compiling; later runs start at once\n"
    assert err == "Stopped with Ctrl-C before the flight began\n"
    assert list(tmp_path.iterdir()) == [cache]


INTERRUPTED_WHILE_BUILT = """
import sys, os, signal, time
sys.path.insert(0, sys.argv.pop(1))
import volery
from fake_simulation import FakeSimulation
def interrupt():
    os.kill(os.getpid(), signal.SIGINT)
    [None for _ in range(1000)]
class Lost:
    def __del__(self):
        interrupt()  # an exception in here cannot be passed on
class HalfMade:
    def __init__(self):
        interrupt()
        self.handle = 1
    def __del__(self):
        del self.handle
class HeldByItself(HalfMade):
    def __init__(self):
        self.itself = self  # what a cycle holds goes when the process ends
        super().__init__()
class Compiled:
    def __init__(self):
        compiler = {{"__name__": "llvmlite.binding", "interrupt": interrupt}}
        exec("interrupt()", compiler)  # where it is compiled, an interrupt has to wait
        print("compiled")
        time.sleep(600)  # a system call, which the repeated interrupt ends
        print("not interrupted")
class Builds(FakeSimulation):
    def __init__(self, *arguments, **options):
        {part}()
        super().__init__(*arguments, **options)
volery.Simulation = Builds
from volery.cli.app import main
main()
"""


@pytest.mark.parametrize(
    ("part", "said"),
    [("Lost", ""), ("HalfMade", ""), ("HeldByItself", ""), ("Compiled", "compiled\n")],
)
def test_ctrl_c_at_an_awkward_point(part: str, said: str) -> None:
    """One that Python cannot pass on, two that leave something half made, one that must wait."""
    program = INTERRUPTED_WHILE_BUILT.format(part=part)
    command = [sys.executable, "-c", program, str(Path(__file__).parent), "run", "hover"]
    pipe = subprocess.PIPE
    with start_child(command, stdout=pipe, stderr=pipe, text=True) as process:
        output = process.communicate(timeout=900)
    assert process.returncode == 130
    assert output == (said, "Stopped with Ctrl-C before the flight began\n")


@pytest.mark.parametrize("suffix", [".mcap", ".bag"])
def test_ctrl_c_in_mid_flight(tmp_path: Path, suffix: str) -> None:
    """The log is whole, the report shows what was flown, and the exit code says so."""
    log, report = tmp_path / f"flight{suffix}", tmp_path / "report"
    command = [sys.executable, "-c", INTERRUPTED, str(Path(__file__).parent), "run", "hover"]
    command += ["--seconds", "3000", "--record", str(log), "--report", str(report)]
    with start_child(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        wait_for(process, lambda: log.exists() and log.stat().st_size > 100_000)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=900)
    assert process.returncode == 130, err
    assert err == ""
    assert "Stopped with Ctrl-C: flew" in out
    assert f"log     {log}" in out
    assert f"report  {report / 'index.html'}" in out
    summary = summarize(log)
    assert summary.problem == ""
    assert summary.messages > 50
    assert "Stopped with Ctrl-C: this report shows" in (report / "index.html").read_text()
