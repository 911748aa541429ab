"""Tests that inner kernels have no machine code of their own, and link from the cache too."""

import os
import subprocess
import sys

import numpy as np
import pytest

from volery.core import compiled, part_compiler
from volery.core.compiled import inner_kernel, kernel

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


@pytest.fixture(autouse=True)
def _nothing_compiled_before(tmp_path, monkeypatch):
    """A kernel that is found in the cache asks for none of its parts."""
    monkeypatch.setattr(compiled, "cache_dir", lambda: tmp_path)


def test_a_kernel_takes_its_part_in_without_machine_code_of_the_part():
    @inner_kernel
    def mean_of(values):
        total = 0.0
        for k in range(values.shape[0]):
            total += values[k]
        return total / values.shape[0]

    @kernel
    def spread_of(values):
        mean, total = mean_of(values), 0.0
        for k in range(values.shape[0]):
            total += (values[k] - mean) ** 2
        return total / values.shape[0]

    values = np.array([1.0, 4.0, -2.5, 8.0])
    assert np.isclose(spread_of(values), values.var(), rtol=1e-15)
    (part,), (whole,) = mean_of.overloads.values(), spread_of.overloads.values()
    name = part.fndesc.llvm_func_name
    assert name in part.library.get_llvm_str()
    assert name.encode() not in part.library._get_compiled_object()
    assert whole.fndesc.llvm_func_name.encode() in whole.library._get_compiled_object()


def test_with_a_numba_that_is_made_otherwise_a_part_has_its_own_code(monkeypatch):
    monkeypatch.setattr(part_compiler, "_NEEDED", ("nothing_of_this_name",))

    @inner_kernel
    def half(x):
        return 0.5 * x

    @kernel
    def quarter(x):
        return half(half(x))

    assert quarter(2.0) == 0.5
    (part,) = half.overloads.values()
    assert part.fndesc.llvm_func_name.encode() in part.library._get_compiled_object()


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
