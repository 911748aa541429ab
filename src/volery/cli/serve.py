"""`volery serve`: serves the page and one world after another until Ctrl-C."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from volery.cli.bridge_checks import check_bridges, token_gaps
from volery.cli.bridges import fit_out, open_bridges
from volery.cli.error_reporting import complain_of, warn
from volery.cli.first_flight import FirstFlight
from volery.cli.flight import RunOptions
from volery.cli.interrupt import Interrupts
from volery.cli.pages import Page, serving
from volery.cli.terminal import echo_line
from volery.cli.trust import with_trust
from volery.core.allocator import return_large_blocks
from volery.core.collector import spared_objects
from volery.core.errors import VoleryError
from volery.scenario import changes
from volery.scenario.changes import LogRequest

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation
    from volery.scenario.catalog import ScenarioCatalog
    from volery.scenario.changes import WorldRequest
    from volery.scenario.schema import Scenario
    from volery.server.settings import PageSettings
    from volery.verdicts.live_verdicts import LiveVerdicts

_log = logging.getLogger(__name__)

_THREADS = 2
_LOG_SUFFIXES = (".mcap", ".bag", ".db3")
_GLANCE_S = 0.02
"""Wall seconds between looks at clients of a paused world, and at Ctrl-C without a world."""
_LAST_RESPONSE_S = 0.1
"""Wall time for the last response to arrive at its client, s."""


@dataclass(frozen=True)
class ServeOptions:
    """Holds the command line's options."""

    first: RunOptions
    """First scenario or log, and the options of all runs."""
    page: PageSettings


class _StoppedError(Exception):
    """Signals between two steps that Ctrl-C was pressed."""


def serve(options: ServeOptions) -> None:
    """Serves until Ctrl-C, or until a client quits the simulator.

    Raises `VoleryError` if the first scenario cannot be built, the first log cannot be opened, or
    the server cannot listen.
    """
    from volery.scenario.catalog import ScenarioCatalog

    check_bridges(options.first)
    for gap in token_gaps(options.first):
        warn(gap)
    log = _log_of(options.first.scenario)
    first = None if log is not None else _first_scenario(with_trust(options.first))
    catalog = ScenarioCatalog(options.page.uploads, options.page.recordings, given=first)
    return_large_blocks()
    with Interrupts() as interrupts, serving(options.page, catalog) as page:
        host = _Host(
            options, page, interrupts, _NextRun(log or first, options.first.speed, catalog)
        )
        while host.goes_on:
            host.go_on()
    echo_line("the server has stopped", err=True)


class _NextRun:
    """Holds what runs next: the first scenario or log, then what clients request."""

    def __init__(
        self, first: Scenario | Path | None, speed: float | None, catalog: ScenarioCatalog
    ) -> None:
        self.catalog = catalog
        """Scenarios that may run."""
        self.speed = speed
        """Initial real-time factor; None: as fast as possible."""
        self.is_requested = True
        self._choice = first
        self.quit: Callable[[], None] = _nothing

    def request(self, request: WorldRequest | LogRequest | None) -> None:
        """Ends the current flight for another one.

        Raises `VoleryError` if the request cannot be met.
        """
        if request is None:
            self.choose(None)
        elif isinstance(request, LogRequest):
            self.choose(request.path)
        else:
            self.choose(changes.apply(self.catalog.load(request.name), request.changes))
            speed = request.changes.speed
            self.speed = self.speed if speed is None else speed or None
        self.quit()

    def choose(self, what: Scenario | Path | None) -> None:
        """Sets the scenario to fly or the log to play next; None: no world."""
        self.is_requested, self._choice = True, what

    def take(self) -> Scenario | Path | None:
        """Returns the current request; later requests come after it."""
        self.is_requested, self.quit = False, _nothing
        return self._choice


