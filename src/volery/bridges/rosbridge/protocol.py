"""The rosbridge v2 protocol for one client: frames in, frames out, no sockets.

    peer = RosbridgePeer(session, shared, wake=wake, post=post)
    peer.receive('{"op": "subscribe", "topic": "/uav1/odom"}')
    for frame in peer.frames(now_s):
        send(frame)

The client receives the errors that it causes as a `status` with the operation's id; no input of a
client raises. All methods belong to one thread; other threads may call `wake` and `post`.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from volery.bridges.rosbridge.access_policy import AccessPolicy, refusal
from volery.bridges.rosbridge.actions import RosbridgeActions
from volery.bridges.rosbridge.cbor_codec import encode_cbor
from volery.bridges.rosbridge.fields import (
    NeedlessOperationError,
    read_choice,
    read_id,
    with_id,
)
from volery.bridges.rosbridge.fragments import MAX_FRAGMENTS, Assembly, split
from volery.bridges.rosbridge.message_budget import (
    MAX_IMAGE_BYTES,
    MAX_MESSAGE_BYTES,
    MAX_TEXT_BYTES,
    MAX_UNAUTHORIZED_BYTES,
)
from volery.bridges.rosbridge.message_encoder import MessageEncoder
from volery.bridges.rosbridge.services import Post, RosbridgeServices
from volery.bridges.rosbridge.topics import RosbridgeTopics
from volery.bridges.rosbridge.wire import (
    Frame,
    Operation,
    decode_frame,
    decode_png,
    encode_json,
    encode_png,
)
from volery.bridges.unfinished import NO_ROOM
from volery.core.errors import BridgeError, VoleryError
from volery.core.network_access import shows_token
from volery.graph.read_budget import ReadScope
from volery.graph.session import Session

LEVELS = ("error", "none", "warning", "info")
"""Words of `set_level`; the first is the default."""
_LOUDNESS = {"none": 0, "error": 1, "warning": 2, "info": 3}

MAX_WAITING_BYTES = 8 * 1024 * 1024
"""Bytes of answers that may wait for a client; beyond, reading from the client pauses."""
MAX_WRAPS = 3
"""Depth of wrapping: an operation may be inside an image in fragments, not deeper."""


@dataclass(frozen=True)
class ServerContext:
    """Shared by all clients of a server."""

    forms: MessageEncoder = field(default_factory=MessageEncoder)
    now_ns: Callable[[], int] = lambda: 0
    """Simulated time."""
    token: str | None = None
    """Token that a client must send first; None: none."""
    max_bytes: int = MAX_MESSAGE_BYTES
    """Largest message, also after assembly from fragments or an image."""


class RosbridgePeer:
    """Serves one client.

    Parameters
    ----------
    session
        The client's session of the graph; closed by `close`.
    shared
        Shared by all clients of the server.
    wake
        Called, from any thread, when `frames` has new frames.
    post
        Calls a function in the thread of this peer.
    authorized
        Whether the client has sent the token already.
    gate
        Restricts the client; None: no restriction.

    """

    def __init__(
        self,
        session: Session,
        shared: ServerContext,
        *,
        wake: Callable[[], None],
        post: Post,
        authorized: bool = False,
        gate: AccessPolicy | None = None,
    ) -> None:
        self.authorized = authorized or shared.token is None
        self.on_authorized: Callable[[], None] = lambda: None
        """Called when the client has sent the token."""
        self.refused: str | None = None
        """Why the connection must end; None while it may continue."""
        self._session = session
        self._shared = shared
        self._gate = gate
        self._wake = wake
        self._level = LEVELS[0]
        self._outbox: deque[tuple[int, Iterator[Frame]]] = deque()
        self._waiting_bytes = 0
        self._assembly = Assembly(
            min(shared.max_bytes, MAX_TEXT_BYTES), lambda: post(self._drop_fragments)
        )
        self._max_image_bytes = min(shared.max_bytes, MAX_IMAGE_BYTES)
        self._numbers = itertools.count()
        self._closed = False
        self._now_s = 0.0
        self._topics = RosbridgeTopics(session, wake, shared.now_ns, self._complain)
        session.on_refused = lambda text: post(lambda: self._complain(text))
        guarded = self._poster(post)
        self._services = RosbridgeServices(session, shared.forms, self.send, guarded)
        self._actions = RosbridgeActions(session, shared.forms, self.send, guarded)
        self._handlers: dict[str, Callable[[Operation], None]] = {
            "advertise": self._topics.advertise,
            "unadvertise": self._topics.unadvertise,
            "publish": self._topics.publish,
            "subscribe": self._topics.subscribe,
            "unsubscribe": self._topics.unsubscribe,
            "call_service": lambda operation: self._services.call(operation, self._now_s),
            "service_response": self._services.respond,
            "advertise_service": self._services.advertise,
            "unadvertise_service": self._services.unadvertise,
            "send_action_goal": self._actions.send_goal,
            "cancel_action_goal": self._actions.cancel_goal,
            "advertise_action": self._actions.advertise,
            "unadvertise_action": self._actions.unadvertise,
            "action_feedback": self._actions.take_feedback,
            "action_result": self._actions.take_result,
            "set_level": self._set_level,
            "status": lambda _: None,
            "auth": self._authorize,
        }

    # ---------------------------------------------------------------------------------------- in

    @property
    def reading(self) -> ReadScope:
        """Account of reading from the client, which limits its rate."""
        return self._session.reading

    @property
    def writing(self) -> ReadScope:
        """Account of writing to the client."""
        return self._session.writing

    def receive(self, frame: Frame, now_s: float) -> None:
        """Handles a frame from the client. now_s: of a monotonic clock."""
        if self._closed or self.refused:
            return
        self._now_s = now_s
        if not self.authorized and len(frame) > MAX_UNAUTHORIZED_BYTES:
            self.refused = f"not authorized: more than {MAX_UNAUTHORIZED_BYTES} bytes"
            return
        if len(frame) > self._shared.max_bytes:
            self._status("error", f"a message of more than {self._shared.max_bytes} bytes", {})
            return
        operation: Operation = {}
        try:
            operation = decode_frame(frame, limited=True)
            self._handle(operation, now_s, 0)
        except VoleryError as error:
            self._status(_level_of(error), str(error), operation)
        except Exception as error:
            # An error of ours in serving one client must not end the service of others.
            self._status("error", f"internal error: {type(error).__name__}: {error}", operation)

    def _handle(self, operation: Operation, now_s: float, depth: int) -> None:
        op = operation["op"]
        if depth > MAX_WRAPS:
            raise BridgeError("an operation is wrapped too often")
        if not self.authorized and op != "auth":
            self.refused = "not authorized: send {'op': 'auth', 'token': ...} first"
            raise BridgeError(self.refused)
        if op == "fragment":
            whole = self._assembly.add(operation, now_s)
            if whole is not None:
                self._handle_inner(decode_frame(whole, limited=True), now_s, depth)
        elif op == "png":
            image_text = decode_png(operation, self._max_image_bytes, limited=True)
            self._handle_inner(image_text, now_s, depth)
        else:
            handler = self._handlers.get(op)
            if handler is None:
                known = ", ".join(sorted((*self._handlers, "fragment", "png")))
                raise BridgeError(f"unknown operation '{op[:40]}'; there are {known}")
            if not self._passes(operation):
                return
            handler(operation)
            if self._level == "info":
                self._status("info", f"{op}: done", operation)

    def _passes(self, operation: Operation) -> bool:
        """Returns whether the client may execute an operation; answers refused requests."""
        if self._gate is None:
            return True
        try:
            return self._gate.check(operation)
        except BridgeError as error:
            answer = refusal(operation, str(error))
            if answer is None:
                raise
            self.send(answer, None, "none")
            return False

    def _handle_inner(self, operation: Operation, now_s: float, depth: int) -> None:
        """Handles an unwrapped operation; its errors carry its own id."""
        try:
            self._handle(operation, now_s, depth + 1)
        except VoleryError as error:
            self._status(_level_of(error), str(error), operation)

    def _set_level(self, operation: Operation) -> None:
        self._level = read_choice(operation, "level", LEVELS)

    def _authorize(self, operation: Operation) -> None:
        # roslib's `authenticate` sends what it is given as "mac"
        given = operation.get("token", operation.get("mac"))
        if not self.authorized and not shows_token(given, self._shared.token):
            self.refused = "not authorized: wrong token"
            raise BridgeError(self.refused)
        self.authorized = True
        self.on_authorized()

    # --------------------------------------------------------------------------------------- out

    @property
    def congested(self) -> bool:
        """Whether so many bytes wait for the client that reading from it should pause."""
        return self._waiting_bytes > MAX_WAITING_BYTES

    @property
    def has_answers(self) -> bool:
        """Whether the next frame is an answer or a status, not a message of a topic."""
        return bool(self._outbox)

    def send(self, operation: Operation, fragment_size: int | None, compression: str) -> None:
        """Queues an operation for the client.

        Raises
        ------
        BridgeError
            It cannot be encoded, or it is from other clients and this client does not read.

        """
        if self._closed:
            return
        op = operation["op"]
        if self.congested and op in ("action_feedback", "call_service", "send_action_goal"):
            if op == "action_feedback":
                return
            raise BridgeError(f"{self._session.name} does not read")
        if compression == "cbor":
            self._queue(encode_cbor(operation), None)
            return
        text = encode_json(operation)
        self._queue(encode_png(text) if compression == "png" else text, fragment_size)

    def frames(self, now_s: float) -> Iterator[Frame]:
        """Yields the frames to send now: answers first, then messages of all topics in turn."""
        self._now_s = now_s
        self._services.expire(now_s)
        self._assembly.drop_old(now_s)
        yield from self._answers()
        for stream, published in self._topics.take(now_s):
            try:
                frame = self._shared.forms.frame(published, stream.wishes.compression, stream.name)
            except VoleryError as error:
                self._status("error", f"topic '{stream.name}': {error}", {})
                continue
            if isinstance(frame, str):
                yield from self._pieces(frame, stream.wishes.fragment_size)
            else:
                yield frame
            yield from self._answers()
        yield from self._answers()  # statuses of topics that ended

    def due_s(self, now_s: float) -> float | None:
        """Returns when to call `frames` again without a wake-up; None: not before `wake`."""
        times = (self._topics.due_s(now_s), self._services.due_s(), self._assembly.due_s())
        return min((time for time in times if time is not None), default=None)

    def _answers(self) -> Iterator[Frame]:
        while self._outbox:
            size, frames = self._outbox.popleft()
            yield from frames
            self._waiting_bytes -= size

    def _queue(self, frame: Frame, fragment_size: int | None) -> None:
        frames = iter((frame,)) if isinstance(frame, bytes) else self._pieces(frame, fragment_size)
        self._outbox.append((len(frame), frames))
        self._waiting_bytes += len(frame)
        self._wake()

    def _pieces(self, text: str, size: int | None) -> Iterator[Frame]:
        if size is None or len(text) <= size:
            return iter((text,))
        min_size = -(-len(text) // MAX_FRAGMENTS)
        return split(text, max(size, min_size), f"fragments:{next(self._numbers)}")

    def _complain(self, text: str) -> None:
        self._status("error", text, {})

    def _status(self, level: str, text: str, operation: Operation) -> None:
        if _LOUDNESS[level] > _LOUDNESS[self._level]:
            return
        message: dict[str, Any] = {"op": "status", "level": level, "msg": text}
        with suppress(BridgeError):  # an id that cannot be returned
            with_id(message, read_id(operation) if operation else None)
        self.send(message, None, "none")

    # --------------------------------------------------------------------------------------- end

    def close(self) -> None:
        """Releases everything of a client that has left; further calls do nothing."""
        if self._closed:
            return
        self._closed = True
        self._actions.close()
        self._session.on_refused = None
        self._session.close()
        self._outbox.clear()
        self._assembly.close()
        # Without cycles of references its memory is free at once, see `core.collector`.
        self._handlers.clear()
        self._topics.close()
        self._services.close()
        self.on_authorized = lambda: None

    def _drop_fragments(self) -> None:
        if self._assembly.drop_all():
            self._complain(f"fragment: {NO_ROOM}")

    def _poster(self, post: Post) -> Post:
        """Returns `post` with errors reported as statuses."""

        def guarded(action: Callable[[], None]) -> None:
            def act() -> None:
                try:
                    action()
                except VoleryError as error:
                    self._status("error", str(error), {})

            post(act)

        return guarded


def _level_of(error: VoleryError) -> str:
    return "warning" if isinstance(error, NeedlessOperationError) else "error"
