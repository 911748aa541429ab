"""Time to think: a node's callbacks on a worker, their output held back by a declared latency.

A callback's input is taken at simulated time t; what it publishes and asks for is released at
t + latency. Meanwhile the engine runs on, and waits for the worker only when t + latency has come:
a heavy node uses another core, its delay is that of a real computer, and the run stays as
reproducible as without. Callbacks of one node run one after the other, in the order of their input;
inputs do not wait for earlier outputs.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from queue import SimpleQueue
from typing import Any, Protocol

from volery.core.errors import GraphError

Action = Callable[[], Any]


class Deferred(Protocol):
    """Whoever can do something at a simulated time."""

    def at(self, time_ns: int, action: Action) -> None:
        """Call `action` once, at `time_ns`."""


@dataclass
class _Thought:
    """The callbacks of one instant: when their input was taken, and what they want done later."""

    time_ns: int
    work: list[Action] = field(default_factory=list)
    output: list[Action] = field(default_factory=list)
    batch: _Batch | None = None
    """With which it is worked on; None before."""
    error: BaseException | None = None


class _Batch:
    """Thoughts that the worker takes up together."""

    def __init__(self, thoughts: list[_Thought]) -> None:
        self.thoughts = thoughts
        self._busy = threading.Lock()
        self._busy.acquire()
        for thought in thoughts:
            thought.batch = self

    def finish(self) -> None:
        """Let those go on who wait for it."""
        self._busy.release()

    def wait(self) -> None:
        """Until it has been worked on."""
        with self._busy:
            return


class DeferredExecutor:
    """The worker of one node. All methods but `now_ns` and `hold_back` belong to the engine.

    Waking a thread takes longer than most callbacks: they are handed over some at a time, when the
    first of them is a third of the latency old, or with one that is said to be heavy.
    """

    def __init__(
        self, name: str, latency_ns: int, deferring: Deferred, now_ns: Callable[[], int]
    ) -> None:
        self._latency_ns = latency_ns
        self._deferring = deferring
        self._engine_now_ns = now_ns
        self._waiting: list[_Thought] = []
        """Not yet handed over, in the order of their time."""
        self._inbox: SimpleQueue[_Batch | None] = SimpleQueue()
        self._here: _Thought | None = None
        """What the worker works on."""
        self._last: _Batch | None = None
        self._closed = False
        self.busy_s = 0.0
        """CPU time of the worker so far."""
        self._thread = threading.Thread(target=self._run, name=f"volery-{name}", daemon=True)
        self._thread.start()

    def think(self, work: Action, *, heavy: bool = False) -> None:
        """Do `work()` on the worker; its output is released after the latency."""
        if self._closed:
            return
        now = self._engine_now_ns()
        if not self._waiting or self._waiting[-1].time_ns != now:
            thought = _Thought(now)
            self._waiting.append(thought)
            self._deferring.at(now + self._latency_ns, partial(self._release, thought))
        self._waiting[-1].work.append(work)
        if heavy or 3 * (now - self._waiting[0].time_ns) >= self._latency_ns:
            self._hand_over()

    def answer(self, work: Action) -> Any:
        """Do `work()` after all that came before it, and wait for what it returns."""
        result: list[Any] = []
        self.think(lambda: result.append(work()), heavy=True)
        batch = self._last
        if batch is None or self._closed:
            raise GraphError("the node has ended")
        batch.wait()
        if not result:
            raise batch.thoughts[-1].error or GraphError("the node has ended")
        return result[0]

    def now_ns(self) -> int:
        """Time of the input that is being worked on; in the engine's thread, the engine's time."""
        thought = self._thought()
        return self._engine_now_ns() if thought is None else thought.time_ns

    def hold_back(self, action: Action) -> bool:
        """Keep `action` for the release of the callback that runs here; False if none does."""
        thought = self._thought()
        if thought is None:
            return False
        thought.output.append(action)
        return True

    def join(self) -> None:
        """Have everything worked on, and wait for it; on the worker itself do nothing."""
        if self._thought() is not None:
            return
        self._hand_over()
        if self._last is not None:
            self._last.wait()

    def close(self) -> None:
        """End the worker; what has not been begun is dropped."""
        self._closed = True
        self._inbox.put(None)
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _hand_over(self) -> None:
        if self._waiting and not self._closed:
            self._last = _Batch(self._waiting)
            self._waiting = []
            self._inbox.put(self._last)

    def _release(self, thought: _Thought) -> None:
        """The time of a thought is up: wait for it and do what it wants done."""
        if self._closed:
            return
        if thought.batch is None:
            self._hand_over()
        assert thought.batch is not None
        thought.batch.wait()
        if thought.error is not None:
            raise thought.error
        for action in thought.output:
            action()

    def _thought(self) -> _Thought | None:
        return self._here if threading.get_ident() == self._thread.ident else None

    def _run(self) -> None:
        while (batch := self._inbox.get()) is not None:
            for thought in batch.thoughts:
                self._here = thought
                try:
                    self._work(thought)
                finally:
                    self._here = None
            batch.finish()

    def _work(self, thought: _Thought) -> None:
        before = time.thread_time()
        try:
            while thought.work and not self._closed:
                thought.work.pop(0)()
        except BaseException as error:  # told by the engine when the time of the thought is up
            thought.error = error
        finally:
            self.busy_s += time.thread_time() - before
