"""Provides the contents of the stand-ins for `tf2_ros` and `tf2_py`.

Transforms are `T_parent_child`; quaternions are x y z w. A buffer keeps each frame's transforms of
10 s. No lookup waits: in a callback the simulated time stands still.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from volery.core import rotations
from volery.core.arrays import Array
from volery.graph.messages import (
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    frame_name,
    header,
    stamp_of,
)
from volery.graph.nodes.service_client import Future
from volery.graph.nodes.transformed_messages import BY_TYPE
from volery.graph.qos import DurabilityPolicy, QoSProfile

CACHE_NS = 10_000_000_000
"""Age of the oldest transform that is kept, as in tf2."""
_DEPTH = 100


class TransformException(Exception):  # noqa: N818  # tf2's names
    """Base class: a transform is not available."""


class LookupException(TransformException):
    """A frame is not known."""


class ConnectivityException(TransformException):
    """Two frames are not connected."""


class ExtrapolationException(TransformException):
    """The time is before the first transform or after the last one."""


class InvalidArgumentException(TransformException):
    """An argument is invalid."""


class TypeException(Exception):  # noqa: N818
    """A message of this type cannot be transformed."""


class TimeoutException(TransformException):
    """Never raised: no lookup waits."""


class _Placement(NamedTuple):
    """A frame in its parent at one time."""

    time_ns: int
    position: Array
    attitude: Array

    def then(self, inner: _Placement) -> _Placement:
        """Returns `T_a_c` of this `T_a_b` and `T_b_c`."""
        moved = rotations.rotate(self.attitude, inner.position)
        turned = rotations.multiply(self.attitude, inner.attitude)
        return _Placement(inner.time_ns, self.position + moved, turned)

    def inverse(self) -> _Placement:
        """Returns `T_b_a` of this `T_a_b`."""
        back = rotations.conjugate(self.attitude)
        return _Placement(self.time_ns, -rotations.rotate(back, self.position), back)


class _Frame:
    """The placements of one frame, the oldest first."""

    def __init__(self, parent: str, is_static: bool) -> None:
        self.parent = parent
        self.is_static = is_static
        self.placements: deque[_Placement] = deque()

    def add(self, placement: _Placement) -> None:
        """Stores a placement; older ones than the newest are inserted by time."""
        kept = self.placements
        if self.is_static or not kept:
            kept.clear()
            kept.append(placement)
            return
        times = [known.time_ns for known in kept]
        index = bisect_left(times, placement.time_ns)
        if index < len(kept) and times[index] == placement.time_ns:
            kept[index] = placement
        else:
            kept.insert(index, placement)
        while kept[0].time_ns < kept[-1].time_ns - CACHE_NS:
            kept.popleft()

    def at(self, time_ns: int, name: str) -> _Placement:
        """Returns the placement at a time, interpolated. Raises `ExtrapolationException`."""
        kept = self.placements
        if self.is_static:
            return kept[0]
        first_ns, last_ns = kept[0].time_ns, kept[-1].time_ns
        if not first_ns <= time_ns <= last_ns:
            raise ExtrapolationException(
                f"'{name}' at {time_ns / 1e9:.3f} s: known from {first_ns / 1e9:.3f} to "
                f"{last_ns / 1e9:.3f} s"
            )
        index = bisect_left([known.time_ns for known in kept], time_ns)
        after = kept[index]
        if after.time_ns == time_ns:
            return after
        before = kept[index - 1]
        fraction = (time_ns - before.time_ns) / (after.time_ns - before.time_ns)
        turn = rotations.multiply(rotations.conjugate(before.attitude), after.attitude)
        part = rotations.exponential(fraction * rotations.logarithm(turn))
        position = before.position + fraction * (after.position - before.position)
        return _Placement(time_ns, position, rotations.multiply(before.attitude, part))


class Buffer:
    """`tf2_ros.Buffer`: transforms of a node, by frame and time."""

    def __init__(self, *_arguments: Any, **_options: Any) -> None:
        self._frames: dict[str, _Frame] = {}
        self.call_soon: Callable[[Callable[[], Any]], None] = _call
        """Calls a function after the present callback; a listener sets it."""
        self._waiting: list[tuple[Future, str, str, Any]] = []
        """Futures, with the target and source frame and the time of which each is."""

    def set_transform(self, transform: Any, authority: str = "") -> None:  # noqa: ARG002
        """Stores a TransformStamped."""
        self._set(transform, is_static=False)

    def set_transform_static(self, transform: Any, authority: str = "") -> None:  # noqa: ARG002
        """Stores a TransformStamped that holds at any time."""
        self._set(transform, is_static=True)

    def lookup_transform(
        self,
        target_frame: str,
        source_frame: str,
        time: Any = None,
        timeout: Any = None,  # noqa: ARG002
    ) -> Any:
        """Returns the pose of `source_frame` in `target_frame`, a TransformStamped.

        time: None or zero is the newest time at which the transform is known. Raises
        `TransformException`.
        """
        target, source = frame_name(target_frame), frame_name(source_frame)
        for name in (target, source):
            if name not in self._frames and not any(
                frame.parent == name for frame in self._frames.values()
            ):
                raise LookupException(f"there is no frame '{name}'{self._hint()}")
        ups, downs = self._chain(source), self._chain(target)
        common = next((name for name in ups if name in downs), None)
        if common is None:
            raise ConnectivityException(f"'{target}' and '{source}' are not connected")
        below, above = ups[: ups.index(common)], downs[: downs.index(common)]
        time_ns = _ns_of(time) or self._newest([*below, *above])
        found = self._pose(above, time_ns).inverse().then(self._pose(below, time_ns))
        x, y, z = found.position.tolist()
        return TransformStamped(
            header(time_ns, target),
            source,
            Transform(Vector3(x, y, z), Quaternion(*found.attitude.tolist())),
        )

    def can_transform(
        self, target_frame: str, source_frame: str, time: Any = None, timeout: Any = None
    ) -> bool:
        """Returns whether `lookup_transform` would succeed."""
        try:
            self.lookup_transform(target_frame, source_frame, time, timeout)
        except TransformException:
            return False
        return True

    def wait_for_transform_async(self, target_frame: str, source_frame: str, time: Any) -> Future:
        """Returns a future that is done, with true, when `lookup_transform` would succeed.

        With a listener never before the callback that asks ends, which may hold a lock.
        """
        future = Future()
        if self.can_transform(target_frame, source_frame, time):
            self.call_soon(lambda: future.set_result(True))
        else:
            self._waiting.append((future, target_frame, source_frame, time))
        return future

    async def lookup_transform_async(
        self, target_frame: str, source_frame: str, time: Any = None
    ) -> Any:
        """Returns what `lookup_transform` does, when the transform is there."""
        await self.wait_for_transform_async(target_frame, source_frame, time)
        return self.lookup_transform(target_frame, source_frame, time)

    def transform(self, stamped: Any, target_frame: str, timeout: Any = None) -> Any:
        """Returns a stamped message in another frame.

        Raises `TransformException`, `TypeException` for a message that is not in
        `transformed_messages.BY_TYPE`.
        """
        move = BY_TYPE.get(getattr(stamped, "__msgtype__", ""))
        if move is None:
            known = ", ".join(name.rpartition("/")[2] for name in BY_TYPE)
            raise TypeException(f"{type(stamped).__name__} cannot be transformed, but {known}")
        found = self.lookup_transform(
            target_frame, stamped.header.frame_id, stamped.header.stamp, timeout
        )
        return move(stamped, found)

    def clear(self) -> None:
        """Forgets all transforms."""
        self._frames.clear()

    def all_frames_as_yaml(self, time: float = 0.0) -> str:  # noqa: ARG002  # as in tf2
        """Returns each frame with its parent and the times of its transforms, s, as YAML."""
        lines = []
        for name, frame in self._frames.items():
            first, last = (frame.placements[k].time_ns / 1e9 for k in (0, -1))
            rate = (len(frame.placements) - 1) / (last - first) if last > first else 10_000.0
            lines.append(
                f"{name}:\n"
                f"  parent: '{frame.parent}'\n"
                "  broadcaster: 'default_authority'\n"
                f"  rate: {rate:.3f}\n"
                f"  most_recent_transform: {last:.6f}\n"
                f"  oldest_transform: {first:.6f}\n"
                f"  buffer_length: {last - first:.3f}\n"
            )
        return "".join(lines) or "{}"

    def all_frames_as_string(self) -> str:
        """Returns each frame with its parent."""
        lines = [f"Frame {name} exists with parent {f.parent}." for name, f in self._frames.items()]
        return "\n".join(lines)

    def _set(self, transform: Any, *, is_static: bool) -> None:
        child, parent = frame_name(transform.child_frame_id), frame_name(transform.header.frame_id)
        p, q = transform.transform.translation, transform.transform.rotation
        attitude = np.array([q.x, q.y, q.z, q.w], dtype=np.float64)
        length = float(np.linalg.norm(attitude))
        position = np.array([p.x, p.y, p.z], dtype=np.float64)
        if not child or child == parent or not np.isfinite(position).all() or not 0 < length < 1e9:
            return  # as tf2, which logs an error
        frame = self._frames.get(child)
        if frame is None or (frame.parent, frame.is_static) != (parent, is_static):
            frame = self._frames[child] = _Frame(parent, is_static)
        frame.add(_Placement(stamp_of(transform), position, attitude / length))
        if self._waiting:
            self._complete_waiting()

    def _complete_waiting(self) -> None:
        """Completes the futures whose transform is there now."""
        ready = [wait for wait in self._waiting if self.can_transform(*wait[1:])]
        self._waiting = [wait for wait in self._waiting if wait not in ready]
        for future, *_ in ready:
            future.set_result(True)

    def _hint(self) -> str:
        """Returns why frames may be missing: nothing moves as yet."""
        if not all(frame.is_static for frame in self._frames.values()):
            return ""
        return ": nothing has arrived on /tf as yet"

    def _chain(self, name: str) -> list[str]:
        """Returns a frame and its ancestors."""
        chain = [name]
        while (frame := self._frames.get(chain[-1])) is not None and frame.parent not in chain:
            chain.append(frame.parent)
        return chain

    def _newest(self, names: list[str]) -> int:
        frames = [self._frames[name] for name in names]
        return min((f.placements[-1].time_ns for f in frames if not f.is_static), default=0)

    def _pose(self, names: list[str], time_ns: int) -> _Placement:
        """Returns the pose of the first frame in the parent of the last one."""
        found = _Placement(time_ns, np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
        for name in reversed(names):
            found = found.then(self._frames[name].at(time_ns, name))
        return found


class TransformListener:
    """`tf2_ros.TransformListener`: fills a buffer from `/tf` and `/tf_static`."""

    def __init__(self, buffer: Buffer, node: Any, **_options: Any) -> None:
        self.buffer = buffer
        buffer.call_soon = node._call_soon
        static = QoSProfile(depth=_DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._subscriptions = (
            node.create_subscription(TFMessage, "/tf", self._on_tf, _DEPTH),
            node.create_subscription(TFMessage, "/tf_static", self._on_static, static),
        )

    def unregister(self) -> None:
        """Stops listening."""
        for subscription in self._subscriptions:
            subscription.destroy()

    def _on_tf(self, message: Any) -> None:
        for transform in message.transforms:
            self.buffer.set_transform(transform)

    def _on_static(self, message: Any) -> None:
        for transform in message.transforms:
            self.buffer.set_transform_static(transform)


class TransformBroadcaster:
    """`tf2_ros.TransformBroadcaster`: publishes on `/tf`."""

    def __init__(self, node: Any, qos: Any = _DEPTH, **_options: Any) -> None:
        self.node = node
        self._publisher = node.create_publisher(TFMessage, "/tf", qos)

    def sendTransform(self, transform: Any) -> None:  # noqa: N802  # tf2's name
        """Publishes one TransformStamped or a list of them."""
        given = transform if isinstance(transform, list | tuple) else [transform]
        self._publisher.publish(TFMessage(list(given)))


class StaticTransformBroadcaster:
    """`tf2_ros.StaticTransformBroadcaster`: publishes on `/tf_static`, latched."""

    def __init__(self, node: Any, **_options: Any) -> None:
        self._publisher = node.create_publisher(TFMessage, "/tf_static", 1, latched=True)
        self._sent: dict[str, Any] = {}

    def sendTransform(self, transform: Any) -> None:  # noqa: N802
        """Publishes all transforms so far, and these."""
        given = transform if isinstance(transform, list | tuple) else [transform]
        self._sent |= {found.child_frame_id: found for found in given}
        self._publisher.publish(TFMessage(list(self._sent.values())))


def _call(action: Callable[[], Any]) -> None:
    action()


def _ns_of(time: Any) -> int:
    if time is None:
        return 0
    if hasattr(time, "nanoseconds"):
        return int(time.nanoseconds)
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def contents() -> dict[str, dict[str, Any]]:
    """Returns the names and values of each module."""
    errors = {
        error.__name__: error
        for error in (
            TransformException,
            LookupException,
            ConnectivityException,
            ExtrapolationException,
            InvalidArgumentException,
            TimeoutException,
            TypeException,
        )
    }
    parts: dict[str, dict[str, Any]] = {
        "buffer": {"Buffer": Buffer},
        "transform_listener": {"TransformListener": TransformListener},
        "transform_broadcaster": {"TransformBroadcaster": TransformBroadcaster},
        "static_transform_broadcaster": {"StaticTransformBroadcaster": StaticTransformBroadcaster},
    }
    joined = {name: value for part in parts.values() for name, value in part.items()}
    return {
        "tf2_ros": {**joined, **errors, "BufferInterface": Buffer},
        **{f"tf2_ros.{name}": {**part, **errors} for name, part in parts.items()},
        "tf2_ros.buffer_interface": {"BufferInterface": Buffer, **errors},
        "tf2_py": errors,
    }
