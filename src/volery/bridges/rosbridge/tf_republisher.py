"""Offers `/republish_tfs`, with which the TF clients of roslib and roslibpy follow frames.

Fields and behaviour are those of tf2_web_republisher (RobotWebTools): each request creates a topic
with the poses of some frames in another one, published whenever they have changed enough. The work
runs in its own thread, in wall time.
"""

from __future__ import annotations

import itertools
import math
import threading
import time
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from volery.bridges.rosbridge.frames import Frames, KnownFrames
from volery.core.errors import GraphError
from volery.graph.messages import TFMessage, message_type
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Gateway, Session
from volery.graph.subscription_queue import SubscriptionQueue

SERVICE = "/republish_tfs"
_SRVTYPE = "tf2_web_republisher/srv/RepublishTFs"
_ARRAY = "tf2_web_republisher/msg/TFArray"
_TF = "tf2_msgs/msg/TFMessage"
_MAX_FRAMES = 500
"""Frames that are followed for all clients together."""
_MAX_HZ, _USUAL_HZ = 30.0, 10.0
_USUAL_TIMEOUT_S = 10.0
_LONGEST_TIMEOUT_S = 600.0
_DEPTH = 1000


class _Wish(NamedTuple):
    """A client's request; equal requests share a topic."""

    sources: tuple[str, ...]
    target: str
    angle_rad: float
    distance_m: float
    rate_hz: float


@dataclass
class _Topic:
    """Topic of a request."""

    name: str
    timeout_s: float
    unused_since_s: float
    due_s: float = 0.0
    subscribers: int = 0
    sent: dict[str, KnownFrames] = field(default_factory=dict)


class TfRepublisher:
    """The service, after `start`; its session and thread begin with the first request."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._is_offered = False
        self._session: Session | None = None
        self._frames = Frames()
        self._topics: dict[_Wish, _Topic] = {}
        self._numbers = itertools.count(1)
        self._queues: list[SubscriptionQueue] = []
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()
        self._ended = threading.Event()

    def start(self) -> None:
        """Creates the service unless it exists already."""
        if not self._gateway.graph.has_service(SERVICE):
            self._gateway.graph.create_async_service(SERVICE, _SRVTYPE, self._ask)
            self._is_offered = True

    def stop(self) -> None:
        """Destroys the service and its topics."""
        if self._is_offered:
            self._gateway.graph.destroy_service(SERVICE)
        self._ended.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self._session is not None:
            self._session.close()
            self._session = None

    def _ask(self, request: Any, reply: ServiceReply) -> None:
        try:
            name = self._follow(_wish_of(request), _timeout_of(request))
            reply.answer(message_type(f"{_SRVTYPE}_Response")(name))
        except GraphError as error:
            reply.fail(error)

    def _follow(self, wish: _Wish, timeout_s: float) -> str:
        """Returns the topic of a request. Raises `GraphError` if there are too many."""
        if self._ended.is_set():
            raise GraphError(f"{SERVICE} has ended")
        with self._lock:
            if self._session is None:
                self._session = self._gateway.open("tf2_web_republisher", inside=True)
            session = self._session
            topic = self._topics.get(wish)
            now_s = time.monotonic()
            if topic is None:
                followed = sum(len(known.sources) for known in self._topics)
                if followed + len(wish.sources) > _MAX_FRAMES:
                    raise GraphError(
                        f"{SERVICE}: {followed} frames are followed already, {_MAX_FRAMES} at "
                        "most; unsubscribe from topics that are not needed"
                    )
                topic = _Topic(f"/tf_repub_{next(self._numbers)}", timeout_s, now_s)
                session.advertise(topic.name, _ARRAY)
                self._topics[wish] = topic
            topic.unused_since_s = now_s
            if self._thread is None:
                for source in ("/tf_static", "/tf"):
                    box = session.subscribe(source, _TF, depth=_DEPTH, wake=lambda: None)
                    self._queues.append(box)
                self._thread = threading.Thread(
                    target=self._work, name="volery-tf-republisher", daemon=True
                )
                self._thread.start()
        return topic.name

    def _work(self) -> None:
        while not self._ended.wait(1.0 / _MAX_HZ):
            for queue in self._queues:
                for published in queue.take(_DEPTH):
                    message: TFMessage = published.message
                    self._frames.learn(message.transforms)
            with self._lock:
                topics = tuple(self._topics.items())
            now_s = time.monotonic()
            for wish, topic in topics:
                self._serve(wish, topic, now_s)

    def _serve(self, wish: _Wish, topic: _Topic, now_s: float) -> None:
        """Publishes the changed frames, if due; ends a topic without subscribers."""
        assert self._session is not None
        before, topic.subscribers = (
            topic.subscribers,
            self._gateway.graph.subscribers(topic.name),
        )
        if not topic.subscribers:
            topic.sent.clear()
            if before:
                topic.unused_since_s = now_s
            with self._lock:
                is_over = now_s > topic.unused_since_s + topic.timeout_s
                if is_over:
                    del self._topics[wish]
            if is_over:
                self._session.unadvertise(topic.name)
            return
        if topic.subscribers > before:
            topic.sent.clear()  # new subscribers need all frames
        if now_s < topic.due_s:
            return
        topic.due_s = now_s + 1.0 / wish.rate_hz
        changed = []
        for source in wish.sources:
            pose = self._frames.pose(source, wish.target)
            old = topic.sent.get(source)
            if pose is None or (
                old is not None and not pose.differs(old, wish.angle_rad, wish.distance_m)
            ):
                continue
            topic.sent[source] = pose
            changed.append(pose.message(wish.target, source))
        if changed:
            self._session.publish(topic.name, message_type(_ARRAY)(changed))


def _wish_of(request: Any) -> _Wish:
    rate_hz = float(request.rate)
    sources = tuple(dict.fromkeys(name.lstrip("/") for name in request.source_frames))
    return _Wish(
        sources,
        request.target_frame.lstrip("/"),
        max(float(request.angular_thres), 0.0),
        max(float(request.trans_thres), 0.0),
        min(rate_hz, _MAX_HZ) if math.isfinite(rate_hz) and rate_hz > 0.1 else _USUAL_HZ,
    )


def _timeout_of(request: Any) -> float:
    asked_s = request.timeout.sec + request.timeout.nanosec * 1e-9
    return min(asked_s, _LONGEST_TIMEOUT_S) if asked_s > 0.0 else _USUAL_TIMEOUT_S
