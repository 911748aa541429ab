"""Provides the contents of the stand-in for `message_filters`.

A filter passes messages on to the callbacks that are registered with it. The names and the order
of calls are those of ROS 2; all happens within the callback of the message that arrives last.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any

from volery.core.errors import GraphError
from volery.graph.nodes.ros_time import Duration, ROSClock, Time

_log = logging.getLogger(__name__)


class SimpleFilter:
    """Base class: calls each registered callback with the filter's output."""

    def __init__(self) -> None:
        self.callbacks: dict[int, tuple[Callable[..., Any], tuple[Any, ...]]] = {}

    def registerCallback(self, cb: Callable[..., Any], *args: Any) -> int:  # noqa: N802
        """Calls `cb(*messages, *args)` for each output; returns the number of the connection."""
        connection = len(self.callbacks)
        self.callbacks[connection] = (cb, args)
        return connection

    def signalMessage(self, *msg: Any) -> None:  # noqa: N802
        """Passes messages on."""
        for callback, arguments in list(self.callbacks.values()):
            callback(*msg, *arguments)


class Subscriber(SimpleFilter):
    """The messages of a topic; takes the arguments of `create_subscription` after the node."""

    def __init__(
        self, node: Any, msg_type: type[Any], topic: str, qos_profile: Any = 10, **options: Any
    ) -> None:
        super().__init__()
        self.node = node
        self.topic = topic
        self.sub = node.create_subscription(
            msg_type, topic, self.callback, qos_profile=qos_profile, **options
        )

    def callback(self, msg: Any) -> None:
        """Passes a message on."""
        self.signalMessage(msg)

    def getTopic(self) -> str:  # noqa: N802
        """Returns the name as given."""
        return self.topic

    def unsubscribe(self) -> None:
        """Stops receiving."""
        self.sub.destroy()


class Cache(SimpleFilter):
    """The `cache_size` messages that arrived last, by the times of their headers.

    allow_headerless: keeps messages without a header by the time of their arrival; else they are
    ignored with a warning.
    """

    def __init__(
        self, f: SimpleFilter | None = None, cache_size: int = 1, allow_headerless: bool = False
    ) -> None:
        super().__init__()
        self.cache_size = cache_size
        self.allow_headerless = allow_headerless
        self.cache_msgs: list[Any] = []
        self.cache_times: list[Time] = []
        self._input: SimpleFilter | None = None
        if f is not None:
            self.connectInput(f)

    def connectInput(self, f: SimpleFilter) -> None:  # noqa: N802
        """Keeps the output of a filter."""
        self._input = f
        self.incoming_connection = f.registerCallback(self.add)

    def add(self, msg: Any) -> None:
        """Keeps a message and passes it on."""
        stamp = _time_of(msg, self._input, allow_headerless=self.allow_headerless)
        if stamp is None:
            return
        self.cache_msgs.append(msg)
        self.cache_times.append(stamp)
        while len(self.cache_msgs) > self.cache_size:
            del self.cache_msgs[0], self.cache_times[0]
        self.signalMessage(msg)

    def getInterval(self, from_stamp: Time, to_stamp: Time) -> list[Any]:  # noqa: N802
        """Returns the messages between two times, both included.

        Raises `ValueError` if the second is earlier.
        """
        if from_stamp > to_stamp:
            raise ValueError("the interval ends before it begins")
        return [msg for msg, time in self._kept() if from_stamp <= time <= to_stamp]

    def getElemAfterTime(self, stamp: Time) -> Any:  # noqa: N802
        """Returns the message that arrived first of those at or after a time; None without one."""
        return next((msg for msg, time in self._kept() if time >= stamp), None)

    def getElemBeforeTime(self, stamp: Time) -> Any:  # noqa: N802
        """Returns the message that arrived last of those at or before a time; None without one."""
        return next((msg for msg, time in reversed(list(self._kept())) if time <= stamp), None)

    def getLatestTime(self) -> Time | None:  # noqa: N802
        """Returns the time of the newest message; None without one."""
        return self.cache_times[-1] if self.cache_times else None

    getLastestTime = getLatestTime  # noqa: N815  # as it is written in ROS 2

    def getOldestTime(self) -> Time | None:  # noqa: N802
        """Returns the time of the oldest message; None without one."""
        return self.cache_times[0] if self.cache_times else None

    def getLast(self) -> Any:  # noqa: N802
        """Returns the newest message; None without one."""
        return self.cache_msgs[-1] if self.cache_msgs else None

    def _kept(self) -> Iterator[tuple[Any, Time]]:
        return zip(self.cache_msgs, self.cache_times, strict=True)


