"""Reports a command's error as one line on stderr with an exit code; no traceback by default."""

from __future__ import annotations

import functools
import logging
import os
import signal
import sys
import traceback
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from typing import ParamSpec

import typer

from volery.cli.interrupt import StopSignals, stop_at_once, stopped_code
from volery.cli.terminal import echo_line, echo_lines
from volery.core.errors import VoleryError
from volery.core.plain_text import plain_message

P = ParamSpec("P")

USER_ERROR = 2
_MIN_OPTION, _MAX_OPTION = 1e-9, 1e9
_shows_traceback: ContextVar[bool] = ContextVar("volery_shows_traceback", default=False)


class _LogFormatter(logging.Formatter):
    """Formats a log record's level like `complain` and `warn`."""

    def format(self, record: logging.LogRecord) -> str:
        """Returns `warning: ...`, with the traceback if the record has one."""
        return f"{record.levelname.lower()}: {super().format(record)}"

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - of the base class
        """Returns the message without its traceback, as `complain` prints it."""
        return plain_message(super().formatMessage(record))


def format_logs() -> None:
    """Formats records of the package's loggers like messages of its commands."""
    if logging.lastResort is not None:
        logging.lastResort.setFormatter(_LogFormatter())


def complain(text: str) -> None:
    """Prints `error: ...` on stderr."""
    typer.echo(f"error: {plain_message(text)}", err=True)


def complain_of(error: BaseException, text: str = "") -> None:
    """Prints an error and its location in the user's code; with `--traceback` all frames."""
    complain(text or str(error))
    if _shows_traceback.get():
        echo_lines("".join(traceback.format_exception(error)).rstrip(), err=True)
        return
    for note in getattr(error, "__notes__", ()):
        echo_lines(note, err=True)


def warn(text: str) -> None:
    """Prints `warning: ...` on stderr for a problem that does not end the command."""
    typer.echo(f"warning: {plain_message(text)}", err=True)


def _was_interrupted(error: BaseException | None) -> bool:
    """Returns whether Ctrl-C caused an error: libraries turn it into other errors while loading."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _check_numbers(options: Mapping[str, object]) -> None:
    """Raises `VoleryError` for an option whose number is not finite or out of range."""
    for name, value in options.items():
        if isinstance(value, float) and value and not _MIN_OPTION <= abs(value) <= _MAX_OPTION:
            flag = name.replace("_", "-")
            raise VoleryError(
                f"--{flag}: 0, or a number from {_MIN_OPTION:g} to {_MAX_OPTION:g}, not {value:g}"
            )


def guarded(command: Callable[P, None]) -> Callable[P, None]:
    """Turns a user's errors, Ctrl-C, SIGTERM and SIGHUP into a line on stderr and an exit code."""

    @functools.wraps(command)
    def run(*arguments: P.args, **options: P.kwargs) -> None:
        StopSignals.first = None
        _shows_traceback.set(bool(options.get("traceback")))
        try:
            _check_numbers(options)
            with StopSignals(stop_at_once, (signal.SIGTERM, signal.SIGHUP)):
                command(*arguments, **options)
        except (VoleryError, KeyboardInterrupt) as error:
            if _was_interrupted(error):
                echo_line("stopped", err=True)
                raise typer.Exit(stopped_code()) from None
            complain_of(error)
            raise typer.Exit(USER_ERROR) from None
        except BrokenPipeError:
            # The reader of our output went away (`volery list | head -1`): end quietly, and as
            # other programs do, so that a test that was not finished does not pass.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(128 + signal.SIGPIPE) from None
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            complain(f"{where}{error.strerror or error}")
            raise typer.Exit(USER_ERROR) from None

    return run
