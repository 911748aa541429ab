from __future__ import annotations

import json
import logging
import subprocess
import sys
from datetime import datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer
from fake_simulation import FakeSimulation
from typer.testing import CliRunner

from volery.bridges.logs.log_writer import create_log
from volery.cli import bench, doctor, start
from volery.cli.app import app
from volery.cli.error_reporting import format_logs, guarded
from volery.cli.serve import named_problem
from volery.core.errors import VoleryError
from volery.core.machine import describe_machine, describe_versions
from volery.scenario import library
from volery.scenario.load import load_scenario
from volery_benchmarks import registry
from volery_benchmarks.document import read_results, render
from volery_benchmarks.registry import Result

runner = CliRunner()
FIGURES = {"ns_per_drone_step_n1000": 120.5, "us_per_step_n1": 2.5, "other": 3.0}


def test_help_is_quick_and_imports_nothing_heavy() -> None:
    code = (
        "import sys\n"
        "from typer.testing import CliRunner\n"
        "from volery.cli.app import app\n"
        "assert CliRunner().invoke(app, ['--help']).exit_code == 0\n"
        "heavy = {'numpy', 'numba', 'matplotlib', 'rosbags', 'pydantic'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_every_command_is_explained() -> None:
    for name in ("run", "list", "info", "recover", "bench", "doctor", "identify", "px4"):
        result = runner.invoke(app, [name, "--help"])
        assert result.exit_code == 0
        assert name in result.stdout


def test_a_folder_without_px4_is_an_error_before_anything_is_built(tmp_path: Path) -> None:
    for words in (["run", "hover"], ["px4"]):
        result = runner.invoke(app, [*words, "--px4-dir", str(tmp_path)])
        assert result.exit_code == 2
        assert "build it there with `make px4_sitl_default`" in result.stderr


@pytest.mark.parametrize("seconds", ["0", "-1", "inf", "nan"])
def test_a_run_that_cannot_last_names_its_option(seconds: str) -> None:
    result = runner.invoke(app, ["run", "hover", "--seconds", seconds])
    assert result.exit_code == 2
    assert result.stderr.startswith("error: --seconds: ")
    assert result.stderr.count("\n") == 1
    assert seconds in result.stderr


def test_an_interrupt_that_a_library_made_an_error_of_is_reported_as_one() -> None:
    def load() -> None:
        try:
            try:
                raise KeyboardInterrupt
            except KeyboardInterrupt as interrupt:
                raise ImportError("initialization failed") from interrupt
        except ImportError as error:
            raise VoleryError("it is not installed") from error

    def fail() -> None:
        raise VoleryError("it is not installed")

    commands = typer.Typer()
    for command in (load, fail):
        commands.command()(guarded(command))
    stopped, failed = (runner.invoke(commands, [name]) for name in ("load", "fail"))
    assert (stopped.exit_code, stopped.stderr) == (130, "stopped\n")
    assert (failed.exit_code, failed.stderr) == (2, "error: it is not installed\n")


@pytest.mark.parametrize("words", [["run", "{}"], ["launch", "{}"]])
def test_a_file_that_cannot_be_read_is_reported_without_numbers(
    words: list[str], tmp_path: Path
) -> None:
    path = tmp_path / "secret.toml"
    path.symlink_to(path)
    result = runner.invoke(app, [word.format(path) for word in words])
    assert result.exit_code == 2
    assert "Errno" not in result.stderr
    assert result.stderr.count(str(path)) == 1


def test_the_options_of_a_run_are_grouped() -> None:
    output = runner.invoke(app, ["run", "--help"]).stdout
    titles = ("Flight", "Output files", "Bridges and access", "ROS 2", "Autopilots")
    groups = [f"─ {title} ─" for title in titles]
    firsts = ("--uavs", "--record", "--page", "--ros2 ", "--px4-dir")
    positions = [output.index(text) for pair in zip(groups, firsts, strict=True) for text in pair]
    assert positions == sorted(positions)


def test_what_is_logged_looks_like_what_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    format_logs()
    assert logging.lastResort is not None
    for level in (logging.WARNING, logging.ERROR):
        logging.lastResort.emit(
            logging.LogRecord("x", level, "", 0, "%s: is gone", ("uav1",), None)
        )
    assert capsys.readouterr().err == "warning: uav1: is gone\nerror: uav1: is gone\n"


def test_an_interrupt_while_the_command_loads_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Interrupting:
        def find_spec(self, name: str, *_: object) -> None:
            if name == "volery.cli.app":
                raise KeyboardInterrupt

    monkeypatch.delitem(sys.modules, "volery.cli.app")
    monkeypatch.setattr(sys, "meta_path", [Interrupting(), *sys.meta_path])
    with pytest.raises(SystemExit) as ended:
        start.main()
    assert ended.value.code == 130
    assert capsys.readouterr().err == "stopped\n"


def test_list() -> None:
    lines = runner.invoke(app, ["list"]).stdout.splitlines()
    assert lines[0].split() == ["scenario", "UAVs", "duration", "what", "it", "is"]
    for name in library.names():
        assert any(line.startswith(f"{name} ") and library.describe(name) in line for line in lines)


def make_log(path: Path, *, whole: bool) -> None:
    simulation = FakeSimulation(load_scenario("hover"))
    log = create_log(path)
    simulation.graph.subscribe_all(log.write)
    simulation.run()
    log.close() if whole else log.abort()


@pytest.mark.parametrize("suffix", [".mcap", ".bag"])
def test_info_and_recover(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"flight{suffix}"
    make_log(path, whole=False)
    result = runner.invoke(app, ["info", str(path)])
    assert result.exit_code == 1
    assert "cut off" in result.stderr
    assert f"volery recover {path}" in result.stderr
    assert "sensor_msgs/msg/LaserScan" in result.stdout
    result = runner.invoke(app, ["recover", str(path)])
    assert result.exit_code == 0
    mended = tmp_path / f"flight.recovered{suffix}"
    assert f"written to {mended}" in result.stdout
    result = runner.invoke(app, ["info", str(mended)])
    assert (result.exit_code, result.stderr) == (0, "")
    assert "40.0 Hz" in result.stdout
    assert "duration  " in result.stdout
    result = runner.invoke(app, ["recover", str(mended)])
    assert "is whole: nothing to recover" in result.stdout


@pytest.mark.parametrize("content", [b"\x89MCAP0\r\n", b"#ROSBAG V2.0\n"])
def test_recover_of_a_stub(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "stub.mcap"
    path.write_bytes(content)
    result = runner.invoke(app, ["recover", str(path)])
    assert result.exit_code == 2
    assert result.stderr.startswith(f"error: {path}: holds no readable message")
    assert len(result.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("content", "code"),
    [(b"", 2), (b"no log", 2), (b"\x89MCAP0\r\n", 1), (b"#ROSBAG V2.0\n", 1)],
)
def test_info_of_a_broken_file(tmp_path: Path, content: bytes, code: int) -> None:
    path = tmp_path / "broken.mcap"
    path.write_bytes(content)
    result = runner.invoke(app, ["info", str(path)])
    assert result.exit_code == code  # 1: it is a log, and damaged
    assert result.stderr.startswith(f"error: {path}: ")
    assert len(result.stderr.splitlines()) == 1


def test_info_and_recover_of_a_missing_file(tmp_path: Path) -> None:
    path = str(tmp_path / "none.bag")
    for command in ("info", "recover"):
        result = runner.invoke(app, [command, path])
        assert result.exit_code == 2
        assert "none.bag: cannot read the log: No such file" in result.stderr


def test_doctor() -> None:
    result = runner.invoke(app, ["doctor"])
    assert result.exit_code == 0, result.stdout
    assert result.stdout.splitlines()[-1] == "ready to fly"
    assert all(line.startswith(("ok ", "note ")) for line in result.stdout.splitlines()[:-1])


def test_doctor_says_how_to_mend(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> str:
        raise doctor.UnfitError("it is broken; run `mend it`")

    def strange() -> str:
        raise RuntimeError("what is this")

    for essential, code in ((True, 1), (False, 0)):
        checks = (doctor.Check("thing", broken, essential), doctor.Check("x", strange, False))
        monkeypatch.setattr(doctor, "CHECKS", checks)
        result = runner.invoke(app, ["doctor"])
        assert result.exit_code == code
        assert "thing: it is broken; run `mend it`" in result.stdout
        assert "note  x: RuntimeError('what is this')" in result.stdout


def test_doctor_finds_a_cache_that_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    from volery.core import compiled

    monkeypatch.setattr(compiled, "cache_dir", lambda: Path("/tmp/volery-kernels-0/abc"))
    with pytest.raises(doctor.UnfitError, match="VOLERY_CACHE_DIR"):
        doctor._kernels()


def test_doctor_names_scenarios_that_lack_an_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ompl", None)
    result = runner.invoke(app, ["doctor"])
    assert result.exit_code == 0, result.stdout
    (line,) = [line for line in result.stdout.splitlines() if "extras" in line]
    assert line.startswith("note  extras: forest_search does not start: global_planner needs ompl")
    assert line.endswith('pip install "volery[autonomy]"')


def test_a_problem_names_its_scenario_once() -> None:
    what = "forest_search: slam needs gtsam"
    assert named_problem("forest_search", what) == what
    assert named_problem("flight.mcap", "it is damaged") == "flight.mcap: it is damaged"


@pytest.fixture
def quick_bench(monkeypatch: pytest.MonkeyPatch) -> None:
    module = SimpleNamespace(measure=lambda: dict(FIGURES))
    monkeypatch.setattr(registry.importlib, "import_module", lambda name: module)


@pytest.mark.usefixtures("quick_bench")
def test_bench(tmp_path: Path) -> None:
    out, page = tmp_path / "dynamics.json", tmp_path / "benchmarks.md"
    words = ["bench", "dynamics", "--json", "--out", str(out), "--markdown", str(page)]
    result = runner.invoke(app, words)
    assert result.exit_code == 0, result.stderr
    printed = json.loads(result.stdout)
    assert list(printed) == ["bench", "machine", "figures", "failures", "versions"]
    assert printed["failures"] == printed["versions"] == {}
    assert printed["figures"] == FIGURES
    assert {"processor", "cores", "memory", "python", "numba", "embreex"} <= set(printed["machine"])
    assert json.loads(out.read_text()) == printed
    assert read_results(out) == [Result.from_dict(printed)]
    text = page.read_text()
    assert "| `ns_per_drone_step_n1000` | 120.5 | <= 150 |" in text
    assert "| `us_per_step_n1` | 2.5 | <= 1.5 (missed) |" in text
    assert "| `other` | 3 | reported |" in text
    table = runner.invoke(app, ["bench", "dynamics"]).stdout
    assert "missed" in table


def test_all_benches_make_one_document_with_build_machine_and_versions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = {**describe_machine(), **describe_versions()}
    asked: list[str] = []

    def measure(name: str) -> Result:
        asked.append(name)
        return Result(name, here, {"figure": 1.0})

    monkeypatch.setattr(bench, "_in_own_process", measure)
    out = tmp_path / "bench.json"
    result = runner.invoke(app, ["bench", "--all", "--json", "--out", str(out)])
    assert result.exit_code == 0, result.stderr
    assert asked == [name for name, each in registry.BENCHES.items() if each.in_all]
    document = json.loads(result.stdout)
    assert json.loads(out.read_text()) == document
    assert list(document) == ["build", "date", "results"]
    assert document["build"]["libraries"].items() <= here.items()
    assert datetime.fromisoformat(document["date"]).utcoffset() == timedelta(0)
    assert [each["bench"] for each in document["results"]] == asked
    assert read_results(out) == [Result(name, here, {"figure": 1.0}) for name in asked]
    assert render(read_results(out)).count("| `figure` | 1 | reported |") == len(asked)


@pytest.mark.usefixtures("quick_bench")
@pytest.mark.parametrize("words", [[], ["lidar", "--all"]])
def test_a_bench_is_named_or_all(words: list[str]) -> None:
    result = runner.invoke(app, ["bench", *words])
    assert result.exit_code == 2
    assert "--all" in result.stderr


def test_bench_mistakes(tmp_path: Path) -> None:
    result = runner.invoke(app, ["bench", "speed"])
    assert result.exit_code == 2
    assert ", ".join(registry.BENCHES) + ", or all" in result.stderr
    result = runner.invoke(app, ["bench", "lidar", "--out", str(tmp_path / "no" / "x.json")])
    assert result.exit_code == 2
    assert "does not exist" in result.stderr
    for content in ("{}", "[1]", '"x"', "no json"):
        path = tmp_path / "bad.json"
        path.write_text(content)
        with pytest.raises(VoleryError):
            read_results(path)


def test_page_names_every_machine() -> None:
    here = {**describe_machine(), **describe_versions()}
    there = {**here, "processor": "Another CPU"}
    results = [Result("lidar", here, {"rays_per_s_1_thread": 7e6}), Result("new", there, {"x": 1})]
    text = render(results)
    assert "## Machine 1" in text
    assert "Another CPU" in text
    assert "## new (machine 2)" in text
    assert "| `rays_per_s_1_thread` | 7e+06 | >= 6e+06 |" in text


def test_identify_writes_a_model_that_loads(tmp_path: Path) -> None:
    from volery.vehicle.identified import load_identified

    out = tmp_path / "mine.toml"
    result = runner.invoke(app, ["identify", "f450", "--out", str(out), "--order", "1"])
    assert result.exit_code == 0, result.output
    assert "attitude_deg" in result.stdout
    model = load_identified(str(out))
    assert model.roll.kind == "first_order"
    assert model.fit_error is not None
    missing = runner.invoke(app, ["identify", "f450", "--out", str(tmp_path / "no" / "a.toml")])
    assert missing.exit_code == 2
    assert "does not exist" in missing.output


def test_help_names_all_benches_and_tables_of_profiles() -> None:
    output = runner.invoke(app, ["bench", "--help"]).output
    assert [name for name in registry.BENCHES if name not in output] == []
    assert "[[launch]]" in runner.invoke(app, ["launch", "--help"]).output
