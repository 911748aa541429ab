"""Records logs while the simulation runs, into one folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from volery.bridges.logs.log_writer import LogWriter, open_log
from volery.bridges.logs.recorded_topics import recorded_topics
from volery.bridges.logs.recordings_quota import room_left
from volery.core.errors import RecordingError
from volery.graph.graph import Graph
from volery.graph.messages import Published
from volery.graph.topics import Subscription
from volery.runtime.replay.command_log import CommandLog
from volery.runtime.services.results import Fields, offer_command

_OURS = "volery_interfaces/srv"


class RecordingServices:
    """Provides `/volery/start_recording` and `/volery/stop_recording`: one log at a time."""

    def __init__(self, graph: Graph, folder: Path | None, commands: CommandLog) -> None:
        self._graph = graph
        self._commands = commands
        self._folder = None if folder is None else Path(folder)
        self._log: LogWriter | None = None
        self._subscription: Subscription | None = None
        self._failure: RecordingError | None = None
        self._room = 0
        """Max size of the present log, bytes."""

    def offer(self) -> None:
        """Creates the services."""
        graph = self._graph
        offer_command(graph, "/volery/start_recording", f"{_OURS}/StartRecording", self._start)
        offer_command(graph, "/volery/stop_recording", f"{_OURS}/StopRecording", self._stop)

    @property
    def name(self) -> str:
        """Path of the log being recorded, below the folder; empty: none."""
        if self._log is None or self._folder is None:
            return ""
        return self._log.path.relative_to(self._folder.resolve()).as_posix()

    def close(self) -> None:
        """Ends a recording that is still running."""
        if self._log is not None:
            try:
                self._commands.end()
                self._end()
            except RecordingError:
                return  # no client is left to report to; whole chunks are in the file

    def _start(self, request: Any) -> Fields:
        if self._log is not None:
            raise RecordingError(f"{self._log.path.name} is being recorded; stop that first")
        path = self._checked(request.path)
        self._failure = None
        matches = recorded_topics(self._graph, request.topics, request.exclude)
        self._room = room_left(path.parent if self._folder is None else self._folder)
        self._log = open_log(path)
        for earlier in self._commands.earlier():
            if matches(earlier.topic):
                self._log.write(earlier)
        self._subscription = self._graph.subscribe_all(self._write, matches)
        return {"path": str(path)}

    def _stop(self, _request: Any) -> Fields:
        if self._log is None:
            raise RecordingError("nothing is being recorded")
        failure = self._failure
        log = self._end()
        if failure is not None:
            raise failure
        return {"path": str(log.path), "messages": log.messages}

    def _end(self) -> LogWriter:
        log, self._log = self._log, None
        assert log is not None
        self._leave()
        log.close()
        return log

    def _leave(self) -> None:
        if self._subscription is not None:
            self._subscription.cancel()
            self._subscription = None

    def _write(self, published: Published) -> None:
        """Records a message; an error ends the recording, and stop_recording reports it."""
        try:
            if self._log is not None and self._failure is None:
                self._log.write(published)
                if self._log.size_bytes > self._room:
                    raise RecordingError(
                        f"{self._log.path.name}: ended, as the folder for recordings is full; "
                        "remove some"
                    )
        except RecordingError as error:
            self._failure = error
            self._leave()

    def _checked(self, name: str) -> Path:
        if self._folder is None:
            raise RecordingError("this simulation was started without a folder for recordings")
        if not name or "\0" in name:
            raise RecordingError("the path of a recording is empty or not a path")
        folder = self._folder.resolve()
        path = (folder / name).resolve()
        if path == folder or not path.is_relative_to(folder):
            raise RecordingError(f"'{name}' is outside the folder for recordings")
        return path
