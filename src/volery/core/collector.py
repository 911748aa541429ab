"""Python's garbage collector in a process that serves clients while it simulates.

A full collection looks at every object that the process holds. With the modules of Volery and of
its compiler loaded that takes a fifth of a second, in which neither the simulation nor any client
gets on, and messages of busy clients bring one about every two seconds.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

_THRESHOLDS = (700, 10, 100)
"""Those of Python, but for full collections, which come a tenth as often."""


@contextmanager
def spared_objects() -> Iterator[None]:
    """Context in which full collections are rare and leave out the objects of its beginning.

    Enter it when a simulation has been built: what there is then lives as long as the simulation.
    """
    before = gc.get_threshold()
    gc.collect()
    gc.freeze()
    gc.set_threshold(*_THRESHOLDS)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
