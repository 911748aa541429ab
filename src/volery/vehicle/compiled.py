"""How the physics is compiled: one flat kernel, with fused multiply-add.

The fused step is several dozen small functions that call each other a million times a second, so
they are always inlined. Contraction of a product and a sum into one rounding is the only liberty
taken with arithmetic: it is the same on every run of one machine.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from volery.core import compiled

F = TypeVar("F", bound=Callable[..., Any])

_FASTMATH = {"contract"}


def fused_kernel(function: F) -> F:
    """Compile a kernel that Python calls, like `core.compiled.kernel`."""
    return compiled.kernel(function, fastmath=_FASTMATH)


def inner_kernel(function: F) -> F:
    """Compile a part of a fused kernel, like `core.compiled.inner_kernel`."""
    return compiled.inner_kernel(function, forceinline=True, fastmath=_FASTMATH)


def apart_kernel(function: F) -> F:
    """Compile a part that is called seldom: a function of its own spares the compiler's time."""
    return compiled.inner_kernel(function, fastmath=_FASTMATH)
