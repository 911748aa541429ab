"""Nodes are code: which modules a scenario, a log or a launch profile may have imported."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.recorded_flight import RecordedScenario
from volery.cli import trust
from volery.cli.app import app
from volery.cli.trust import may_run_local_nodes
from volery.core.errors import ScenarioError, VoleryError
from volery.graph import messages as m
from volery.runtime import Simulation
from volery.runtime.construction.node_loading import find_node, is_local
from volery.runtime.replay.scenario_record import scenario_of
from volery.runtime.warmup.requirements import needs_of
from volery.scenario.access import ScenarioAccess
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.load import load_scenario, parse_scenario
from volery.scenario.schema import NodeEntry, Scenario

VOLERY = [sys.executable, "-m", "volery"]
EVIL = """
from pathlib import Path
Path({mark!r}).write_text("run")
from volery.graph.nodes.node import Node
class Evil(Node):
    def __init__(self, **options):
        super().__init__("evil", **options)
"""
TOML = """
name = "stranger"
duration_s = 0.1
[types.f450]
[[types.f450.sensors]]
kind = "imu"
[[uavs]]
type = "f450"
position_m = [0.0, 0.0]
[[nodes]]
node = "{node}"
"""


class Trap:
    """A folder with a scenario and, beside it, a module that leaves a mark when it is imported."""

    def __init__(self, folder: Path, module: str) -> None:
        self.folder, self.module = folder, module
        self.mark = folder / "mark"
        self.node = f"{module}:Evil"
        (folder / f"{module}.py").write_text(EVIL.format(mark=str(self.mark)))
        self.file = folder / "stranger.toml"
        self.file.write_text(TOML.format(node=self.node))

    @property
    def content(self) -> dict[str, Any]:
        return load_scenario(self.file).model_dump(exclude_unset=True)

    def log(self) -> Path:
        """A log beside it with the scenario and its folder."""
        origin = {"name": "stranger", "seed": 1, "version": "0", "folder": str(self.folder)}
        path = self.folder / "stranger.mcap"
        with closing(create_log(path)) as log:
            text = json.dumps(origin | {"content": self.content})
            log.write(m.Published("/volery/scenario", "std_msgs/msg/String", 0, m.String(text)))
        return path

    @property
    def has_run(self) -> bool:
        return self.mark.exists()


@pytest.fixture
def trap(tmp_path: Path, request: pytest.FixtureRequest) -> Any:
    name = f"evil_{abs(hash(request.node.nodeid)):x}"
    yield Trap(tmp_path, name)
    sys.modules.pop(name, None)


# ------------------------------------------------------------------------------- what is imported


@pytest.mark.parametrize("cwd", ["beside", "elsewhere"])
@pytest.mark.parametrize("on_path", [None, "", "absolute", "relative"])
def test_a_module_beside_a_scenario_is_not_imported(
    trap: Trap, cwd: str, on_path: str | None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Nor where the working folder is on the path, as with `python -m` and `python -c`."""
    (tmp_path / "else").mkdir()
    folder = trap.folder if cwd == "beside" else tmp_path / "else"
    monkeypatch.chdir(folder)
    if on_path is not None:
        entry = {"": "", "absolute": str(trap.folder), "relative": os.path.relpath(trap.folder)}
        monkeypatch.syspath_prepend(entry[on_path])
    scenario = load_scenario(trap.file)
    assert is_local(trap.module, scenario.access)
    needs_of(scenario)  # what is compiled before the flight depends on nodes, too
    with pytest.raises(ScenarioError, match="only if you trust it: give --trust"):
        Simulation(scenario, threads=1)
    assert not trap.has_run


def test_a_trusted_one_is_imported(trap: Trap) -> None:
    with Simulation(load_scenario(trap.file, trust=True), threads=1):
        assert trap.has_run


