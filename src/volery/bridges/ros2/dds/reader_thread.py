"""The thread that receives data for all readers of a participant."""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections.abc import Callable
from typing import Any

from cyclonedds.core import (
    DDSException,
    GuardCondition,
    InstanceState,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import DomainParticipant

from volery.bridges.ros2.dds import library

_ANY = ViewState.Any | InstanceState.Any | SampleState.NotRead
_MAX_BATCH = 100
"""Samples of one reader before others have their turn."""
_PERIOD_S = 0.2

_log = logging.getLogger(__name__)

Take = Callable[[list[Any]], None]


class ReaderThread:
    """Waits for data and delivers it; calls `now_and_then` some times a second."""

    def __init__(self, participant: DomainParticipant, now_and_then: Callable[[], None]) -> None:
        self._waitset = WaitSet(participant)
        self._bell = GuardCondition(participant)
        self._numbers = itertools.count(1)
        self._readers: dict[int, tuple[Any, Any, Take]] = {}
        self._closing = False
        self._now_and_then = now_and_then
        library.attach(self._waitset, self._bell, 0)
        self._thread = threading.Thread(target=self._run, name="volery-ros2-dds", daemon=True)
        self._thread.start()

    def listen(self, reader: Any, take: Take) -> int:
        """Delivers a reader's samples to `take`; returns a number for `forget`."""
        number = next(self._numbers)
        condition = ReadCondition(reader, _ANY)
        self._readers[number] = (reader, condition, take)
        library.attach(self._waitset, condition, number)
        return number

    def forget(self, number: int) -> None:
        """Stops reading a reader, which may then be deleted."""
        found = self._readers.pop(number, None)
        if found is not None:
            library.detach(self._waitset, found[1])

    def close(self) -> None:
        """Ends the thread."""
        self._closing = True
        self._bell.set(True)
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        due_s = 0.0
        while not self._closing:
            ready = library.wait(self._waitset, int(_PERIOD_S * 1e9))
            if ready is None:
                return
            if time.monotonic() > due_s:
                due_s = time.monotonic() + _PERIOD_S
                self._look_around()
            for number in ready:
                if number and not self._closing:
                    self._serve(number)

    def _look_around(self) -> None:
        try:
            self._now_and_then()
        except Exception:  # an error here must not end the thread
            _log.exception("ROS 2: a periodic task failed")

    def _serve(self, number: int) -> None:
        found = self._readers.get(number)
        if found is None:
            return
        reader, _, take = found
        try:
            take(reader.take(_MAX_BATCH))
        except DDSException:  # deleted meanwhile
            return
        except Exception:  # an error of one reader must not end the others
            _log.exception("ROS 2: a received sample could not be processed")
