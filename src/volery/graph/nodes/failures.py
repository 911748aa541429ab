"""Locates exceptions in the code of nodes, in the user's own lines.

An error gets a note (PEP 678) with the frames of the node's file, without those of Volery: the
command line prints the note below the error, and `--traceback` prints all frames.
"""

from __future__ import annotations

import logging
import sysconfig
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from volery.core.errors import NodeError, VoleryError
from volery.graph.graph import Graph
from volery.graph.nodes import PYTHON_LOGGER
from volery.graph.nodes.logger import (
    LOG_TYPE,
    ROSOUT,
    LoggingSeverity,
    log_message,
    python_log,
)

_PACKAGE = str(Path(__file__).parents[2])
_PATHS = sysconfig.get_paths()
_PYTHON = (_PATHS["stdlib"], "<frozen", "<string")
_INSTALLED = (_PATHS["purelib"], _PATHS["platlib"])
_MACHINERY = tuple(str(Path(_PACKAGE, "graph", name)) for name in ("nodes", "node.py"))
"""Frames between the engine and a callback."""


def user_frames(error: BaseException) -> list[traceback.FrameSummary]:
    """Returns the frames of an error in the user's files.

    Without such frames, those in installed packages; for a node of Volery its own frames, unless
    the error is a `VoleryError`.
    """
    frames = list(traceback.extract_tb(error.__traceback__))
    others = [f for f in frames if not f.filename.startswith((_PACKAGE, *_INSTALLED, *_PYTHON))]
    installed = [
        f
        for f in frames
        if f.filename.startswith(_INSTALLED) and not f.filename.startswith(_PACKAGE)
    ]
    if others or installed or isinstance(error, VoleryError):
        return others or installed
    return [f for f in frames if not f.filename.startswith(_MACHINERY)]


def location_of(error: BaseException) -> str:
    """Returns ` (FILE:LINE)` of the last user frame; empty without one."""
    if isinstance(error, SyntaxError) and error.filename:
        return f" ({Path(error.filename).name}:{error.lineno})"
    frames = user_frames(error)
    return f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""


def frames_text(error: BaseException) -> str:
    """Returns the user's frames as Python prints them, with full file names; may be empty."""
    if isinstance(error, SyntaxError):
        return "".join(traceback.format_exception_only(error)[:-1]).rstrip()
    return "".join(traceback.format_list(user_frames(error))).rstrip()


def add_frames(error: BaseException, cause: BaseException) -> None:
    """Adds a note to `error` with the user's frames of its cause."""
    text = frames_text(cause)
    if text:
        error.add_note(text)


def report_failure(graph: Graph, error: NodeError, *, is_raised: bool = True) -> None:
    """Logs a node's failure as FATAL on `/rosout`, at once; once for each error.

    An error that is not raised to a caller also goes to Python's `logging`. Queued messages of the
    graph stay queued.
    """
    if error.is_reported or not error.node:
        return
    error.is_reported = True
    name = error.node.strip("/").replace("/", ".")
    text = "\n".join([str(error), *getattr(error, "__notes__", ())])
    frames = [] if error.__cause__ is None else user_frames(error.__cause__)
    location = (
        (frames[-1].filename, frames[-1].name, frames[-1].lineno or 0) if frames else ("", "", 0)
    )
    time_ns = error.time_ns
    message: Any = log_message(name, time_ns, LoggingSeverity.FATAL, text, location)
    graph.publish_at_end(graph.advertise(ROSOUT, LOG_TYPE), message)
    if not is_raised:
        logger = logging.getLogger(f"{PYTHON_LOGGER}.{name}")
        python_log(logger, name, time_ns, LoggingSeverity.FATAL, text)


@contextmanager
def reported_failures(graph: Graph) -> Iterator[None]:
    """Reports a node's failure that ends the context, and raises it again."""
    try:
        yield
    except NodeError as error:
        report_failure(graph, error)
        raise