def test_what_a_program_makes_itself_is_trusted(
    trap: Trap, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(trap.folder)
    with Simulation(parse_scenario(trap.content), threads=1):
        assert trap.has_run


def test_installed_packages_start(
    trap: Trap, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Installed is what is found without the scenario's folder and the working one."""
    site = tmp_path / "site"
    site.mkdir()
    (trap.folder / f"{trap.module}.py").rename(site / f"{trap.module}.py")
    monkeypatch.syspath_prepend(str(site))
    scenario = load_scenario(trap.file)
    assert not is_local(trap.module, scenario.access)
    with Simulation(scenario, threads=1):
        assert trap.has_run


def test_an_installed_one_counts_before_one_beside(
    trap: Trap, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also in the parts of a package: the rest of it is not looked for beside the scenario."""
    for folder, inner in ((tmp_path / "site", "good"), (trap.folder, "bad")):
        (folder / f"pk_{trap.module}").mkdir(parents=True)
        source = (trap.folder / f"{trap.module}.py").read_text()
        (folder / f"pk_{trap.module}" / f"{inner}.py").write_text(source)
    monkeypatch.chdir(trap.folder)
    monkeypatch.syspath_prepend("")
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    access = load_scenario(trap.file).access
    with pytest.raises(ScenarioError, match="cannot be imported"):
        find_node(NodeEntry(node=f"pk_{trap.module}.bad:Evil"), "x", access)
    assert not trap.has_run
    assert find_node(NodeEntry(node=f"pk_{trap.module}.good:Evil"), "x", access)


@pytest.mark.parametrize(
    "node",
    ["volery.__main__:main", "volery_benchmarks.search_peer:Calling", "volery.graph:Node"],
)
def test_programs_of_volery_are_no_nodes(trap: Trap, node: str) -> None:
    """Importing some of them would start them."""
    trap.file.write_text(TOML.format(node=node))
    with pytest.raises(ScenarioError, match="is no node that ships"):
        Simulation(load_scenario(trap.file), threads=1)


@pytest.mark.parametrize(
    "node", ["json:JSONDecoder", "volery.autonomy.avoidance.gaps:Gap", "os:system"]
)
def test_only_nodes_are_started(trap: Trap, node: str) -> None:
    trap.file.write_text(TOML.format(node=node))
    with pytest.raises(ScenarioError, match=r"is no subclass|has no class"):
        Simulation(load_scenario(trap.file), threads=1)


# ---------------------------------------------------------------------------- logs and uploads


def scenario_from_log(trap: Trap, own: Scenario | None = None) -> Scenario:
    return scenario_of(RecordedScenario("stranger", 1, "0", trap.content), own, folder=trap.folder)


@pytest.mark.parametrize("installed", [False, True])
def test_a_log_starts_no_module(
    trap: Trap, *, installed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(trap.folder)
    if installed:
        site = trap.folder / "site"
        site.mkdir()
        (trap.folder / f"{trap.module}.py").rename(site / f"{trap.module}.py")
        monkeypatch.syspath_prepend(str(site))
    with pytest.raises(ScenarioError, match="shipped nodes only"):
        Simulation(scenario_from_log(trap), threads=1)
    assert not trap.has_run


def test_a_log_starts_what_ones_own_scenario_names(trap: Trap) -> None:
    with pytest.raises(ScenarioError, match="only if you trust it"):
        Simulation(scenario_from_log(trap, load_scenario(trap.file)), threads=1)
    bare = load_scenario(trap.file, trust=True).model_copy(update={"nodes": ()})
    with pytest.raises(ScenarioError, match="shipped nodes only"):
        Simulation(scenario_from_log(trap, bare), threads=1)
    assert not trap.has_run
    own = load_scenario(trap.file, trust=True)
    with Simulation(scenario_from_log(trap, own), threads=1):
        assert trap.has_run


def test_an_upload_starts_no_module(trap: Trap, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = trap.folder / "uploads" / "stranger"
    folder.mkdir(parents=True)
    (folder / "scenario.toml").write_bytes(trap.file.read_bytes())
    (folder / f"{trap.module}.py").write_bytes((trap.folder / f"{trap.module}.py").read_bytes())
    monkeypatch.chdir(folder)
    with pytest.raises(ScenarioError, match="shipped nodes only"):
        Simulation(ScenarioCatalog(trap.folder / "uploads").load("stranger"), threads=1)
    assert not trap.has_run


def test_shipped_nodes_of_a_log_start(trap: Trap) -> None:
    trap.file.write_text(TOML.format(node="map_merging"))
    with Simulation(scenario_from_log(trap), threads=1) as simulation:
        simulation.run(0.01)
        assert simulation.time_ns == 10_000_000
        assert "/map_merging/status" in {topic.name for topic in simulation.graph.topics()}


# ----------------------------------------------------------------------------- the command line


@pytest.fixture
def invoke(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The command line in this process, with a folder of its own for what it remembers."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    runner = CliRunner()

    def run(*words: object, typed: str = "") -> Result:
        result = runner.invoke(app, [str(word) for word in words], input=typed)
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result

    return run


Invoke = Callable[..., Result]


@pytest.mark.parametrize("words", [("run",), ("serve", "--port", "0"), ("launch",)])
def test_without_a_terminal_code_beside_a_file_is_refused(
    words: tuple[str, ...], trap: Trap, invoke: Invoke, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(trap.folder)
    if words == ("launch",):
        trap.file.write_text(f'[[launch]]\nnode = "{trap.node}"\n')
    done = invoke(*words, trap.file)
    assert done.exit_code == 2
    assert f"runs code of its own ({trap.module}); give --trust" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not trap.has_run


def test_trust_or_no_nodes_solves_it(trap: Trap, invoke: Invoke, tmp_path: Path) -> None:
    done = invoke("run", trap.file, "--no-nodes")
    assert (done.exit_code, trap.has_run) == (0, False), done.stderr
    done = invoke("run", trap.file, "--trust")
    assert (done.exit_code, trap.has_run) == (0, True), done.stderr
    assert not (tmp_path / "state").exists()  # only answers to prompts are stored


@pytest.mark.parametrize("flags", [(), ("--trust",)])
def test_a_foreign_log_starts_no_code(
    flags: tuple[str, ...], trap: Trap, invoke: Invoke, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By its name alone, even with `--trust`: that is said of a file, not of a log."""
    monkeypatch.chdir(trap.folder)
    log = trap.log()
    done = invoke("run", "stranger", "--replay-commands", log, *flags)
    assert done.exit_code == 2
    assert "shipped nodes only" in done.stderr
    assert not trap.has_run


def test_a_foreign_log_beside_its_scenario_starts_no_code(trap: Trap, invoke: Invoke) -> None:
    done = invoke("run", trap.file, "--replay-commands", trap.log())
    assert done.exit_code == 2
    assert "give --trust" in done.stderr
    assert not trap.has_run


def test_ones_own_log_is_flown_again_with_ones_own_nodes(
    trap: Trap, invoke: Invoke, tmp_path: Path
) -> None:
    words, log = ("run", trap.file, "--trust", "--digest"), tmp_path / "own.mcap"
    once = invoke(*words, "--record", log)
    again = invoke(*words, "--replay-commands", log)
    assert again.exit_code == 0, again.stderr
    assert digest_of(once.stdout) == digest_of(again.stdout)


def digest_of(text: str) -> str:
    return next(line for line in text.splitlines() if line.startswith("digest"))


# ------------------------------------------------------------------------------- asked only once


def test_an_answer_at_a_terminal_is_remembered(
    trap: Trap, invoke: Invoke, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trust, "at_terminal", lambda: True)
    for typed in ("n\n", "\n"):  # the default is no
        refused = invoke("run", trap.file, typed=typed)
        assert refused.exit_code == 2
        assert f"runs code of its own: {trap.module}" in refused.stderr
    assert not trap.has_run
    asked = invoke("run", trap.file, typed="y\n")
    assert asked.exit_code == 0, asked.stderr
    assert trap.has_run
    known = json.loads((tmp_path / "state" / "volery" / "trusted.json").read_text())
    assert known == {str(trap.file): [trap.module]}
    monkeypatch.setattr(trust, "at_terminal", lambda: False)
    again = invoke("run", trap.file)
    assert again.exit_code == 0
    assert "code of its own" not in again.stderr


def test_what_is_remembered_is_of_one_file_and_its_modules(
    trap: Trap, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    kept = tmp_path / "state" / "volery" / "trusted.json"
    kept.parent.mkdir(parents=True)
    kept.write_text(json.dumps({str(trap.file): [trap.module]}))
    access = ScenarioAccess(trap.folder, is_trusted=False)
    assert may_run_local_nodes(trap.file, [trap.node], access)
    (trap.folder / "more.py").write_text("")
    for file, nodes in (
        (trap.folder / "other.toml", [trap.node]),
        (trap.file, [trap.node, "more:X"]),
    ):
        with pytest.raises(ScenarioError, match="give --trust"):
            may_run_local_nodes(file, nodes, access)
    for broken in ("", "[]", '{"x": 1}', "{", f'{{"{trap.file}": 3}}'):
        kept.write_text(broken)
        with pytest.raises(VoleryError, match="give --trust"):
            may_run_local_nodes(trap.file, [trap.node], access)
    assert not may_run_local_nodes(trap.file, ["not_there_at_all:X"], access)
    assert not is_local("volery.autonomy.avoidance.gaps", access)
    assert not trap.has_run


# --------------------------------------------------------------------- processes as users have them


@pytest.mark.parametrize("command", ["run", "test"])
@pytest.mark.parametrize("function", ["beside", "installed"])
def test_predicates_need_trust(trap: Trap, command: str, function: str) -> None:
    """They are called with any arguments, so that installed functions do harm as well."""
    names = {"beside": trap.node, "installed": "os:mkdir"}
    made = trap.folder / "made"
    text = TOML[: TOML.index("[[nodes]]")] + (
        f'[[expect]]\nkind = "predicate"\nfunction = "{names[function]}"\n'
        f'parameters = {{ path = "{made}" }}\n'
    )
    trap.file.write_text(text)
    done = CliRunner().invoke(app, [command, str(trap.file)])
    assert done.exit_code == 2
    assert "runs code of its own" in done.stderr
    assert not trap.has_run
    assert not made.exists()


def test_metrics_of_a_study_need_trust(trap: Trap) -> None:
    made, study = trap.folder / "made", trap.folder / "study.toml"
    study.write_text(
        'name = "small"\nscenario = "hover"\nduration_s = 0.1\n'
        f'metrics = [{{ name = "x", function = "os:mkdir", parameters = {{ path = "{made}" }} }}]\n'
    )
    done = CliRunner().invoke(app, ["sweep", str(study), "--workers", "0"])
    assert done.exit_code == 2
    assert "runs code of its own (os)" in done.stderr
    assert not made.exists()


@pytest.mark.slow
@pytest.mark.parametrize("module", ["numba", "json", "pydantic"])
def test_helper_processes_import_nothing_from_the_working_folder(
    module: str, trap: Trap, tmp_path: Path
) -> None:
    """As `python -m` and `python -c` would, before everything else."""
    (trap.folder / f"{module}.py").write_text(EVIL.format(mark=str(trap.mark)))
    environment = {**os.environ, "VOLERY_CACHE_DIR": str(tmp_path / "cache")}
    script = (
        "from volery.autonomy.perception.warmup import scan_returns\n"
        "from volery.runtime.warmup.parallel_compilation import compile_all\n"
        "compile_all([scan_returns])\n"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", script],
        cwd=trap.folder, env=environment, timeout=900, check=False,
    )  # fmt: skip
    assert done.returncode == 0
    assert not trap.has_run


@pytest.mark.slow
@pytest.mark.parametrize("cwd", ["beside", "elsewhere"])
def test_a_process_starts_no_code(trap: Trap, tmp_path: Path, cwd: str) -> None:
    """`python -m volery` has the working folder on its path."""
    words = ("run", "stranger", "--replay-commands", trap.log()), ("run", trap.file)
    for each in words:
        done = subprocess.run(
            [*VOLERY, *map(str, each)],
            cwd=trap.folder if cwd == "beside" else "/",
            env={**os.environ, "XDG_STATE_HOME": str(tmp_path / "state")},
            stdin=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            timeout=900,
            check=False,
        )
        assert done.returncode == 2
        assert "Traceback" not in done.stderr
        assert not trap.has_run


@pytest.mark.slow
def test_a_terminal_is_asked(trap: Trap, tmp_path: Path) -> None:
    main, side = pty.openpty()
    os.write(main, b"y\n")
    environment = {**os.environ, "XDG_STATE_HOME": str(tmp_path / "state")}
    with subprocess.Popen(
        [*VOLERY, "run", str(trap.file)],
        stdin=side, stderr=side, stdout=subprocess.DEVNULL, env=environment, cwd="/",
    ) as process:  # fmt: skip
        os.close(side)
        output = b""
        with suppress(OSError):  # at its end
            while piece := os.read(main, 4096):
                output += piece
        code = process.wait(250)
    os.close(main)
    assert b"Trust it from now on?" in output
    assert (code, trap.has_run) == (0, True), output
