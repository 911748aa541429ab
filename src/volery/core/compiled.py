"""The one way to compile a kernel: numba, nogil, cached under a key that cannot go stale.

numba notices an edit of the file that holds a kernel, but not of a callee in another file. The
cache folder is therefore named by a hash of all of Volery's sources that hold kernels, the versions
of numba and numpy, and the CPU. An edited kernel gets a fresh folder; old ones are swept away.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

# libgomp and other OpenMP runtimes spin on shared cores for milliseconds unless told not to.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import numba

from volery.core.part_compiler import PartCompiler

F = TypeVar("F", bound=Callable[..., Any])

_CONFIG: Any = numba.config
_TYPES: Any = numba.types

_PACKAGE = Path(__file__).resolve().parent.parent
_KEEP_CACHES = 3


def _kernel_sources() -> list[Path]:
    return sorted(p for p in _PACKAGE.rglob("*.py") if b"kernel" in p.read_bytes())


def _cpu_name() -> str:
    import llvmlite.binding as llvm

    features: str = llvm.get_host_cpu_features().flatten()
    name: str = llvm.get_host_cpu_name()
    return name + hashlib.sha256(features.encode()).hexdigest()[:8]


def _cache_key() -> str:
    digest = hashlib.sha256()
    for source in _kernel_sources():
        digest.update(source.relative_to(_PACKAGE).as_posix().encode())
        digest.update(source.read_bytes())
    for word in (version("numba"), version("numpy"), sys.version, _cpu_name()):
        digest.update(word.encode())
    return digest.hexdigest()[:20]


def cache_root() -> Path:
    """Folder for what can be made again: VOLERY_CACHE_DIR, XDG_CACHE_HOME or ~/.cache."""
    base = os.environ.get("VOLERY_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    root = Path(base) if base else Path.home() / ".cache"
    return root / "volery"


def _sweep(root: Path, keep: Path) -> None:
    """Remove the compiled kernels of older versions, the newest few excepted."""
    others = sorted(
        (p for p in root.iterdir() if p.is_dir() and p != keep),
        key=lambda p: p.stat().st_mtime,
        reverse=True,
    )
    for old in others[_KEEP_CACHES - 1 :]:
        if time.time() - old.stat().st_mtime > 3600:
            shutil.rmtree(old, ignore_errors=True)


@cache
def cache_dir() -> Path:
    """Folder of the compiled kernels; a temporary one where the user's cache is not writable."""
    root = cache_root() / "kernels"
    folder = root / _cache_key()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        _sweep(root, folder)
    except OSError:
        folder = Path(tempfile.gettempdir()) / f"volery-kernels-{os.getuid()}" / folder.name
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def kernel(function: F, **options: Any) -> F:
    """Compile `function` at its first call, without Python's lock, cached on disk.

    Division follows numpy (no ZeroDivisionError): a kernel checks its denominators itself.
    `options` are numba's, such as fastmath.
    """
    return _decorate(function, **options)


def brief_kernel(function: F) -> F:
    """Compile a kernel of some microseconds, which keeps Python's lock.

    Where other threads want the lock, to give it up and to get it back takes longer than such a
    kernel, for all of them.
    """
    return _decorate(function, nogil=False)


def inline_kernel(function: F) -> F:
    """Compile a small helper that both kernels and Python call; LLVM inlines it."""
    return brief_kernel(function)


def inner_kernel(function: F, **options: Any) -> F:
    """Compile a part that only kernels call; a call from Python raises TypeError.

    Without an entry from Python, whose code for a few dozen arrays outweighs a small function, it
    compiles in a fraction of the time. Numbers that a caller writes out count as any others: numba
    would compile the part anew for each of them.

    Its arrays are those of its caller, or views of them: their references are not counted (numba's
    option `_nrt`), for the counts lie in memory that all threads share, and each change of one
    is an atomic instruction. For a part that makes arrays: `owning_kernel`.
    """
    fixed = {"no_cpython_wrapper": True, "_nrt": False, "pipeline_class": PartCompiler}
    choices = {**fixed, **options}
    part: Any = _decorate(function, **choices)

    def refuse(*_arguments: Any, **_keywords: Any) -> None:
        raise TypeError(f"{function.__name__} is a part of a kernel; only kernels can call it")

    template_of, unliteral = part.get_call_template, _TYPES.unliteral

    def template_of_any_number(arguments: tuple[Any, ...], keywords: dict[str, Any]) -> Any:
        plain = tuple(unliteral(argument) for argument in arguments)
        named = {name: unliteral(kind) for name, kind in keywords.items()}
        return template_of(plain, named)

    part.get_call_template = template_of_any_number
    part._compile_for_args = refuse
    part._insert = _ignore  # the entry point that numba would register is null
    return part  # type: ignore[no-any-return]


def owning_kernel(function: F) -> F:
    """Compile an `inner_kernel` that makes arrays of its own."""
    return inner_kernel(function, _nrt=True)


def _ignore(*_arguments: Any, **_keywords: Any) -> None:
    """Do nothing."""


def _decorate(function: F, **options: Any) -> F:
    # What is not said numba takes from whichever kernel first asks for a part, and keeps it for all
    # others: results would depend on the order in which a cache was filled.
    said: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "forceinline": False}
    # Nobody hands kernels to C code: entries for it would take a tenth of the time to compile.
    choices = {**said, "nogil": True, "no_cfunc_wrapper": True, **options}
    saved = _CONFIG.CACHE_DIR
    _CONFIG.CACHE_DIR = str(cache_dir())
    try:
        compiled: F = numba.njit(cache=True, **choices)(function)
    finally:
        _CONFIG.CACHE_DIR = saved
    return compiled
