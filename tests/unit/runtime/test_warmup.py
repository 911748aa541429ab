"""What a scenario needs compiled, where it is compiled, and that no kernel is forgotten."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from volery.autonomy.mapping import warmup as mapping
from volery.autonomy.perception import warmup as seeing
from volery.core.errors import NodeError, ScenarioError
from volery.graph.nodes.node import Node
from volery.runtime.warmup import core_tasks, parallel_compilation, tasks
from volery.runtime.warmup.requirements import all_needs, needs_of
from volery.runtime.warmup.tasks import name_of, task_of
from volery.scenario.load import load_scenario, parse_scenario


def named(found: list[tasks.Task]) -> set[str]:
    return {name_of(task).removeprefix("volery.") for task in found}


def test_no_run_waits_for_the_kernels_of_nodes_and_cameras_that_it_lacks() -> None:
    assert needs_of(load_scenario("hover")) == [core_tasks.dynamics, core_tasks.sensing]


def test_a_scenario_needs_what_its_nodes_and_sensors_call() -> None:
    found = named(needs_of(load_scenario("forest_search")))
    assert {"runtime.warmup.core_tasks:images", "runtime.warmup.core_tasks:estimates"} <= found
    assert {
        "autonomy.slam.warmup:motion",
        "autonomy.slam.warmup:loop_closure",
        "autonomy.planning.warmup:plans",
        "autonomy.search.warmup:colours",
    } <= found
    assert not {name for name in found if "coverage" in name or "planar" in name}


@pytest.mark.parametrize(
    ("sensor", "world", "task"),
    [
        ({"kind": "gnss"}, {}, core_tasks.fixes),
        ({"kind": "magnetometer"}, {}, core_tasks.magnetic_fields),
        ({"kind": "lidar", "model": "vlp_16"}, {}, core_tasks.point_clouds),
        ({"kind": "lidar"}, {"weather": {"fog_visibility_m": 50.0}}, core_tasks.falling_drops),
        ({"kind": "camera"}, {"weather": {"rain_mm_h": 5.0}}, core_tasks.images_in_rain),
    ],
)
def test_rarer_sensors_compile_where_they_are(
    flat_data: Any, sensor: Any, world: Any, task: tasks.Task
) -> None:
    assert task not in needs_of(parse_scenario(flat_data))
    flat_data["types"]["f450"]["sensors"] = [sensor]
    flat_data["world"] = world
    assert task in needs_of(parse_scenario(flat_data))


NODE = """
from volery.graph.nodes.node import Node

def compile_mine():
    print("compiled")

class Mine(Node):
    @classmethod
    def warmup_tasks(cls):
        return (compile_mine,)
"""


def test_the_kernels_of_a_users_node_are_asked_for_at_each_start(
    flat_data: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    (tmp_path / "mine_alone.py").write_text(NODE)
    monkeypatch.chdir(tmp_path)
    flat_data["types"]["f450"]["nodes"] = [{"node": "mine_alone:Mine"}]
    flat_data["nodes"] = [{"node": "mine_alone:Mine"}, {"node": "not_there:Mine"}]
    found = [task for task in needs_of(parse_scenario(flat_data)) if not tasks.is_own(task)]
    assert [name_of(task) for task in found] == ["mine_alone:compile_mine"]
    assert not needs_of(parse_scenario(flat_data), nodes=False)[2:]
    for _ in range(2):
        parallel_compilation.compile_all(found)
    assert capfd.readouterr().out == 2 * "compiled\n"


BROKEN = """
from volery.graph.nodes.node import Node

def fail():
    raise ValueError("no array")

class Fails(Node):
    @classmethod
    def warmup_tasks(cls):
        return (fail,)

class Names(Node):
    @classmethod
    def warmup_tasks(cls):
        return (not_there,)
"""


def test_a_users_warmup_that_fails_is_reported(
    flat_data: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken_warm_ups.py").write_text(BROKEN)
    monkeypatch.chdir(tmp_path)
    flat_data["nodes"] = [{"node": "broken_warm_ups:Fails"}]
    with pytest.raises(NodeError, match="broken_warm_ups:fail: ValueError: no array"):
        parallel_compilation.compile_all(needs_of(parse_scenario(flat_data))[2:])
    flat_data["nodes"] = [{"node": "broken_warm_ups:Names"}]
    with pytest.raises(ScenarioError, match="Names': warmup_tasks: NameError"):
        needs_of(parse_scenario(flat_data))


def test_functions_are_found_by_their_names() -> None:
    found = all_needs()
    assert mapping.drawn_scans in found
    assert [task_of(name_of(task)) for task in found] == found


def test_a_deleted_cache_does_not_end_a_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As by another version's start, or by `rm -r ~/.cache/volery` beside a server."""
    monkeypatch.setattr(tasks, "cache_dir", lambda: tmp_path / "deleted")
    task = core_tasks.dynamics
    tasks.do(task)
    assert not tasks.is_done(task)


SHARED = """
import os, sys
from numba.core import event
from volery.autonomy.perception import warmup
from volery.runtime.warmup import tasks
from volery.runtime.warmup import parallel_compilation
from volery.core.compiled import cache_dir

class Counting(event.Listener):
    count = 0
    def on_start(self, _event): self.count += 1
    def on_end(self, _event): pass

counting = Counting()
event.register("numba:compile", counting)
if "alone" in sys.argv:
    sys.executable = "/bin/false"
wanted = [warmup.scan_returns, warmup.scan_repeats]
with parallel_compilation.compiled(wanted):
    pass
first = counting.count
for task in wanted:
    assert tasks.is_done(task)
    task()
print(first, counting.count, sum(1 for _ in cache_dir().rglob("*.nbc")))
"""


@pytest.mark.parametrize("helper", ["helped", "alone"])
def test_two_processes_compile_and_one_where_the_other_fails(tmp_path: Path, helper: str) -> None:
    first, then, kept = map(int, output_of(SHARED, helper, cache=tmp_path).split())
    assert first == then  # what the helper compiled is read from the cache
    assert kept == 2
    if helper == "alone":
        assert first == 2


UNCALLED = """
import pkgutil
from importlib import import_module
from numba.core.dispatcher import Dispatcher
import volery.autonomy
from volery.runtime.warmup.requirements import all_needs

for task in all_needs():
    if task.__module__.startswith("volery.autonomy."):
        task()
for module in pkgutil.walk_packages(volery.autonomy.__path__, "volery.autonomy."):
    for name, found in vars(import_module(module.name)).items():
        if not isinstance(found, Dispatcher) or found.targetoptions.get("no_cpython_wrapper"):
            continue
        if found.py_func.__module__ == module.name and not found.overloads:
            print(f"{module.name}:{name}")
"""


def test_all_kernels_that_nodes_call_are_compiled_by_a_warm_up() -> None:
    assert output_of(UNCALLED) == "", (
        "of a node that calls these, `warmup_tasks` names nothing that does"
    )


def test_a_node_without_a_library_says_so_when_it_starts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "pyoctomap", None)
    monkeypatch.setattr(tasks, "_mark", lambda _task: pytest.fail("nothing was compiled"))
    tasks.do(mapping.growing_map)


def test_a_plain_node_needs_nothing() -> None:
    assert Node.warmup_tasks() == ()
    assert seeing.scan_points in all_needs()


def output_of(script: str, *words: str, cache: Path | None = None) -> str:
    own = {} if cache is None else {"VOLERY_CACHE_DIR": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", script, *words],
        env={**os.environ, **own},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
