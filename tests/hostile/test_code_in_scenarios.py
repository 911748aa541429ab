"""Nodes are code: which modules a scenario, a log or a launch profile may have imported."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from volery.bridges.logs.bag import open_log
from volery.bridges.logs.flights import Origin
from volery.cli.trust import may_run_local_nodes
from volery.core.errors import ScenarioError, VoleryError
from volery.graph import messages as m
from volery.runtime import Simulation
from volery.runtime.node_loading import find_node, is_local, local_nodes
from volery.runtime.origin import scenario_of
from volery.runtime.warm_up.needs import needs_of
from volery.scenario.access import ScenarioAccess
from volery.scenario.load import load_scenario, parse_scenario
from volery.scenario.schema import NodeEntry, Scenario
from volery.scenario.shelf import Shelf

VOLERY = [sys.executable, "-m", "volery.cli"]
EVIL = """
from pathlib import Path
Path({mark!r}).write_text("run")
from volery.graph.node import Node
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
        """A log beside it that tells of the scenario and of its folder."""
        told = {"name": "stranger", "seed": 1, "version": "0", "folder": str(self.folder)}
        path = self.folder / "stranger.mcap"
        with closing(open_log(path)) as log:
            text = json.dumps(told | {"content": self.content})
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


def volery(
    *words: object, cwd: Path, state: Path, **options: Any
) -> subprocess.CompletedProcess[Any]:
    environment = {**os.environ, "XDG_STATE_HOME": str(state)}
    return subprocess.run(
        [*VOLERY, *map(str, words)],
        cwd=cwd,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=250,
        check=False,
        **options,
    )


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
    assert local_nodes(scenario) == (trap.node,)
    needs_of(scenario)  # what is compiled before the flight asks nodes, too
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
    assert local_nodes(scenario) == ()
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
    "node", ["volery.cli.__main__:main", "volery.bench.search_peer:Calling", "volery.graph:Node"]
)
def test_programs_of_volery_are_no_nodes(trap: Trap, node: str) -> None:
    """Importing some of them would start them."""
    trap.file.write_text(TOML.format(node=node))
    with pytest.raises(ScenarioError, match="is no node that ships"):
        Simulation(load_scenario(trap.file), threads=1)


@pytest.mark.parametrize("node", ["json:JSONDecoder", "volery.autonomy.gaps:Gap", "os:system"])
def test_only_nodes_are_started(trap: Trap, node: str) -> None:
    trap.file.write_text(TOML.format(node=node))
    with pytest.raises(ScenarioError, match=r"is no subclass|has no class"):
        Simulation(load_scenario(trap.file), threads=1)


# ---------------------------------------------------------------------------- logs and uploads


def scenario_from_log(trap: Trap, own: Scenario | None = None) -> Scenario:
    return scenario_of(Origin("stranger", 1, "0", trap.content), own, folder=trap.folder)


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
        Simulation(Shelf(trap.folder / "uploads").load("stranger"), threads=1)
    assert not trap.has_run


def test_shipped_nodes_of_a_log_start(trap: Trap) -> None:
    trap.file.write_text(TOML.format(node="volery.autonomy.mapping.merging_node:MapMerging"))
    with Simulation(scenario_from_log(trap), threads=1) as simulation:
        simulation.run(0.01)


# ----------------------------------------------------------------------------- the command line


def test_without_a_terminal_a_scenario_with_code_is_refused(trap: Trap, tmp_path: Path) -> None:
    for cwd in (trap.folder, Path("/")):
        for words in (("run",), ("serve", "--port", "0")):
            done = volery(*words, trap.file, cwd=cwd, state=tmp_path / "state")
            assert done.returncode == 2
            assert f"runs code that lies beside it ({trap.module}); give --trust" in done.stderr
            assert len(done.stderr.splitlines()) == 1
    assert not trap.has_run


def test_trust_and_no_nodes_are_ways_out(trap: Trap, tmp_path: Path) -> None:
    done = volery("run", trap.file, "--no-nodes", cwd=Path("/"), state=tmp_path / "state")
    assert (done.returncode, trap.has_run) == (0, False), done.stderr
    done = volery("run", trap.file, "--trust", cwd=Path("/"), state=tmp_path / "state")
    assert (done.returncode, trap.has_run) == (0, True), done.stderr
    assert not (tmp_path / "state").exists()  # remembered is only what was asked for


