"""Compiler options of the filter's larger parts: fused multiply-add, called instead of inlined."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from volery.core import compiled

F = TypeVar("F", bound=Callable[..., Any])


def part_kernel(function: F) -> F:
    """Compiles a part that kernels call several times; `vehicle.compiled` inlines instead."""
    return compiled.inner_kernel(function, fastmath={"contract"})
