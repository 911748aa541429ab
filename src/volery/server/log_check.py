"""Reads logs in a separate process: their duration, and whether they can be played.

    python -m volery.server.log_check summary FILE ...
    python -m volery.server.log_check play FILE

It prints a JSON list with an object for each file: `seconds`, `messages`, `problem`, or `error`
alone.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from volery.core.errors import VoleryError
from volery.server.bounded_process import (
    BoundedError,
    ProcessBounds,
    bound_this_process,
    run_bounded,
)

BOUNDS = ProcessBounds(memory_bytes=3 << 30, cpu_s=60, wall_s=240.0)
"""A chunk of the max size takes 1 GB; numpy and the codecs reserve another one."""
_FILES_AT_ONCE = 200
"""Max number of files in one process."""


def look_into(paths: Sequence[Path], *, play: bool = False) -> list[dict[str, Any]]:
    """Returns this module's output for each file; `error` also if the process failed.

    play: also opens the file for playback.
    """
    found: list[dict[str, Any]] = []
    for first in range(0, len(paths), _FILES_AT_ONCE):
        some = paths[first : first + _FILES_AT_ONCE]
        try:
            words = ["play" if play else "summary", *map(str, some)]
            found += run_bounded("volery.server.log_check", words, BOUNDS)
        except BoundedError as error:
            if len(some) == 1:
                found.append({"error": f"{some[0]}: {error}"})
            else:
                found += [one for path in some for one in look_into([path], play=play)]
    return found


def main(what: str, *files: str) -> None:
    """Reads files and prints their summaries."""
    bound_this_process(BOUNDS)
    results = [_of(Path(file), play=what == "play") for file in files]
    sys.stdout.write(json.dumps(results))


def _of(path: Path, *, play: bool) -> dict[str, Any]:
    from volery.bridges.logs.playback import Playback
    from volery.bridges.logs.reader import summarize

    try:
        summary = summarize(path)
        if play and summary.messages:
            Playback(path).close()
    except MemoryError:
        return {"error": f"{path}: needs more than {BOUNDS.memory_bytes >> 30} GB of memory"}
    except (VoleryError, OSError) as error:
        return {"error": str(error)}
    return {
        "seconds": round(summary.duration_s, 3),
        "messages": summary.messages,
        "problem": summary.problem,
    }


if __name__ == "__main__":
    main(*sys.argv[1:])
