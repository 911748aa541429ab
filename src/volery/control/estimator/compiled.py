"""How the filter's larger parts are compiled: with fused multiply-add, but called, not inlined."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from volery.core import compiled

F = TypeVar("F", bound=Callable[..., Any])


def part_kernel(function: F) -> F:
    """Compile a part that kernels call in several places; `vehicle.compiled` inlines instead."""
    return compiled.inner_kernel(function, fastmath={"contract"})
