"""Publishers, subscriptions and services over zenoh, compatible with rmw_zenoh."""

from __future__ import annotations

import itertools
import os
import threading
import time
from collections.abc import Callable
from typing import Any

import zenoh
import zenoh.ext

from volery.bridges.ros2.middleware import ServiceSpec, TakeMessage, TakeRequest, TopicSpec
from volery.bridges.ros2.zenoh.names import (
    CLIENT,
    GID_BYTES,
    PUBLISHER,
    SERVER,
    SUBSCRIPTION,
    Attachment,
    service_key,
    service_token,
    topic_key,
    topic_token,
)

_LONGEST_CALL_S = 3600.0
"""Timeout of calls; results of actions take their time."""


class ZenohContext:
    """Context of endpoints."""

    def __init__(self, session: Any, domain_id: int, ids: Callable[[Any], tuple[int, int]]) -> None:
        self.session = session
        self.domain_id = domain_id
        self.zid = str(session.zid())
        self.ids = ids
        """(node) -> number of the node and a new one for an endpoint of it."""

    def declare(self, token: str) -> Any:
        """Declares a liveliness token."""
        return self.session.liveliness().declare_token(token)


class ZenohWriter:
    """A publisher; latched messages are in a cache that late subscribers query."""

    def __init__(self, context: ZenohContext, spec: TopicSpec) -> None:
        key = topic_key(context.domain_id, spec.topic, spec.msgtype)
        profile = spec.profile
        reliability = (
            zenoh.Reliability.RELIABLE if profile.reliable else zenoh.Reliability.BEST_EFFORT
        )
        how = {
            "reliability": reliability,
            "congestion_control": zenoh.CongestionControl.DROP,  # no subscriber can block it
        }
        self._latched = profile.latched
        if profile.latched:
            self._publisher = zenoh.ext.declare_advanced_publisher(
                context.session,
                key,
                cache=zenoh.ext.CacheConfig(profile.depth),
                publisher_detection=True,
                **how,
            )
        else:
            self._publisher = context.session.declare_publisher(key, **how)
        self._gid = os.urandom(GID_BYTES)
        self._numbers = itertools.count(1)
        ids = context.ids(spec.node)
        self._token = context.declare(
            topic_token(context.domain_id, context.zid, ids, PUBLISHER, spec)
        )

    @property
    def matched(self) -> bool:
        """Whether the topic has subscribers; True for latched topics, which late ones query."""
        return self._latched or bool(self._publisher.matching_status.matching)

    def write(self, cdr: bytes) -> None:
        """Sends one message."""
        attachment = Attachment(next(self._numbers), time.time_ns(), self._gid)
        self._publisher.put(cdr, attachment=attachment.encode())

    def close(self) -> None:
        """Ends the publication."""
        _undeclare(self._token, self._publisher)


class ZenohReader:
    """A subscription."""

    def __init__(self, context: ZenohContext, spec: TopicSpec, take: TakeMessage) -> None:
        key = topic_key(context.domain_id, spec.topic, spec.msgtype)

        def receive(sample: Any) -> None:
            take(sample.payload.to_bytes())

        history = None
        if spec.profile.latched:
            history = zenoh.ext.HistoryConfig(
                detect_late_publishers=True, max_samples=spec.profile.depth
            )
        self._subscriber = zenoh.ext.declare_advanced_subscriber(
            context.session, key, receive, allowed_origin=zenoh.Locality.REMOTE, history=history
        )
        ids = context.ids(spec.node)
        self._token = context.declare(
            topic_token(context.domain_id, context.zid, ids, SUBSCRIPTION, spec)
        )

    def close(self) -> None:
        """Ends the subscription."""
        _undeclare(self._token, self._subscriber)


class ZenohServer:
    """A service server."""

    def __init__(self, context: ZenohContext, spec: ServiceSpec, take: TakeRequest) -> None:
        self._key = service_key(context.domain_id, spec.service, spec.srvtype)
        self._take = take
        self._queryable = context.session.declare_queryable(
            self._key, self._on_query, complete=True
        )
        ids = context.ids(spec.node)
        self._token = context.declare(
            service_token(context.domain_id, context.zid, ids, SERVER, spec)
        )

    def close(self) -> None:
        """Destroys the service."""
        _undeclare(self._token, self._queryable)

    def _on_query(self, query: Any) -> None:
        asked = query.attachment
        attachment = None if asked is None else Attachment.decode(asked.to_bytes())
        if attachment is None or query.payload is None:
            query.drop()  # not a ROS 2 client: it must not wait
            return

        def answer(cdr: bytes) -> None:
            back = attachment._replace(time_ns=time.time_ns())
            query.reply(self._key, cdr, attachment=back.encode())
            query.drop()

        self._take(query.payload.to_bytes(), answer)


class ZenohCaller:
    """A client of a service."""

    def __init__(
        self, context: ZenohContext, spec: ServiceSpec, is_there: Callable[[ServiceSpec], bool]
    ) -> None:
        self._context = context
        self._spec = spec
        self._is_there = is_there
        self._key = service_key(context.domain_id, spec.service, spec.srvtype)
        self._gid = os.urandom(GID_BYTES)
        self._numbers = itertools.count(1)
        self._waiting: set[_Query] = set()
        self._lock = threading.Lock()
        ids = context.ids(spec.node)
        self._token = context.declare(
            service_token(context.domain_id, context.zid, ids, CLIENT, spec)
        )

    @property
    def ready(self) -> bool:
        """Whether the service has a server."""
        return self._is_there(self._spec)

    @property
    def problem(self) -> str:
        """Empty, because all servers are supported."""
        return ""

    def call(self, request: bytes, on_response: TakeMessage, on_loss: Callable[[], None]) -> None:
        """Sends a request."""
        query = _Query(on_response, on_loss)
        with self._lock:
            self._waiting.add(query)

        def receive(reply: Any) -> None:
            with self._lock:
                self._waiting.discard(query)
            if reply.ok is None:
                query.lose()
            else:
                query.answer(reply.ok.payload.to_bytes())

        attachment = Attachment(next(self._numbers), time.time_ns(), self._gid)
        self._context.session.get(
            self._key,
            receive,
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=_LONGEST_CALL_S,
            payload=request,
            attachment=attachment.encode(),
        )

    def give_up(self) -> None:
        """Fails all open requests if there is no server any more."""
        if self._waiting and not self.ready:
            self._lose_all()

    def close(self) -> None:
        """Destroys the client."""
        _undeclare(self._token)
        self._lose_all()

    def _lose_all(self) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, set()
        for query in waiting:
            query.lose()


class _Query:
    """A request without an answer yet; it is answered or lost, once."""

    def __init__(self, on_response: TakeMessage, on_loss: Callable[[], None]) -> None:
        self._on_response = on_response
        self._on_loss = on_loss
        self._lock = threading.Lock()
        self._done = False

    def answer(self, data: bytes) -> None:
        """Delivers the response."""
        if self._finish():
            self._on_response(data)

    def lose(self) -> None:
        """Reports that there will be no response."""
        if self._finish():
            self._on_loss()

    def _finish(self) -> bool:
        with self._lock:
            first, self._done = not self._done, True
        return first


def _undeclare(*declared: Any) -> None:
    """Removes declarations; those of a closed session are gone anyway."""
    for one in declared:
        try:
            one.undeclare()
        except zenoh.ZError:
            continue
