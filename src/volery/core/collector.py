"""Configures Python's garbage collector in a process that serves clients while it simulates.

A full collection visits every object of the process. With the modules of Volery and of its compiler
loaded, that takes a fifth of a second, during which simulation and clients stop, and messages of
busy clients cause one about every two seconds.
"""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_THRESHOLDS = (700, 10, 300)
"""Python's defaults, but with full collections a thirtieth as often."""
_lock = threading.Lock()


class _Contexts:
    """Number of contexts that have not ended, and the thresholds before the first of them."""

    num_open = 0
    num_begun = 0
    thresholds = gc.get_threshold()


@contextmanager
def spared_objects() -> Iterator[None]:
    """Context in which full collections are rare and skip the objects that exist at its start.

    Enter the context when a simulation has been built: its objects live as long as the simulation.
    Contexts of several threads may overlap: the last one to end restores the collector.
    """
    if _Contexts.num_begun:  # a process that has just started has next to no garbage
        gc.collect()
    with _lock:
        if not _Contexts.num_open:
            _Contexts.thresholds = gc.get_threshold()
        _Contexts.num_open += 1
        _Contexts.num_begun += 1
        gc.freeze()
        gc.set_threshold(*_THRESHOLDS)
    try:
        yield
    finally:
        with _lock:
            _Contexts.num_open -= 1
            if not _Contexts.num_open:
                gc.set_threshold(*_Contexts.thresholds)
                gc.unfreeze()


def collect_young() -> None:
    """Collects garbage among the objects that were made recently.

    Python does so by itself when many more objects are made than freed. Where clients come as fast
    as others go, it does not notice, and a later collection of all of them takes too long.
    """
    gc.collect(1)
