"""Caches numba's type inference during compilation.

For each `a * b`, numba asks dozens of candidates, from matrix products to repeated lists, whether
they can multiply two float64, and formats a message for each rejection; each pass over a function
writes out the fields of its records. That took a fifth of the time, and the results are always the
same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from numba import types

_TYPES: Any = types
_VALUES: Any = (_TYPES.Number, _TYPES.Boolean, _TYPES.Buffer, _TYPES.BaseTuple)


@contextmanager
def remembered_types() -> Iterator[None]:
    """Makes numba resolve each of its own functions once per argument types, in this context.

    Functions that numba compiles for its caller, such as `min`, are not cached: their code depends
    on the caller's options. A numba with other internals compiles as without this context.
    """
    with (
        _wrapped("BaseFunction", "get_call_type", _remember_signatures),
        _wrapped("Record", "__repr__", cache),
    ):
        yield


@contextmanager
def _wrapped(kind: str, name: str, wrap: Callable[[Any], Any]) -> Iterator[None]:
    owner = getattr(_TYPES, kind, None)
    if owner is None or not hasattr(owner, name):
        yield
        return
    method = getattr(owner, name)
    setattr(owner, name, wrap(method))
    try:
        yield
    finally:
        setattr(owner, name, method)


def _remember_signatures(resolve: Callable[..., Any]) -> Callable[..., Any]:
    known: dict[tuple[Any, ...], Any] = {}

    def remember(function: Any, *asked: Any) -> Any:
        question = _question(function, asked)
        if question in known:
            return known[question]
        signature = resolve(function, *asked)
        if question and _is_built_in(function, signature):
            known[question] = signature
        return signature

    return remember


def _question(function: Any, asked: tuple[Any, ...]) -> tuple[Any, ...]:
    """Returns the cache key: function, typing context, argument types; () if unclear."""
    if len(asked) != 3:
        return ()
    context, arguments, keywords = asked
    if keywords or not all(isinstance(argument, _VALUES) for argument in arguments):
        return ()
    return function, context, *arguments


def _is_built_in(function: Any, signature: Any) -> bool:
    """Returns whether a signature's code is numba's own, not compiled for the caller."""
    codes = getattr(function, "_impl_keys", {})
    return bool(signature) and codes.get(signature.args) is function.typing_key
