"""Compiles kernels with numba: nogil, cached under a key that cannot go stale.

numba detects an edit of the file with a kernel, but not of a callee in another file. The cache
folder is therefore named by a hash of all of Volery's sources with kernels, the versions of Python,
numba, llvmlite and numpy, and the CPU. An edited kernel gets a new folder; old folders are deleted.
Where Volery is installed does not matter: installations of equal sources share what is compiled.
"""

from __future__ import annotations

import hashlib
import logging
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

# libgomp and other OpenMP runtimes spin on shared cores for milliseconds by default.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import numba
from numba.core import sigutils
from numba.core.ccallback import CFunc

from volery.core.kernel_cache import LOCATORS, KernelCache
from volery.core.private_folders import (
    UnsafeFolderError,
    is_safe_to_read,
    private_folder,
    temporary_folder,
)

F = TypeVar("F", bound=Callable[..., Any])

_CONFIG: Any = numba.config
_TYPES: Any = numba.types
_SIGNATURES: Any = sigutils
_CALLBACK: Any = CFunc

_PACKAGE = Path(__file__).resolve().parent.parent
_KEEP_CACHES = 3
_log = logging.getLogger(__name__)


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
    versions = [version(name) for name in ("numba", "llvmlite", "numpy")]
    for word in (*versions, sys.version, _cpu_name()):
        digest.update(word.encode())
    return digest.hexdigest()[:20]


def cache_root() -> Path:
    """Returns the cache folder: below VOLERY_CACHE_DIR, XDG_CACHE_HOME or ~/.cache.

    A user without a home folder, as in some containers of clusters, gets a temporary one.
    """
    base = os.environ.get("VOLERY_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    if base:
        return Path(base) / "volery"
    try:
        return Path.home() / ".cache" / "volery"
    except RuntimeError:
        return _private_folder() / "volery"


@cache
def _private_folder() -> Path:
    return temporary_folder("volery-")


def _sweep(root: Path, keep: Path) -> None:
    """Removes the compiled kernels of other versions, except the few that were used last."""
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
    """Returns the folder of compiled kernels, which only this user can write: kernels are code.

    A cache that was compiled for all users, as in a container image, is read-only: what it lacks is
    compiled in each process. The folder is temporary if the cache is not writable and lacks all, or
    if another user can write it.
    """
    root, key = cache_root(), _cache_key()
    if is_safe_to_read(root / "kernels" / key):
        return root / "kernels" / key
    try:
        folder = private_folder(root.parent, root.name, "kernels", key)
        with tempfile.TemporaryFile(dir=folder):
            pass
        os.utime(folder)  # it is in use: others do not delete it
        _sweep(folder.parent, folder)
    except OSError as error:
        folder = _temporary_cache(key)
        if isinstance(error, UnsafeFolderError):
            _log.warning("%s: compiled kernels are in %s instead", error, folder)
    return folder


def _temporary_cache(key: str) -> Path:
    try:
        return private_folder(_private_folder(), "volery-kernels", key)
    except UnsafeFolderError:
        return Path(tempfile.mkdtemp(prefix="volery-kernels-"))


def kernel(function: F, **options: Any) -> F:
    """Compiles `function` at its first call, without the GIL, cached on disk.

    Division follows numpy (no ZeroDivisionError): a kernel checks its denominators itself.
    `options` are numba's, such as fastmath.
    """
    return _decorate(function, **options)


def brief_kernel(function: F) -> F:
    """Compiles a kernel of some microseconds that holds the GIL.

    When other threads want the GIL, releasing and regaining it takes all of them longer than such a
    kernel.
    """
    return _decorate(function, nogil=False)


def inline_kernel(function: F) -> F:
    """Compiles a small helper that both kernels and Python call; LLVM inlines it."""
    return brief_kernel(function)


def inner_kernel(function: F, **options: Any) -> F:
    """Compiles a part that only kernels call; a call from Python raises TypeError.

    The part compiles in a fraction of the time, because a Python entry for a few dozen arrays is
    larger than a small function. Literal numbers of a caller are treated like other numbers: numba
    would compile the part again for each literal.

    The part's arrays are its caller's, or views of them: their references are not counted (numba's
    option `_nrt`), because the counts are in memory shared by all threads, and each change of a
    count is an atomic instruction. For a part that creates arrays, use `owning_kernel`.
    """
    fixed = {"no_cpython_wrapper": True, "_nrt": False}
    choices = {**fixed, **options}
    part: Any = _decorate(function, **choices)

    def refuse(*_arguments: Any, **_keywords: Any) -> None:
        raise TypeError(f"{function.__name__} is an inner kernel; only kernels can call it")

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
    """Compiles an `inner_kernel` that creates arrays."""
    return inner_kernel(function, _nrt=True)


def _ignore(*_arguments: Any, **_keywords: Any) -> None:
    """Does nothing."""


def _decorate(function: F, **options: Any) -> F:
    # numba copies an option that is not set from the first kernel that requests a part, and applies
    # the option to all others: results would depend on the order in which a cache was filled.
    said: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "forceinline": False}
    # Kernels are never passed to C code: entries for C would take a tenth of the time to compile.
    choices = {**said, "nogil": True, "no_cfunc_wrapper": True, **options}
    with _cached_here():
        compiled: Any = numba.njit(**choices)(function)
        compiled._cache = KernelCache(function)
    return compiled  # type: ignore[no-any-return]


def compiled_callback(function: Callable[..., Any], signature: Any) -> Any:
    """Compiles a C function, cached like kernels; its `address` is for C code."""
    arguments, result = _SIGNATURES.normalize_signature(signature)
    with _cached_here():
        callback: Any = _CALLBACK(function, (arguments, result), locals={}, options={})
        callback._cache = KernelCache(function)
        callback.compile()
    return callback


@contextmanager
def _cached_here() -> Iterator[None]:
    """Makes caches that are created in this context lie in `cache_dir`."""
    saved = _CONFIG.CACHE_DIR, _CONFIG.CACHE_LOCATOR_CLASSES
    _CONFIG.CACHE_DIR, _CONFIG.CACHE_LOCATOR_CLASSES = str(cache_dir()), LOCATORS
    try:
        yield
    finally:
        _CONFIG.CACHE_DIR, _CONFIG.CACHE_LOCATOR_CLASSES = saved
