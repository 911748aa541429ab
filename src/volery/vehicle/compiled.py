"""Compiler options of the physics: one flat kernel, with fused multiply-add.

The fused step is several dozen small functions that call each other a million times a second, so
they are always inlined. Contraction of a product and a sum into one rounding is the only relaxation
of arithmetic: it is the same on every run of one machine.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from volery.core import compiled

F = TypeVar("F", bound=Callable[..., Any])

_FASTMATH = {"contract"}


def fused_kernel(function: F) -> F:
    """Compiles a kernel that Python calls, like `core.compiled.kernel`."""
    return compiled.kernel(function, fastmath=_FASTMATH)


def inner_kernel(function: F) -> F:
    """Compiles a part of a fused kernel, like `core.compiled.inner_kernel`."""
    return compiled.inner_kernel(function, forceinline=True, fastmath=_FASTMATH)


def apart_kernel(function: F) -> F:
    """Compiles a rarely called part: a separate function saves compile time."""
    return compiled.inner_kernel(function, fastmath=_FASTMATH)
