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
    """Compile a part of a fused kernel; a call from Python raises TypeError."""
    part: Any = compiled._decorate(
        function, forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, **_OPTIONS
    )

    def refuse(*_arguments: Any, **_keywords: Any) -> None:
        raise TypeError(f"{function.__name__} is a part of a kernel; only kernels can call it")

    part._compile_for_args = refuse
    part._insert = _ignore  # no entry point for Python, which would be null
    return part  # type: ignore[no-any-return]


def _ignore(*_arguments: Any, **_keywords: Any) -> None:
    """Do nothing."""
