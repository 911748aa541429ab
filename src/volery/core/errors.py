"""Defines the errors: all that a user can cause are `VoleryError`s with one clear sentence."""

from __future__ import annotations

import os
from enum import Enum


class VoleryError(Exception):
    """Base class of all errors that Volery raises deliberately."""


class ScenarioError(VoleryError):
    """A scenario cannot be loaded or run; the message names file, key and allowed values."""


FAILURES = (Exception, SystemExit)
"""What code of users raises when it fails: `sys.exit` in it ends no more than an exception."""


class DataFileError(VoleryError):
    """A data file (inventory, elevation grid, airframe, sensor) is missing or broken."""


class SpawnFault(Enum):
    """Why a UAV cannot be spawned: which argument is invalid, or that building it failed."""

    NAME = "name"
    """The name has characters that topics cannot have."""
    NAME_TAKEN = "name taken"
    """Another UAV or actor has the name."""
    TYPE = "type"
    """There is no such type of UAV."""
    FAILED = "failed"
    """A step of building the UAV failed; none of it is left."""


class SpawnError(VoleryError):
    """A UAV cannot be spawned; `fault` is the reason."""

    def __init__(self, fault: SpawnFault, message: str) -> None:
        super().__init__(message)
        self.fault = fault
        """Kind of the reason."""


class PlacementError(ScenarioError):
    """A UAV's position is impossible: inside a tree, under the ground, inside another UAV."""


class RecordingError(VoleryError):
    """A log cannot be written (disk full, no permission) or read."""


class LogWarning(UserWarning):
    """A log is read as far as possible; the message names its damage."""


class GraphError(VoleryError):
    """A topic, service or message does not fit: wrong type, unknown name, invalid rate."""


class DivisionError(VoleryError):
    """A run cannot be divided among machines, or a divided run cannot go on."""


class BridgeError(VoleryError):
    """A bridge to the graph cannot be opened, or its peer breaks the protocol."""


class UnreachableError(BridgeError):
    """There is no server at a graph's address; one may start later."""


class NodeError(VoleryError):
    """A node failed: its code raised an exception, or cannot continue."""

    def __init__(self, text: str, *, node: str = "", time_ns: int = 0) -> None:
        """Creates the error with the node's full name and the time of its failure, if known."""
        super().__init__(text)
        self.node = node
        """Full name of the node; empty: unknown."""
        self.time_ns = time_ns
        """Simulated time of the failure, ns; 0: unknown."""
        self.is_reported = False
        """Whether the error has been logged as the node's failure."""


class CommandError(VoleryError):
    """A command is rejected: not finite, out of range, or impossible in the current mode."""


class FlightError(VoleryError):
    """A flight command did not complete: the UAV crashed, or another command replaced it."""


class WaitTimeoutError(VoleryError, TimeoutError):
    """What a run waited for did not happen within `timeout_s` of simulated time."""


class SensorError(VoleryError):
    """A sensor has no sample yet, or does not exist."""


class DivergenceError(VoleryError):
    """The state of a UAV is not physical: not finite, too fast, too far away."""

    def __init__(self, uav: str, time_s: float, message: str) -> None:
        super().__init__(message)
        self.uav = uav
        """Name of the UAV."""
        self.time_s = time_s
        """Simulated time, s."""


class PatternError(VoleryError):
    """A text is not a regular expression, or is too large."""


class SnapshotError(VoleryError):
    """A state cannot be saved or restored: some part of the run does not support it."""


class PartnerError(VoleryError):
    """A lock-step partner did not respond in time, or out of order."""


class EstimatorError(VoleryError):
    """An estimator received invalid input: wrong shape, unknown row, wrong order."""


class PlanError(VoleryError):
    """A plan is rejected: an impossible start, or a map that is too large or has no free space."""


class CommsError(VoleryError):
    """A message cannot be sent over the radio network, or a station cannot join it."""


def reason_of(error: Exception) -> str:
    """Returns the reason of an error for users: an `OSError` without number, names and addresses.

    asyncio reports a refused connection as "Connect call failed ('127.0.0.1', 9090)".
    """
    if isinstance(error, UnicodeDecodeError):
        byte = error.object[error.start]
        return f"not UTF-8 text (byte 0x{byte:02x} at {error.start}): save it as UTF-8"
    number = error.errno if isinstance(error, OSError) else None
    if number is not None and number > 0:  # those of failed name look-ups are negative
        return os.strerror(number)
    reason = error.strerror if isinstance(error, OSError) else None
    return reason or str(error) or type(error).__name__
