"""The program of a local worker: `python -m volery.cluster.worker_process`.

It reads a `StudyJob` and then batches from its standard input, and writes a `Preparation` and
results to its standard output. It ends when its input does, even within a run: that is when the
driver has ended. Prints of the user's code go to standard error.
"""

from __future__ import annotations

import os
import queue
import sys
import threading
from typing import IO, Any

from volery.cluster.batches import Preparation
from volery.cluster.runs import versions
from volery.cluster.worker_messages import read_message, write_message


def main() -> None:
    """Serves one driver until it ends."""
    replies = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    messages: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(sys.stdin.buffer, messages), daemon=True).start()
    write_message(replies, Preparation(versions()))
    _serve(messages, replies)


def _receive(requests: IO[bytes], messages: queue.SimpleQueue[Any]) -> None:
    """Passes messages on; ends the process with the driver, whatever it is doing."""
    try:
        while True:
            messages.put(read_message(requests))
    except (EOFError, OSError):
        os._exit(0)


def _serve(messages: queue.SimpleQueue[Any], replies: IO[bytes]) -> None:
    from volery.cluster.run_worker import DiskFullError, started_worker

    worker, prepared = started_worker(messages.get())
    write_message(replies, prepared)
    while worker is not None:
        batch = messages.get()
        try:
            write_message(replies, worker.fly(batch))
        except DiskFullError as error:
            write_message(replies, error)


if __name__ == "__main__":
    main()
