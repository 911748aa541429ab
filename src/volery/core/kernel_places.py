"""Names the subfolders of the kernel cache by module, so that installations share it.

numba names them by a hash of the folder that a module lies in: each virtual environment, checkout
and container would compile equal sources anew.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numba.core import caching

_PACKAGE = Path(__file__).resolve().parent.parent
_LOCATOR: Any = caching.UserProvidedCacheLocator


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


LOCATORS = f"{__name__}.{KernelLocator.__name__},IPythonCacheLocator"
"""For numba's option CACHE_LOCATOR_CLASSES."""
