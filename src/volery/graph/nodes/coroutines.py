"""Runs callbacks that are coroutines: `response = await self.client.call_async(request)`.

A coroutine runs until it awaits a future that is not done, and goes on as a callback of its own
when that is. Simulated time stands still in between only if the future is done at once.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from types import CoroutineType
from typing import Any

from volery.core.errors import GraphError

Run = Callable[[Callable[[], None]], None]


def is_coroutine(result: Any) -> bool:
    """Returns whether a callback has returned a coroutine."""
    return type(result) is CoroutineType


def advance(coroutine: Coroutine[Any, Any, Any], run: Run) -> None:
    """Runs a coroutine as far as it goes; `run` runs the rest, as a callback of the node.

    Raises `GraphError` if it awaits anything but a future of rclpy.
    """
    try:
        awaited = coroutine.send(None)
    except StopIteration:
        return
    if not hasattr(awaited, "add_done_callback"):
        coroutine.close()
        raise GraphError("a callback can await futures of rclpy only, such as call_async returns")
    awaited.add_done_callback(lambda _future: run(lambda: advance(coroutine, run)))


def result_of(coroutine: Coroutine[Any, Any, Any]) -> Any:
    """Returns the result of a coroutine. Raises `GraphError` if it has to wait."""
    try:
        coroutine.send(None)
    except StopIteration as end:
        return end.value
    coroutine.close()
    raise GraphError("a service responds at once: its callback cannot await what is not done")
