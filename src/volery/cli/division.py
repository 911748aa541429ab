"""`volery run --workers` and `volery worker`: one simulation on several machines."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from volery.cli.error_reporting import USER_ERROR, warn
from volery.cli.terminal import echo_line
from volery.core.errors import DivisionError, VoleryError
from volery.core.machine import usable_cores

if TYPE_CHECKING:
    from volery.cli.flight import RunOptions
    from volery.cluster.division.workers import Workers
    from volery.scenario.schema import Scenario

PORT = 8790
"""Default port at which workers join."""
_AUTOPILOTS = ("px4", "px4-serial", "ardupilot")
_WAIT_S = 60.0


@contextmanager
def workers_of(
    options: RunOptions, scenario: Scenario, is_stopped: Callable[[], bool]
) -> Iterator[Workers | None]:
    """Context in which the workers of a run exist; None: it is not divided.

    Raises `DivisionError` for options that a divided run does not support.
    """
    if options.workers is None:
        for flag, given in (("--listen", options.listen), ("--drop-lost", options.drop_lost)):
            if given:
                raise DivisionError(f"{flag} is of a divided run: add --workers N")
        yield None
        return
    _check(options)
    from volery.cluster.division.workers import DivisionOptions, Workers

    listen = None
    if options.listen is not None:
        from volery.core.network_access import check_address, check_token

        listen = parse_address("--listen", options.listen)
        check_address(listen[0], anywhere=options.allow_remote, flag="--allow-remote")
        if not options.token:
            raise DivisionError(
                "--listen needs a token, which workers must know: set VOLERY_TOKEN on all machines"
            )
        check_token(listen[0], options.token)
    division = DivisionOptions(
        options.workers, listen, options.token, options.drop_lost, options.trust
    )
    with Workers(division, scenario, _show, is_stopped) as workers:
        yield workers


def threads_of(options: RunOptions, default: int) -> int:
    """Returns the number of threads of the leader, which shares its cores with workers here."""
    if options.threads is not None:
        return options.threads
    if options.workers is None or options.listen is not None:
        return default
    return max(1, min(default, usable_cores() // (options.workers + 1)))


def parse_address(flag: str, text: str) -> tuple[str, int]:
    """Returns host and port of `HOST[:PORT]`. Raises `DivisionError` for another text."""
    host, colon, port = text.rpartition(":")
    if not colon or text.endswith("]"):
        host, port = text, str(PORT)
    if not host or not port.isdecimal() or int(port) > 65535:
        raise DivisionError(f"{flag}: HOST or HOST:PORT, not '{text}'")
    return host.strip("[]"), int(port)


def join_run(
    address: str,
    token: str | None,
    threads: int | None,
    *,
    trust: bool,
    folder: Path | None,
    quiet: bool,
) -> None:
    """Joins the leader of a divided run and serves its part to the end.

    quiet: prints nothing; errors of the part reach the leader.
    """
    host, port = parse_address("--join", address)
    if not token:
        raise DivisionError("set VOLERY_TOKEN to the token of the leader's run")
    from volery.cluster.division.joining import serve_leader

    try:
        reason = serve_leader(
            (host, port),
            token,
            threads=threads or usable_cores(),
            trust=trust,
            folder=folder,
            wait_s=_WAIT_S,
            show=_ignore if quiet else _show,
        )
    except VoleryError:
        if quiet:
            raise typer.Exit(USER_ERROR) from None
        raise
    if not quiet:
        echo_line(reason)


def _check(options: RunOptions) -> None:
    if options.replay_commands is not None:
        raise DivisionError("--replay-commands: one machine replays a flight; leave out --workers")
    for text in options.bridges:
        name = text.partition("=")[0]
        if name in _AUTOPILOTS:
            raise DivisionError(
                f"--bridge {name}: autopilots in lock step fly on one machine; leave out --workers"
            )
    cores = usable_cores()
    if options.listen is None and (options.workers or 0) >= cores:
        warn(f"--workers {options.workers}: this machine has {cores} cores, one is the leader's")


def _ignore(_line: str) -> None:
    """Prints nothing."""


def _show(line: str) -> None:
    echo_line(line, err=True)
