"""Tests that errors about missing packages name the command; README and docs list all extras."""

import re
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from volery.core.errors import ScenarioError, VoleryError
from volery.scenario.load import load_scenario, parse_scenario
from volery.scenario.node_names import registered_nodes
from volery.scenario.node_packages import NODE_PACKAGES, missing_packages

ROOT = Path(__file__).parents[3]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
SMALL = {"types": {"f450": {}}, "uavs": [{"type": "f450", "position_m": [0.0, 0.0]}]}
FOR_DEVELOPERS = {"test", "lint", "bench", "docs"}
"""Extras that are not part of `all`: tools to change, measure and document Volery."""


def loop_closures():
    from volery.autonomy.slam.pose_graph import load_gtsam

    load_gtsam()


def mapping():
    from volery.autonomy.mapping.octree import new_tree

    new_tree(0.1)


def planning():
    from volery.autonomy.planning.global_path import _search

    _search(None, np.zeros(3), np.ones(3), None, 1)


def mavlink():
    from volery.mavlink.codec import dialect

    dialect.__wrapped__()


def checksums():
    from volery.mavlink.codec import _crc

    _crc.__wrapped__()


def identification():
    from volery.control.identification import identify
    from volery.vehicle.airframe import load_airframe

    identify(load_airframe("f450"))


def answers_of_loops():
    from volery.control.identification import _answer
    from volery.vehicle.identified import FirstOrder

    _answer(FirstOrder(kind="first_order", time_constant_s=0.1), 0.0, np.ones(3))


def ros2(middleware):
    from volery.bridges.ros2.environment import Ros2Environment, join_ros2

    return lambda: join_ros2(Ros2Environment(middleware))


def tables():
    from volery.core.data_frames import data_frame

    data_frame({})


def progress_bars():
    from volery.runtime.monitoring.progress_bar import progress_bar

    with progress_bar("hover"):
        pass


def environments():
    import importlib

    import volery.learning

    importlib.reload(volery.learning)


def team_environments():
    import importlib

    pytest.importorskip("gymnasium")
    import volery.learning.team_env

    importlib.reload(volery.learning.team_env)


def tags():
    from volery.autonomy.perception.tags.detector import TagDetector

    TagDetector()


def training(module):
    def use():
        for other in {"gymnasium", "torch", "tensorboard", "stable_baselines3"} - {module}:
            pytest.importorskip(other)
        from volery.learning.training.packages import require_training

        require_training()

    return use


def tensorboard_page():
    from volery.server.tensorboard.process import tensorboard_command

    tensorboard_command(ROOT)


def onnx_models():
    for package in ("gymnasium", "torch", "tensorboard", "stable_baselines3"):
        pytest.importorskip(package)
    from volery.learning.training.onnx_export import export_onnx

    export_onnx("hover", Path("hover.onnx"))


def tables_of_runs():
    from volery.cluster.table import arrow_module

    arrow_module("`volery sweep`")


def intervals():
    from volery.cluster.confidence import estimate_mean

    estimate_mean([1.0, 2.5])


def hypercubes():
    from volery.cluster.points import draw
    from volery.cluster.study import StudySampling

    draw([], StudySampling(method="latin_hypercube", samples=2))


def searches():
    from volery.cluster.failure_search import TpeSampler

    TpeSampler(1, 1)


def cluster():
    from volery.cluster.ray_worker import ray_pool

    ray_pool(None, "auto", None)


def browser():
    from volery_benchmarks.page.browser import open_browser

    with open_browser():
        pass


USES = [
    ("gtsam", "gtsam", "autonomy", loop_closures),
    ("pyoctomap", "pyoctomap", "autonomy", mapping),
    ("ompl", "ompl", "autonomy", planning),
    ("pymavlink.dialects.v20", "pymavlink", "mavlink", mavlink),
    ("fastcrc", "fastcrc", "mavlink", checksums),
    ("scipy", "scipy", "identify", identification),
    ("scipy.signal", "scipy", "identify", answers_of_loops),
    ("cyclonedds", "cyclonedds", "ros2", ros2("dds")),
    ("zenoh", "eclipse-zenoh", "ros2", ros2("zenoh")),
    ("pandas", "pandas", "pandas", tables),
    ("tqdm.auto", "tqdm", "progress", progress_bars),
    ("gymnasium", "gymnasium", "learning", environments),
    ("pettingzoo", "pettingzoo", "learning", team_environments),
    ("cv2", "opencv-python-headless", "vision", tags),
    ("torch", "torch", "train", training("torch")),
    ("tensorboard", "tensorboard", "train", training("tensorboard")),
    ("tensorboard", "tensorboard", "train", tensorboard_page),
    ("stable_baselines3", "stable-baselines3", "train", training("stable_baselines3")),
    ("onnx", "onnx", "train", onnx_models),
    ("pyarrow", "pyarrow", "sweep", tables_of_runs),
    ("scipy.special", "scipy", "sweep", intervals),
    ("scipy.stats", "scipy", "sweep", hypercubes),
    ("optuna", "optuna", "search", searches),
    ("ray", "ray", "cluster", cluster),
    ("playwright.sync_api", "playwright", "bench", browser),
]
"""Modules, their packages and extras, and a use of each."""
WORKS_WITHOUT = {"open3d"}
"""Packages without which only a comparison is left out."""


