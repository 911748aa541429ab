"""`volery topic list|type|echo|hz|bw|pub`: inspects a graph's topics from a terminal."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial

from volery.cli.connections import ConnectionMonitor, open_link
from volery.cli.graph_queries import topic_types, type_of_topic
from volery.cli.terminal import echo_line, echo_lines
from volery.cli.yaml_codec import read_message, to_yaml
from volery.core.errors import BridgeError
from volery.graph.connection import GraphConnection
from volery.graph.messages import Published

_DEPTH = 1000
_CLOCK_WAIT_S = 2.0
"""Time within which a graph with a clock publishes it."""
_REFUSAL_WAIT_S, _REFUSAL_LOOK_S = 1.0, 0.05
"""Time within which a server refuses a command that it has received."""


def list_topics(via: str, *, types: bool) -> None:
    """Prints the topics, one per line, without those that ROS 2 hides: a part begins with _."""
    with closing(open_link(via, "volery_topic_list")) as link:
        found = topic_types(link)
        if not found:
            where = getattr(link, "where", via)
            echo_line(f"no topics found: {where}", err=True)
    for topic, msgtype in found.items():
        if "/_" not in topic:
            echo_line(f"{topic} [{msgtype}]" if types else topic)


def show_type(via: str, topic: str) -> None:
    """Prints a topic's type."""
    with closing(open_link(via, "volery_topic_type")) as link:
        echo_line(type_of_topic(link, topic))


def echo(via: str, topic: str, *, count: int | None, whole: bool) -> None:
    """Prints messages as YAML, each followed by a line of dashes."""
    left = math.inf if count is None else count
    for published in _messages(via, topic, "volery_topic_echo"):
        if published is None:
            continue
        echo_lines(to_yaml(published.message, whole=whole))
        echo_line("---")
        left -= 1
        if left <= 0:
            return


@dataclass
class Window:
    """Arrivals of the last messages: wall times (s) and sizes (bytes)."""

    max_messages: int
    times: list[float] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)
    is_fresh: bool = False
    """Whether a message has arrived since `take_line`."""

    def add(self, time_s: float, size: int) -> None:
        """Adds a message; removes the oldest beyond `max_messages`."""
        self.times.append(time_s)
        self.sizes.append(size)
        del self.times[: -self.max_messages], self.sizes[: -self.max_messages]
        self.is_fresh = True

    def take_line(self, line: Callable[[Window], str]) -> str:
        """Returns `line(self)`, or that no message has arrived since the last call."""
        fresh, self.is_fresh = self.is_fresh, False
        return line(self) if fresh else "no new messages"

    def rate_line(self) -> str:
        """Returns rate and periods in the format of `rostopic hz`."""
        periods = [b - a for a, b in zip(self.times, self.times[1:], strict=False)]
        if not periods:
            return "no new messages"
        mean = sum(periods) / len(periods)
        spread = math.sqrt(sum((p - mean) ** 2 for p in periods) / len(periods))
        return (
            f"average rate: {1.0 / mean:.3f}\n\tmin: {min(periods):.4f}s max: {max(periods):.4f}s "
            f"std dev: {spread:.5f}s window: {len(self.times)}"
        )

    def bandwidth_line(self) -> str:
        """Returns bandwidth and sizes in the format of `rostopic bw`."""
        if len(self.times) < 2:
            return "no new messages"
        span = self.times[-1] - self.times[0]
        mean = sum(self.sizes) / len(self.sizes)
        low, high = _bytes(min(self.sizes)), _bytes(max(self.sizes))
        return (
            f"average: {_bytes(sum(self.sizes[1:]) / span)}/s\n\tmean: {_bytes(mean)} min: {low} "
            f"max: {high} window: {len(self.times)}"
        )


def measure(via: str, topic: str, *, window: int, line: Callable[[Window], str]) -> None:
    """Prints a line about a topic's arrivals each second."""
    seen = Window(window)
    last_line_s = time.monotonic()
    sizes = line is Window.bandwidth_line
    for published in _messages(via, topic, "volery_topic_measure"):
        now = time.monotonic()
        if published is not None:
            seen.add(now, len(published.cdr) if sizes else 0)
        if now - last_line_s >= 1.0:
            last_line_s = now
            echo_lines(seen.take_line(line))


def publish(
    via: str, topic: str, msgtype: str, values: str, *, rate_hz: float, times: int | None
) -> None:
    """Publishes a message typed as YAML, `times` times or until Ctrl-C.

    Prints why a server refuses it; raises `BridgeError` at the end if it has refused any.
    """
    if not (math.isfinite(rate_hz) and rate_hz > 0.0):
        raise BridgeError(f"--rate: expects a positive number, not {rate_hz}")
    name = msgtype if "/msg/" in msgtype else msgtype.replace("/", "/msg/", 1)
    read_message(values, name)  # an error before the connection
    with closing(open_link(via, "volery_topic_pub")) as link:
        link.advertise(topic, name)
        now_ns = partial(_graph_time, link)
        refusals = _Refusals(link)
        make = partial(read_message, values, name, now_ns)
        _repeat(link, topic, make, 1.0 / rate_hz, times, refusals.look)
        refusals.wait()
    if refusals.texts:
        raise BridgeError(f"the server has refused messages to {topic}")


class _Refusals:
    """Why a server has refused messages of a connection, where its protocol says so."""

    def __init__(self, link: GraphConnection) -> None:
        self._link = link
        self.texts: list[str] = []

    def look(self) -> None:
        """Prints new reasons, each once."""
        for text in getattr(self._link, "problems", ()):
            if text not in self.texts:
                self.texts.append(text)
                echo_line(text, err=True)

    def wait(self) -> None:
        """Waits for the reason why the last message is refused, as long as that may take."""
        ends = time.monotonic() + _REFUSAL_WAIT_S
        while hasattr(self._link, "problems") and not self.texts and time.monotonic() < ends:
            time.sleep(_REFUSAL_LOOK_S)
            self.look()


def _graph_time(link: GraphConnection) -> int:
    """Returns the time of the graph's clock, ns; without a clock the wall time."""
    come = threading.Event()
    queue = link.subscribe("/clock", "rosgraph_msgs/msg/Clock", depth=1, wake=come.set)
    try:
        come.wait(_CLOCK_WAIT_S)
        found = queue.take()
    finally:
        link.unsubscribe(queue)
    if not found:
        return time.time_ns()
    clock = found[-1].message.clock
    return int(clock.sec) * 1_000_000_000 + int(clock.nanosec)


def _repeat(
    link: GraphConnection,
    topic: str,
    make: Callable[[], object],
    period_s: float,
    times: int | None,
    look: Callable[[], None],
) -> None:
    sent, due = 0, time.monotonic()
    while times is None or sent < times:
        link.publish(topic, make())
        look()
        sent += 1
        due += period_s
        if times is None or sent < times:
            time.sleep(max(due - time.monotonic(), 0.0))


def _messages(via: str, topic: str, name: str) -> Iterator[Published | None]:
    """Yields the messages of a topic without end, and None at least five times a second."""
    with closing(open_link(via, name)) as link:
        come, check_connection = threading.Event(), ConnectionMonitor(link, via)
        queue = link.subscribe(topic, type_of_topic(link, topic), depth=_DEPTH, wake=come.set)
        while True:
            come.wait(0.2)
            come.clear()
            check_connection()
            yield from queue.take()
            yield None


def _bytes(size: float) -> str:
    for unit in ("B", "kB"):
        if size < 1000.0:
            return f"{size:.3g} {unit}"
        size /= 1000.0
    return f"{size:.3g} MB"
