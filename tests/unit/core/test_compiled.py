"""Tests that compiled kernels are cached, and that an edited kernel gets a new cache."""

import ast
import importlib
import os
import shutil
import subprocess
import sys
import tempfile
from enum import EnumType
from pathlib import Path

import pytest

from volery.core import compiled
from volery.core.kernel_cache import KernelLocator
from volery.grading.sandbox import bubblewrap

_TWO_KERNELS = """
import sys
from volery.core.compiled import inner_kernel, kernel

@inner_kernel
def lift(x, by):
    return x * by if x > 0.0 else min(by, 2.0)

@inner_kernel
def lift_twice(x, by):
    return lift(lift(x, by), by)

@kernel
def first(x):
    return lift_twice(x, 3.0)

@kernel
def second(x):
    return lift_twice(x, 5.0) + lift(x, 7.0)

print({"first": first, "second": second}[sys.argv[1]](2.0), len(lift_twice.stats.cache_hits))
"""

_MOVE = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
from volery.core.rotation_kernels import moved_points

half_turn = np.array([0.0, 0.0, 1.0, 0.0])
moved = moved_points(np.array([[1.0, 2.0, 3.0]]), half_turn, np.zeros(3))
print(*moved[0], sum(moved_points.stats.cache_hits.values()), sys.modules["volery"].__file__)
"""

_QUANTILE = """
import sys
sys.path.insert(0, sys.argv[1])
from volery.core.rng import normal_quantile

print(round(normal_quantile(0.975), 3), sum(normal_quantile.stats.cache_hits.values()))
"""

_LOADED = """
import sys
import numpy as np
from volery.core.rotation_kernels import moved_points

