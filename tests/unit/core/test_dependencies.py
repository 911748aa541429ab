"""Tests that each imported package is a declared dependency, not only a transitive one."""

import ast
import re
import subprocess
import sys
import tomllib
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

ROOT = Path(__file__).parents[3]
PACKAGES = {"volery": ROOT / "src", "volery_benchmarks": ROOT / "benchmarks"}

DISTRIBUTIONS = {"open3d": "open3d"}
"""Distributions of import names, where the distribution need not be installed for the tests."""

FROM_ELSEWHERE = {
    **dict.fromkeys(("genmsg", "genpy", "rosgraph", "rospkg", "rospy"), "a sourced ROS 1"),
    **dict.fromkeys(("rclpy", "sensor_msgs"), "a sourced ROS"),
    "netifaces": "a sourced ROS 1, which works without it",
    "tensordict": "rsl-rl, which its users install themselves",
    "pytest": "the pytest that loads the plugin",
    **dict.fromkeys(
        ("PyFlyt", "crazyflow", "jax", "multiRobotPathPlanner", "pybullet"),
        "environments of their own, made for `volery bench peers`",
    ),
}
"""Import names that pip does not install beside volery, and where they come from."""

NOT_FOR_USERS = {"test", "lint"}
"""Extras that only developers install: the package must run without them."""

LOADERS = {"import_module", "find_spec", "__import__"}


def normalized(distribution: str) -> str:
    return re.sub(r"[-_.]+", "-", distribution).lower()


def declared() -> set[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lines = list(project["dependencies"])
    for extra, more in project["optional-dependencies"].items():
        lines += () if extra in NOT_FOR_USERS else more
    return {normalized(re.match(r"[\w.-]+", line)[0]) for line in lines}


def module_names(tree: ast.AST):
    """Names of the modules that a file imports, also late ones and those given as strings."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module
        elif isinstance(node, ast.Call) and node.args:
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            argument = node.args[0]
            if isinstance(argument, ast.JoinedStr):  # f"scipy.{part}"
                argument = argument.values[0]
            if called in LOADERS and isinstance(argument, ast.Constant):
                yield argument.value


@cache
def third_party() -> dict[str, str]:
    """Import names with the first file that imports each."""
    found = {}
    files = [file for name, folder in PACKAGES.items() for file in (folder / name).rglob("*.py")]
    for file in sorted(files):
        for module in module_names(ast.parse(file.read_text(encoding="utf-8"))):
            top = module.partition(".")[0]
            if top and top not in sys.stdlib_module_names | PACKAGES.keys():
                found.setdefault(top, str(file.relative_to(ROOT)))
    return found


def test_every_imported_package_is_declared():
    imports = {name: file for name, file in third_party().items() if name not in FROM_ELSEWHERE}
    assert len(imports) > 20
    distributions, known = packages_distributions(), declared()
    missing = {}
    for name, file in imports.items():
        candidates = (*distributions.get(name, ()), DISTRIBUTIONS.get(name, ""))
        if not known & {normalized(candidate) for candidate in candidates}:
            missing[name] = file
    assert not missing, "declare in pyproject.toml what these files import"


def test_what_comes_from_elsewhere_is_still_imported():
    assert FROM_ELSEWHERE.keys() <= third_party().keys()


def test_late_imports_and_names_in_strings_count():
    code = "def f(): import a.b; import_module(f'c.{x}'); u.find_spec('d')\nfrom e import g"
    assert sorted(module_names(ast.parse(code))) == ["a.b", "c.", "d", "e"]


def test_a_flight_loads_only_what_its_scenario_uses():
    code = (
        "import sys, volery\n"
        "with volery.Simulation(volery.load_scenario('hover')) as simulation:\n"
        "    simulation.run(0.01)\n"
        "unused = {'matplotlib', 'shapely', 'trimesh', 'PIL', 'starlette'} & set(sys.modules)\n"
        "assert not unused, unused\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