class _Host:
    """Builds worlds and runs them, one at a time."""

    def __init__(
        self, options: ServeOptions, page: Page, interrupts: Interrupts, next_run: _NextRun
    ) -> None:
        self._options = options
        self._page = page
        self._interrupts = interrupts
        self._next_run = next_run
        self._present: Scenario | None = None
        """World that was built last."""
        self._problem = ""
        """Last problem, for the page."""
        self._quits = False
        self._is_default = options.page.unasked
        """Whether no client has chosen the world that is built next."""
        self._first_flight: FirstFlight | None = None
        self._verdicts: LiveVerdicts | None = None
        """Verdicts of the present flight; None: its scenario expects nothing."""

    @property
    def goes_on(self) -> bool:
        """Returns whether the server goes on."""
        return not (self._quits or self._interrupts.pressed)

    def go_on(self) -> None:
        """Runs the request until another one arrives; after a failure returns to the last world."""
        choice = self._next_run.take()
        if choice is None:
            self._wait()
            return
        try:
            if isinstance(choice, Path):
                self._play(choice)
            else:
                self._fly(choice)
        except Exception as error:  # an error of ours in one world must not end the others
            if self._present is None:
                raise
            what = str(error) if isinstance(error, VoleryError) else _unexpected(error)
            self._problem = named_problem(choice.name, what)
            complain_of(error, self._problem)
            self._next_run.choose(None if self._present is choice else self._present)

    def _fly(self, scenario: Scenario) -> None:
        """Builds a world and runs it."""
        from volery import Simulation

        first, page = self._options.first, self._page
        page.building(scenario, self._problem)
        threads = _THREADS if first.threads is None else first.threads
        with Simulation(
            fit_out(scenario, first),
            threads=threads,
            recordings=first.recordings,
            on_load=self._next_run.request,
            shelf=self._next_run.catalog,
        ) as simulation:
            self._present, self._next_run.quit = scenario, simulation.clock.quit
            self._interrupts.be_gentle()
            shown = page.showing(simulation, self._problem)
            bridges = open_bridges(simulation.gateway, first, simulation.uavs)
            with spared_objects(), bridges, shown:
                self._problem = ""
                echo_line(f"flying  {scenario.name}", err=True)
                self._first_flight = FirstFlight(simulation) if self._is_default else None
                self._is_default = False
                self._verdicts = _verdicts_of(simulation)
                self._stay(simulation)
                self._first_flight = None
            self._quits = simulation.clock.quitting and not self._next_run.is_requested

    def _play(self, log: Path) -> None:
        """Opens a log and plays it."""
        from volery.runtime.replay.log_player import LogPlayer

        with LogPlayer(
            log,
            on_load=self._next_run.request,
            on_close=self._return,
            catalog=self._next_run.catalog,
        ) as player:
            if player.scenario is not None:
                self._page.building(player.scenario, self._problem)
            _ = player.geometry  # computed here: the server only reads it
            self._next_run.quit = player.quit
            self._interrupts.be_gentle()
            first, page = self._options.first, self._page
            shown = page.showing(player, self._problem, player.name)
            with spared_objects(), open_bridges(player.gateway, first), shown:
                self._problem = ""
                echo_line(f"playing {log.name}", err=True)
                while not (
                    self._next_run.is_requested or player.quitting or self._interrupts.pressed
                ):
                    player.wait(_GLANCE_S)
                player.wait(_LAST_RESPONSE_S)
            self._quits = player.quitting and not self._next_run.is_requested

    def _return(self) -> None:
        """Requests the scenario that ran before a log."""
        self._next_run.choose(self._present)
        self._next_run.quit()

    def _stay(self, simulation: Simulation) -> None:
        """Runs the scenario; at its end stays paused until a reset or another request."""
        speed = self._next_run.speed
        try:
            while not simulation.clock.quitting:
                simulation.run(speed=speed, on_progress=self._look)
                if self._verdicts is not None and not simulation.clock.quitting:
                    self._verdicts.finish()
                simulation.wait_at_end(self._look)
                speed = simulation.clock.speed  # also where it was set at the end
        except _StoppedError:
            return
        time.sleep(_LAST_RESPONSE_S)

    def _look(self, _progress: Any = None) -> None:
        if self._interrupts.pressed:
            raise _StoppedError
        if self._first_flight is not None:
            self._first_flight.look()
        if self._verdicts is not None:
            self._verdicts.look()

    def _wait(self) -> None:
        """Runs the bridges without a world."""
        from volery.runtime.idle_server import IdleServer

        idle = IdleServer(self._next_run.request, self._next_run.catalog)
        bridges = open_bridges(idle.gateway, self._options.first)
        with bridges, self._page.showing(idle, self._problem):
            echo_line("no world is loaded", err=True)
            self._problem = ""
            while not (self._next_run.is_requested or idle.quitting or self._interrupts.pressed):
                idle.wait(_GLANCE_S)
            idle.wait(_LAST_RESPONSE_S)
        self._quits = idle.quitting


def _log_of(name: str) -> Path | None:
    """Returns the path of a log; None for the name or file of a scenario."""
    path = Path(name)
    is_log = path.suffix.lower() in _LOG_SUFFIXES or path.is_dir()
    return path if is_log else None


def _first_scenario(options: RunOptions) -> Scenario:
    from volery import load_scenario
    from volery.scenario import overrides

    return overrides.apply(
        load_scenario(options.scenario, trust=options.trust),
        uavs=options.uavs,
        seconds=options.seconds,
        seed=options.seed,
    )


def _verdicts_of(simulation: Simulation) -> LiveVerdicts | None:
    """Returns what judges a flight; None if its scenario expects nothing."""
    if not simulation.scenario.expect:
        return None
    from volery.verdicts.live_verdicts import LiveVerdicts

    return LiveVerdicts(simulation)


def named_problem(name: str, what: str) -> str:
    """Returns a problem after the name of its scenario or log, which many begin with already."""
    return what if what.startswith(f"{name}: ") else f"{name}: {what}"


def _unexpected(error: Exception) -> str:
    """Returns a sentence for an unexpected error and logs its traceback."""
    _log.error("a world ended with an error", exc_info=error)
    return f"internal error: {type(error).__name__}: {error}"


def _nothing() -> None:
    """Does nothing: no flight has begun."""
