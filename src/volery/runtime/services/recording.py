"""Records logs while the simulation runs, into one folder."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from volery.bridges.logs.log_writer import LogWriter, create_log
from volery.bridges.logs.recorded_topics import recorded_topics
from volery.bridges.logs.recording import Recorder
from volery.bridges.logs.recordings_quota import room_left
from volery.core.errors import RecordingError
from volery.core.plain_text import plain
from volery.graph.graph import Graph
from volery.runtime.replay.command_log import CommandLog
from volery.runtime.services.results import Fields, offer_command

_OURS = "volery_interfaces/srv"


class RecordingServices:
    """Provides `/volery/start_recording` and `/volery/stop_recording`: one log at a time."""

    def __init__(self, graph: Graph, folder: Path | None, commands: CommandLog) -> None:
        self._graph = graph
        self._commands = commands
        self._folder = None if folder is None else Path(folder)
        self._recorder: Recorder | None = None

    def offer(self) -> None:
        """Creates the services."""
        graph = self._graph
        offer_command(graph, "/volery/start_recording", f"{_OURS}/StartRecording", self._start)
        offer_command(graph, "/volery/stop_recording", f"{_OURS}/StopRecording", self._stop)

    @property
    def name(self) -> str:
        """Path of the log being recorded, below the folder; empty: none."""
        if self._recorder is None or self._folder is None:
            return ""
        return self._recorder.log.path.relative_to(self._folder.resolve()).as_posix()

    def close(self) -> None:
        """Ends a recording that is still running."""
        if self._recorder is not None:
            with contextlib.suppress(RecordingError):  # whole chunks are in the file
                self._commands.end()
                self._end(self._recorder)

    def _start(self, request: Any) -> Fields:
        if self._recorder is not None:
            raise RecordingError(
                f"{self._recorder.log.path.name} is being recorded; stop that first"
            )
        path = self._checked(request.path)
        topics, exclude = request.topics, request.exclude
        matches = recorded_topics(self._graph, topics, exclude)
        room = room_left(path.parent if self._folder is None else self._folder)
        self._recorder = Recorder(self._graph, create_log(path), topics, exclude, room)
        for earlier in self._commands.earlier():
            if matches(earlier.topic):
                self._recorder.log.write(earlier)
        self._recorder.start()
        return {"path": str(path)}

    def _stop(self, _request: Any) -> Fields:
        if self._recorder is None:
            raise RecordingError("nothing is being recorded")
        log = self._end(self._recorder)
        return {"path": str(log.path), "messages": log.messages}

    def _end(self, recorder: Recorder) -> LogWriter:
        self._recorder = None
        recorder.stop()
        return recorder.log

    def _checked(self, name: str) -> Path:
        if self._folder is None:
            raise RecordingError("this simulation was started without a folder for recordings")
        if not name or plain(name) != name:
            raise RecordingError(
                "the path of a recording is empty, or not a path: it has control characters"
            )
        folder = self._folder.resolve()
        path = (folder / name).resolve()
        if path == folder or not path.is_relative_to(folder):
            raise RecordingError(f"'{name}' is outside the folder for recordings")
        if any(part.startswith(".") for part in path.relative_to(folder).parts):
            raise RecordingError(f"'{name}' is a hidden file, or in a hidden folder")
        return path