class TimeSynchronizer(SimpleFilter):
    """Passes on sets of messages, one of each filter, with equal stamps.

    queue_size: number of messages of each filter that wait for the others.
    """

    def __init__(self, fs: Sequence[SimpleFilter], queue_size: int = 10) -> None:
        super().__init__()
        self.queue_size = queue_size
        self.connectInput(fs)

    def connectInput(self, fs: Sequence[SimpleFilter]) -> None:  # noqa: N802
        """Takes the outputs of these filters, in place of the former ones."""
        self._inputs = list(fs)
        self.queues: list[dict[int, Any]] = [{} for _ in fs]
        self.input_connections = [
            f.registerCallback(self.add, queue, k)
            for k, (f, queue) in enumerate(zip(fs, self.queues, strict=True))
        ]

    def add(self, msg: Any, my_queue: dict[int, Any], my_queue_index: int | None = None) -> None:  # noqa: ARG002
        """Takes a message of one filter."""
        if not _has_stamp(msg):
            raise GraphError(
                f"{type(msg).__name__} has no header, by whose stamp it would be sorted"
            )
        self._keep(my_queue, Time.from_msg(msg.header.stamp).nanoseconds, msg)
        for time_ns in sorted(set.intersection(*map(set, self.queues))):
            self._pass_on([time_ns] * len(self.queues))

    def _keep(self, queue: dict[int, Any], time_ns: int, msg: Any) -> None:
        queue[time_ns] = msg
        while len(queue) > self.queue_size:
            del queue[min(queue)]

    def _pass_on(self, times_ns: Sequence[int]) -> None:
        pairs = zip(self.queues, times_ns, strict=True)
        self.signalMessage(*[queue.pop(time_ns) for queue, time_ns in pairs])


class ApproximateTimeSynchronizer(TimeSynchronizer):
    """Passes on sets of messages whose times differ by less than `slop` s.

    allow_headerless: takes messages without a header by the time of their arrival; else they are
    ignored with a warning. sync_arrival_time: takes all messages by the time of their arrival.
    """

    def __init__(
        self,
        fs: Sequence[SimpleFilter],
        queue_size: int,
        slop: float,
        allow_headerless: bool = False,
        sync_arrival_time: bool = False,
    ) -> None:
        self.slop = Duration(seconds=slop)
        self.allow_headerless = allow_headerless
        self.sync_arrival_time = sync_arrival_time
        super().__init__(fs, queue_size)

    def add(self, msg: Any, my_queue: dict[int, Any], my_queue_index: int | None = None) -> None:
        """Takes a message of one filter."""
        source = None if my_queue_index is None else self._inputs[my_queue_index]
        if self.sync_arrival_time:
            stamp: Time | None = _arrival(source)
        else:
            stamp = _time_of(msg, source, allow_headerless=self.allow_headerless)
        if stamp is None:
            return
        now_ns, slop_ns = stamp.nanoseconds, self.slop.nanoseconds
        self._keep(my_queue, now_ns, msg)
        near = [
            [now_ns]
            if k == my_queue_index
            else sorted(
                (t for t in queue if abs(t - now_ns) <= slop_ns), key=lambda t: abs(t - now_ns)
            )
            for k, queue in enumerate(self.queues)
        ]
        for times_ns in product(*near):
            is_kept = all(t in queue for t, queue in zip(times_ns, self.queues, strict=True))
            if is_kept and max(times_ns) - min(times_ns) < slop_ns:
                self._pass_on(times_ns)
                return


def _has_stamp(msg: Any) -> bool:
    return hasattr(getattr(msg, "header", None), "stamp")


def _time_of(msg: Any, source: SimpleFilter | None, *, allow_headerless: bool) -> Time | None:
    """Returns the time of a header, else that of the arrival; None if that is not allowed."""
    if _has_stamp(msg):
        stamp = msg.header.stamp
        return stamp if isinstance(stamp, Time) else Time.from_msg(stamp)
    if allow_headerless:
        return _arrival(source)
    text = (
        f"message_filters ignore {type(msg).__name__}, which has no header: allow_headerless=True "
        "takes it by the time of its arrival"
    )
    node = getattr(source, "node", None)
    if node is None:
        _log.warning(text)
    else:
        node.get_logger().warning(text, once=True)
    return None


def _arrival(source: SimpleFilter | None) -> Time:
    """Returns the time of the node that subscribes; wall time for other filters."""
    node = getattr(source, "node", None)
    now: Time = ROSClock().now() if node is None else node.get_clock().now()
    return now


def contents() -> dict[str, dict[str, Any]]:
    """Returns the names and values of each module."""
    filters = (SimpleFilter, Subscriber, Cache, TimeSynchronizer, ApproximateTimeSynchronizer)
    return {"message_filters": {each.__name__: each for each in filters}}