def test_every_package_of_an_extra_is_in_the_table():
    extras = EXTRAS.keys() - {"all", "test", "lint", "docs"}
    packages = {(re.match(r"[\w-]+", each)[0], extra) for extra in extras for each in EXTRAS[extra]}
    listed = {(package, extra) for _, package, extra, _ in USES}
    others = WORKS_WITHOUT | {"volery"}  # an extra may include another one
    assert {pair for pair in packages if pair[0] not in others} == listed


@pytest.mark.parametrize(("module", "package", "extra", "use"), USES)
def test_what_lacks_a_package_says_which_command_installs_it(
    monkeypatch, module, package, extra, use
):
    assert any(re.match(rf"{package}\b", each) for each in EXTRAS[extra])
    for name in [n for n in sys.modules if n == module or n.startswith(f"{module}.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(VoleryError) as caught:
        use()
    assert re.search(rf'needs? {package}: pip install "volery\[{extra}\]"', str(caught.value))
    assert "\n" not in str(caught.value)


def test_scenarios_know_the_packages_of_their_nodes():
    """Each module that a shipped node imports late is listed, for cards and for a check at once."""
    of_nodes = {"autonomy", "vision", "mavlink"}
    used = {(name.partition(".")[0], package, extra) for name, package, extra, _ in USES}
    listed = {(need.module, need.package, need.extra) for need in NODE_PACKAGES}
    assert listed == {use for use in used if use[2] in of_nodes}
    assert {need.node for need in NODE_PACKAGES} <= registered_nodes().keys()


def test_a_scenario_without_its_packages_fails_before_anything_is_built(monkeypatch):
    from volery.runtime import simulation

    monkeypatch.setattr(simulation, "build_world", lambda *_: pytest.fail("a world was built"))
    monkeypatch.setitem(sys.modules, "cv2", None)
    scenario = load_scenario("servoing")
    command = r'tag_detection needs opencv-python-headless: pip install "volery\[vision\]"'
    with pytest.raises(ScenarioError, match=f"^servoing: {command}$"):
        simulation.Simulation(scenario)
    monkeypatch.setitem(sys.modules, "no_such_module", None)
    data = {"name": "own", "nodes": [{"node": "no_such_module:Node"}], **SMALL}
    with pytest.raises(ScenarioError, match=r"own: nodes\[0\]: .*cannot be imported"):
        simulation.Simulation(parse_scenario(data))


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        (
            "raise ImportError('libtbb.so.12: cannot open shared object file\\n\\nRead ...')",
            "libtbb.so",
        ),
        ("raise OSError('libGL.so.1: cannot open shared object file')", "libGL.so.1"),
        ("raise AttributeError('_ARRAY_API not found')", "_ARRAY_API not found"),
        ("raise RuntimeError('module compiled against ABI version 0x1000009')", "ABI version"),
        ("import a_package_that_is_missing", "No module named 'a_package_that_is_missing'"),
    ],
)
def test_an_installed_package_that_does_not_load_is_not_called_missing(
    monkeypatch, tmp_path, code, reason
):
    """As `import cv2` fails on servers without libGL; the command would change nothing."""
    from volery.runtime import simulation

    monkeypatch.setattr(simulation, "build_world", lambda *_: pytest.fail("a world was built"))
    (tmp_path / "gtsam.py").write_text(code)
    monkeypatch.delitem(sys.modules, "gtsam", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    data = {"name": "own", "nodes": [{"node": "slam"}], **SMALL}
    with pytest.raises(ScenarioError) as caught:
        simulation.Simulation(parse_scenario(data))
    text = str(caught.value)
    assert text.startswith("own: slam needs gtsam, which is installed but cannot be imported: ")
    assert reason in text
    assert "pip install" not in text
    assert "\n" not in text


def test_a_folder_is_no_package(monkeypatch, tmp_path):
    """Python takes an empty folder on its path for a package."""
    (tmp_path / "gtsam").mkdir()
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    monkeypatch.delitem(sys.modules, "gtsam", raising=False)
    data = {"name": "own", "nodes": [{"node": "slam"}], **SMALL}
    assert "slam needs gtsam" in missing_packages(parse_scenario(data))


def test_loop_closures_alone_need_gtsam(monkeypatch):
    monkeypatch.setitem(sys.modules, "gtsam", None)
    data = {"name": "own", "nodes": [{"node": "slam"}], **SMALL}
    assert "slam needs gtsam" in missing_packages(parse_scenario(data))
    data["nodes"] = [{"node": "slam", "parameters": {"loop_closures": False}}]
    assert missing_packages(parse_scenario(data)) == ""


def test_all_is_the_union_of_the_extras_for_users():
    (union,) = EXTRAS["all"]
    users = EXTRAS.keys() - FOR_DEVELOPERS - {"all"}
    assert union == f"volery[{','.join(sorted(users))}]"


@pytest.mark.parametrize("name", ["README.md", "docs/extras.md"])
def test_readme_and_docs_list_all_extras(name):
    table = [line for line in (ROOT / name).read_text().splitlines() if line.startswith("| `")]
    listed = [each for line in table for each in re.findall(r"`(\w+)`", line.split("|")[1])]
    assert EXTRAS.keys() - {"all"} <= set(listed)
    assert "volery[all]" in (ROOT / "docs/extras.md").read_text()


def test_docs_name_only_extras_that_exist():
    for path in [ROOT / "README.md", *ROOT.glob("docs/*.md")]:
        for group in re.findall(r"(?:volery|\.)\[([a-z0-9,]+)\]", path.read_text()):
            unknown = set(group.split(",")) - set(EXTRAS)
            assert not unknown, f"{path.name}: {unknown}"