moved_points(np.zeros((1, 3)), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3))
print("numba.np.linalg" in sys.modules, sum(moved_points.stats.cache_hits.values()))
"""


def test_cache_key_depends_on_every_kernel_source(monkeypatch, tmp_path):
    source = tmp_path / "callee.py"
    source.write_text("x = 1  # kernel")
    monkeypatch.setattr(compiled, "_PACKAGE", tmp_path)
    before = compiled._cache_key()
    source.write_text("x = 2  # kernel")
    assert compiled._cache_key() != before


def test_installations_of_equal_sources_share_compiled_kernels(tmp_path):
    """Two checkouts or virtual environments: what one has compiled, the other loads."""
    env = {**os.environ, "VOLERY_CACHE_DIR": str(tmp_path / "cache")}
    env.pop("PYTHONPATH", None)
    outputs = []
    for checkout in (tmp_path / "first", tmp_path / "second"):
        shutil.copytree(Path(compiled.__file__).parent, checkout / "volery" / "core")
        (checkout / "volery" / "__init__.py").touch()
        done = subprocess.run(
            [sys.executable, "-P", "-c", _MOVE, str(checkout)],
            env=env,
            capture_output=True,
            text=True,
            check=True,
        )
        outputs.append(done.stdout.split())
        assert outputs[-1][-1] == str(checkout / "volery" / "__init__.py")
    assert outputs[0][:4] == ["-1.0", "-2.0", "3.0", "0"]
    assert outputs[1][:4] == ["-1.0", "-2.0", "3.0", "1"]


def test_kernels_of_other_files_are_kept_apart_by_path(tmp_path):
    paths = [tmp_path / name / "mine.py" for name in ("a", "b")]
    subpaths = {KernelLocator.get_suitable_cache_subpath(str(path)) for path in paths}
    assert len(subpaths) == 2


def test_constants_that_kernels_import_belong_to_the_cache_key():
    """numba freezes them: an edit of a file that is not in the key would go unnoticed."""
    hashed, package = set(compiled._kernel_sources()), compiled._PACKAGE
    for source in hashed:
        tree = ast.parse(source.read_text(encoding="utf-8"))
        imports = [node for node in tree.body if isinstance(node, ast.ImportFrom) and node.module]
        if not any(node.module == "volery.core.compiled" for node in imports):
            continue
        used = _names_in_kernels(tree)
        for node in imports:
            origin = package.parent / f"{node.module.replace('.', '/')}.py"
            names = used.intersection(alias.name for alias in node.names)
            if origin.is_file() and any(_is_constant(node.module, name) for name in names):
                assert origin in hashed, f"{source.name}: mention the kernels in {origin}"


def _names_in_kernels(tree: ast.Module) -> set[str]:
    """Names that kernels and constants of a module use; others are read by Python at each call."""
    nodes = [inner for node in tree.body if _is_read(node) for inner in ast.walk(node)]
    return {node.id for node in nodes if isinstance(node, ast.Name)}


def _is_read(node: ast.stmt) -> bool:
    """Whether a statement is a kernel, or neither function nor class."""
    decorators = getattr(node, "decorator_list", None)
    return decorators is None or any("kernel" in ast.unparse(each) for each in decorators)


def _is_constant(module: str, name: str) -> bool:
    value = getattr(importlib.import_module(module), name)
    return isinstance(value, (int, float, tuple, EnumType))


def test_unwritable_cache_falls_back_to_a_temporary_folder(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    code = "from volery.core.compiled import cache_dir; print(cache_dir())"
    env = {**os.environ, "VOLERY_CACHE_DIR": str(blocked), "TMPDIR": str(tmp_path)}
    out = subprocess.run(
        [sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True
    )
    assert out.stdout.strip().startswith(str(tmp_path / "volery-"))


def test_a_user_without_a_home_folder(tmp_path, monkeypatch):
    def home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", home)
    monkeypatch.delenv("VOLERY_CACHE_DIR", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(compiled, "_private_folder", compiled._private_folder.__wrapped__)
    root = compiled.cache_root()
    assert root.is_relative_to(tmp_path)
    assert compiled.cache_root() == root
    assert root.parent.stat().st_mode & 0o077 == 0
    root.parent.chmod(0o777)  # others can write it, and a cache holds code
    assert compiled.cache_root() != root


def test_old_caches_are_swept(tmp_path):
    for i in range(6):
        folder = tmp_path / f"old{i}"
        folder.mkdir()
        os.utime(folder, (i, i))
    keep = tmp_path / "now"
    keep.mkdir()
    compiled._sweep(tmp_path, keep)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["now", "old4", "old5"]


def test_each_start_counts_as_a_use_of_its_cache(tmp_path, monkeypatch):
    """So a cache whose kernels are complete is not deleted beneath a process that runs."""
    monkeypatch.setenv("VOLERY_CACHE_DIR", str(tmp_path))
    folder = compiled.cache_dir.__wrapped__()
    os.utime(folder, (0, 0))
    assert compiled.cache_dir.__wrapped__() == folder
    for i in range(3):
        (folder.parent / f"older{i}").mkdir()
        os.utime(folder.parent / f"older{i}", (1 + i, 1 + i))
    compiled._sweep(folder.parent, folder.parent / "none")
    assert sorted(p.name for p in folder.parent.iterdir()) == sorted([folder.name, "older2"])


def test_only_a_brief_kernel_keeps_pythons_lock():
    def twice(x):
        return 2.0 * x

    kept, given = compiled.brief_kernel(twice), compiled.kernel(twice)
    assert kept(1.5) == given(1.5) == 3.0
    assert not kept.targetoptions["nogil"]
    assert given.targetoptions["nogil"]


def test_a_part_from_the_cache_links_into_another_kernel(tmp_path):
    (tmp_path / "two.py").write_text(_TWO_KERNELS)
    env = {**os.environ, "VOLERY_CACHE_DIR": str(tmp_path / "cache")}
    answers = [
        subprocess.run(
            [sys.executable, str(tmp_path / "two.py"), name],
            env=env,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()
        for name in ("first", "second", "first")
    ]
    # The third takes the whole kernel from the cache, and asks for no part.
    assert answers == [["18.0", "0"], ["64.0", "1"], ["18.0", "0"]]


def test_a_kernel_from_the_cache_needs_no_compiler(tmp_path):
    """The implementations that only a compilation needs would take a fifth of a start."""
    env = {**os.environ, "VOLERY_CACHE_DIR": str(tmp_path)}
    lines = [
        subprocess.run(
            [sys.executable, "-c", _LOADED], env=env, capture_output=True, text=True, check=True
        ).stdout.strip()
        for _ in range(2)
    ]
    assert lines == ["True 0", "False 1"]


@pytest.mark.skipif(bubblewrap() is None, reason="needs bubblewrap: apt-get install bubblewrap")
def test_a_read_only_cache_serves_what_it_has(tmp_path):
    """As in a container image: other kernels are compiled in each process, and not stored."""
    cache, copy = tmp_path / "cache", tmp_path / "copy"
    shutil.copytree(Path(compiled.__file__).parent, copy / "volery" / "core")
    (copy / "volery" / "__init__.py").touch()
    walls = ["bwrap", "--dev-bind", "/", "/", "--ro-bind", str(cache), str(cache)]
    env = {**os.environ, "VOLERY_CACHE_DIR": str(cache)}
    env.pop("PYTHONPATH", None)
    outputs = []
    for words, code in (([], _MOVE), (walls, _MOVE), (walls, _QUANTILE)):
        command = [*words, sys.executable, "-P", "-c", code, str(copy)]
        done = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        outputs.append(done.stdout.split()[:4])
    moved = ["-1.0", "-2.0", "3.0"]
    assert outputs == [[*moved, "0"], [*moved, "1"], ["1.96", "0"]]
    assert list(cache.rglob("*moved_points*"))
    assert not list(cache.rglob("*normal_quantile*"))
