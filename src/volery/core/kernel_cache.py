"""The cache of one kernel: where it lies on disk, and how it is loaded.

numba names the subfolders of its cache by a hash of the folder that a module lies in: each virtual
environment, checkout and container would compile equal sources anew. And before it loads a
function, it imports the implementations of all types and functions that any kernel can use, which
takes a fifth of a start of Volery and serves only a compilation.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
from numba.core import caching
from numba.core.runtime.nrt import rtsys

_PACKAGE = Path(__file__).resolve().parent.parent
# numba's classes have no type annotations
_LOCATOR: Any = caching.UserProvidedCacheLocator
_CACHE: Any = caching.FunctionCache
_RUNTIME: Any = rtsys
_CONFIG: Any = numba.config


class KernelLocator(_LOCATOR):  # type: ignore[misc]
    """Places kernels of modules outside of this package where numba does."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """Returns the name of the subfolder for a module's kernels."""
        folder = Path(py_file).resolve().parent
        if not folder.is_relative_to(_PACKAGE):
            subpath: str = super().get_suitable_cache_subpath(py_file)
            return subpath
        return ".".join((_PACKAGE.name, *folder.relative_to(_PACKAGE).parts))

    def ensure_cache_path(self) -> None:
        """Makes the subfolder, unless the cache is read-only."""
        if os.access(_CONFIG.CACHE_DIR, os.W_OK):
            super().ensure_cache_path()


LOCATORS = f"{__name__}.{KernelLocator.__name__},IPythonCacheLocator"
"""For numba's option CACHE_LOCATOR_CLASSES."""


class KernelCache(_CACHE):  # type: ignore[misc]
    """Loads kernels without what only a compilation needs; the compiler loads that itself.

    Compiled kernels refer to the reference counts of numba's runtime and, like Volery's kernels, to
    C functions that numba always registers. A kernel that hashes texts would need more.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Returns the kernel's compiled code for a signature, None if the cache has none."""
        _RUNTIME.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Stores the code of a signature, if the cache is writable and the disk has room."""
        with suppress(OSError):
            super().save_overload(sig, data)
