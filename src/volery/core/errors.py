"""The error tree. Whatever a user can cause is a `VoleryError` with one clear sentence."""

from __future__ import annotations

import os
from enum import Enum


class VoleryError(Exception):
    """Base of all errors that Volery raises on purpose."""


class ScenarioError(VoleryError):
    """A scenario cannot be loaded or run; the message names file, key and what is allowed."""


class DataFileError(VoleryError):
    """A data file (inventory, elevation grid, airframe, sensor) is missing or broken."""


class SpawnFault(Enum):
    """Which of a new UAV's terms is at fault."""

    NAME = "name"
    NAME_TAKEN = "name taken"
    TYPE = "type"


class SpawnError(VoleryError):
    """A UAV cannot come into being; `fault` says why not."""

    def __init__(self, fault: SpawnFault, message: str) -> None:
        super().__init__(message)
        self.fault = fault


class PlacementError(ScenarioError):
    """A UAV was placed where it cannot be: inside a tree, under the ground, inside another."""


class RecordingError(VoleryError):
    """A log cannot be written (disk full, no permission) or read."""


class GraphError(VoleryError):
    """A topic, service or message does not fit: wrong type, unknown name, invalid rate."""


class BridgeError(VoleryError):
    """A bridge to the graph cannot be opened, or its peer breaks the protocol."""


class UnreachableError(BridgeError):
    """Nobody answers where a graph is looked for; somebody may later."""


class NodeError(VoleryError):
    """A node failed: its code raised an exception, or cannot go on."""

    def __init__(self, text: str, *, node: str = "", time_ns: int = 0) -> None:
        """Take the full name of the node and the time of its failure where they are known."""
        super().__init__(text)
        self.node = node
        self.time_ns = time_ns
        self.is_reported = False
        """Whether it has been logged as the node's failure."""


class CommandError(VoleryError):
    """A command is refused: not finite, out of range, or impossible in the present mode."""


class DivergenceError(VoleryError):
    """The state of a UAV is not physical: not finite, too fast, too far away."""

    def __init__(self, uav: str, time_s: float, message: str) -> None:
        super().__init__(message)
        self.uav = uav
        self.time_s = time_s


class PatternError(VoleryError):
    """A text is no regular expression, or one that is too large."""


class SnapshotError(VoleryError):
    """A state cannot be kept or taken back: something in the run does not offer its state."""


class PartnerError(VoleryError):
    """A lock-step partner did not answer in time, or spoke out of turn."""


class EstimatorError(VoleryError):
    """An estimator is given what it cannot use: wrong shape, unknown row, wrong order."""


class PlanError(VoleryError):
    """A plan is refused: a start that cannot be, a map that is too large or has nothing free."""


class CommsError(VoleryError):
    """A message cannot be sent over the radio network, or a station cannot join it."""


def reason_of(error: Exception) -> str:
    """Why something failed, in words for people: an `OSError` without number, names and addresses.

    asyncio tells of a refused connection as "Connect call failed ('127.0.0.1', 9090)".
    """
    number = error.errno if isinstance(error, OSError) else None
    if number is not None and number > 0:  # those of failed look-ups of names are negative
        return os.strerror(number)
    told = error.strerror if isinstance(error, OSError) else None
    return told or str(error) or type(error).__name__