def test_a_strangers_log_starts_no_code(trap: Trap, tmp_path: Path) -> None:
    """By its name alone, and even with `--trust`: that is said of a file, not of a log."""
    log = trap.log()
    for flags in ((), ("--trust",)):
        done = volery(
            "run", "stranger", "--replay-commands", log, *flags, cwd=trap.folder,
            state=tmp_path / "state",
        )  # fmt: skip
        assert done.returncode == 2
        assert "shipped nodes only" in done.stderr
    assert not trap.has_run
    done = volery(
        "run", trap.file, "--replay-commands", log, cwd=trap.folder, state=tmp_path / "state"
    )
    assert "give --trust" in done.stderr
    assert not trap.has_run


def test_ones_own_log_is_flown_again_with_ones_own_nodes(trap: Trap, tmp_path: Path) -> None:
    words = ("run", trap.file, "--trust", "--digest")
    log = tmp_path / "own.mcap"
    once = volery(*words, "--record", log, cwd=Path("/"), state=tmp_path / "state")
    again = volery(*words, "--replay-commands", log, cwd=Path("/"), state=tmp_path / "state")
    assert again.returncode == 0, again.stderr
    assert digest_of(once.stdout) == digest_of(again.stdout)


def digest_of(text: str) -> str:
    return next(line for line in text.splitlines() if line.startswith("digest"))


def test_a_launch_profile_with_code_is_refused(trap: Trap, tmp_path: Path) -> None:
    profile = trap.folder / "profile.toml"
    profile.write_text(f'[[launch]]\nnode = "{trap.node}"\n')
    done = volery("launch", profile, cwd=trap.folder, state=tmp_path / "state")
    assert done.returncode == 2
    assert f"runs code that lies beside it ({trap.module}); give --trust" in done.stderr
    assert not trap.has_run


@pytest.mark.parametrize("module", ["numba", "json", "pydantic"])
def test_helper_processes_import_nothing_from_the_working_folder(
    module: str, trap: Trap, tmp_path: Path
) -> None:
    """As `python -m` and `python -c` would, before everything else."""
    (trap.folder / f"{module}.py").write_text(EVIL.format(mark=str(trap.mark)))
    environment = {**os.environ, "VOLERY_CACHE_DIR": str(tmp_path / "cache")}
    script = (
        "from volery.autonomy.warm_up import scan_returns\n"
        "from volery.runtime.warm_up.sharing import compile_all\n"
        "compile_all([scan_returns])\n"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", script],
        cwd=trap.folder, env=environment, timeout=250, check=False,
    )  # fmt: skip
    assert done.returncode == 0
    assert not trap.has_run


# ------------------------------------------------------------------------------- asked only once


class Terminal:
    """stdin and stderr are terminals; `answer` is typed."""

    def __init__(self, trap: Trap, state: Path, answer: str, *words: str) -> None:
        main, side = pty.openpty()
        os.write(main, answer.encode())
        command = [*VOLERY, "run", str(trap.file), *words]
        environment = {**os.environ, "XDG_STATE_HOME": str(state)}
        with subprocess.Popen(
            command, stdin=side, stderr=side, stdout=subprocess.DEVNULL, env=environment, cwd="/"
        ) as process:
            os.close(side)
            said = b""
            while True:
                try:
                    piece = os.read(main, 4096)
                except OSError:
                    break
                said += piece
                if not piece:
                    break
            self.code = process.wait(250)
        os.close(main)
        self.said = said.decode(errors="replace")


def test_an_answer_at_a_terminal_is_remembered(trap: Trap, tmp_path: Path) -> None:
    state = tmp_path / "state"
    refused = Terminal(trap, state, "n\n")
    assert refused.code == 2
    assert f"runs code that lies beside it: {trap.module}" in refused.said
    assert "Trust it from now on?" in refused.said
    assert not trap.has_run
    assert Terminal(trap, state, "\n").code == 2  # the default is no
    asked = Terminal(trap, state, "y\n")
    assert asked.code == 0, asked.said
    assert trap.has_run
    known = json.loads((state / "volery" / "trusted.json").read_text())
    assert known == {str(trap.file): [trap.module]}
    again = Terminal(trap, state, "")
    assert again.code == 0
    assert "Trust it" not in again.said


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
    assert not is_local("volery.autonomy.gaps", access)
    assert not trap.has_run
