"""How the physics is compiled: one flat kernel, with fused multiply-add.

The fused step is several dozen small functions that call each other a million times a second, so
they are always inlined and get no entry from Python. Contraction of a product and a sum into one
rounding is the only liberty taken with arithmetic: it is the same on every run of one machine.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from volery.core import compiled

F = TypeVar("F", bound=Callable[..., Any])

_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "fastmath": {"contract"}}


def fused_kernel(function: F) -> F:
    """Compile a kernel that Python calls, like `core.compiled.kernel`."""
    return compiled._decorate(function, **_OPTIONS)


def inner_kernel(function: F) -> F:
    """Compile a part of a fused kernel; Python cannot call it."""
    return compiled._decorate(
        function, forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, **_OPTIONS
    )
