"""State of a rosbridge v2 client: frames in, frames out, no sockets.

Advertisements, subscriptions and services are stored, and sent again by `begin` after every
connection. Any thread may call the methods unless stated otherwise.
"""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

from volery.bridges.rosbridge.cbor_codec import encode_cbor
from volery.bridges.rosbridge.client_topics import RemoteTopics, Subscription
from volery.bridges.rosbridge.fragments import Assembly
from volery.bridges.rosbridge.message_encoder import Generation
from volery.bridges.rosbridge.wire import (
    MAX_MESSAGE_BYTES,
    Frame,
    Operation,
    decode_frame,
    decode_png,
    encode_json,
)
from volery.bridges.unfinished import UnfinishedMessages
from volery.core.errors import GraphError, VoleryError
from volery.graph.codecs.cdr import known
from volery.graph.codecs.json_codec import JsonCodec
from volery.graph.codecs.json_decoding import decode_plain
from volery.graph.codecs.ros1_names import ros1_name, ros2_name
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Handler, SessionInfo
from volery.graph.subscription_queue import Wake

MAX_WAITING = 1000
"""Publications that may wait for the network."""
MAX_WAITING_BYTES = 64 * 1024 * 1024
MAX_PROBLEMS = 100


@dataclass(frozen=True)
class _Offer:
    srvtype: str
    handler: Handler
    pending: set[ServiceReply] = field(default_factory=set)


@dataclass(frozen=True)
class _Call:
    reply: ServiceReply
    take: Callable[[Any], Any]
    """Decodes the response from its plain form."""


class ClientState(RemoteTopics):
    """Holds a client's requests to the server, and the frames to send.

    Parameters
    ----------
    token
        Sent first on every connection.
    wake
        Called when `frames` has new frames.

    """

    def __init__(self, token: str | None, wake: Wake, generation: Generation = "ros2") -> None:
        super().__init__(threading.RLock(), known)
        self.problems: deque[str] = deque(maxlen=MAX_PROBLEMS)
        self.dropped = 0
        self._token = token
        self._wake = wake
        self._connected = False
        self._cbor = False
        self._ros1 = generation == "ros1"
        self._plain = JsonCodec(ros1_names=self._ros1)
        self._typed = JsonCodec(
            non_finite_as_null=False, ros1_names=self._ros1, arrays=lambda values, _type: values
        )
        self._offers: dict[str, _Offer] = {}
        self._calls: dict[str, _Call] = {}
        self._operations: deque[Frame] = deque()
        self._publications: deque[Frame] = deque()
        self._publication_bytes = 0
        self._numbers = itertools.count(1)
        self._assembly = _new_assembly()

    # --------------------------------------------------------------------------------- connection

    def begin(self, *, cbor: bool) -> None:
        """Starts a connection: repeats all requests. cbor: whether the server accepts CBOR."""
        with self._lock:
            self._connected, self._cbor = True, cbor
            self._operations.clear()
            self._assembly = _new_assembly()
            if self._token is not None:
                self._order({"op": "auth", "token": self._token})
            self.repeat_topics()
            for service, offer in self._offers.items():
                self._order(self._offering(service, offer.srvtype))

    def lose(self, why: str) -> None:
        """Handles the loss of the connection: open calls fail, publications are dropped."""
        with self._lock:
            self._connected = False
            self.dropped += len(self._publications)
            self._publications.clear()
            self._publication_bytes = 0
            self._operations.clear()
            calls, self._calls = list(self._calls.values()), {}
        for call in calls:
            call.reply.fail(GraphError(why))

    def frames(self) -> Iterator[Frame]:
        """Yields the frames to send: requests and answers first, then publications."""
        while True:
            with self._lock:
                if self._operations:
                    frame = self._operations.popleft()
                elif self._publications:
                    frame = self._publications.popleft()
                    self._publication_bytes -= len(frame)
                else:
                    return
            yield frame

    def info(self, name: str) -> SessionInfo:
        """Returns the current state of the client."""
        with self._lock:
            return SessionInfo(name, self.announced, self.queues, tuple(self._offers))

    def _order(self, operation: Operation) -> None:
        """Queues an operation if there is a connection; `begin` repeats lasting ones."""
        if self._connected:
            self._operations.append(encode_json(operation))
            self._wake()

    # ---------------------------------------------------------------------------------- services

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Calls a service; without a request rosapi is first asked for its type."""
        if request is not None:
            srvtype = request.__msgtype__.removesuffix("_Request")
            args = self._plain.encode(request, request.__msgtype__)
            self._call(service, args, reply, lambda v: decode_plain(v, f"{srvtype}_Response"))
            return

        def ask(srvtype: str) -> None:
            if not srvtype:
                reply.fail(GraphError(f"service '{service}' has no server"))
                return
            answer = f"{srvtype}_Response"
            self._call(service, {}, reply, lambda values: decode_plain(values, answer))

        asking = ServiceReply(ask, reply.fail)
        self._call("/rosapi/service_type", {"service": service}, asking, _service_type_of)

    def ask_rosapi(self, service: str, args: dict[str, Any], found: Future[str]) -> None:
        """Asks rosapi for the type of a topic or service."""
        reply = ServiceReply(found.set_result, found.set_exception)
        self._call(f"/rosapi/{service}", args, reply, _type_of)

    def _call(
        self, service: str, args: dict[str, Any], reply: ServiceReply, take: Callable[[Any], Any]
    ) -> None:
        with self._lock:
            if self._connected:
                number = f"call_service:{service}:{next(self._numbers)}"
                self._calls[number] = _Call(reply, take)
                reply.when_done(lambda: self._forget_call(number))
                self._order({"op": "call_service", "id": number, "service": service, "args": args})
                return
        reply.fail(GraphError(f"service '{service}': there is no connection"))

    def _forget_call(self, number: str) -> None:
        with self._lock:
            self._calls.pop(number, None)

    def create_service(self, service: str, srvtype: str, handler: Handler) -> None:
        """Creates a service."""
        known(f"{srvtype}_Request")
        with self._lock:
            if service in self._offers:
                raise GraphError(f"service '{service}' exists already")
            self._offers[service] = _Offer(srvtype, handler)
            self._order(self._offering(service, srvtype))

    def destroy_service(self, service: str, client_name: str) -> None:
        """Destroys a service; its open requests fail."""
        with self._lock:
            offer = self._offers.pop(service, None)
            if offer is None:
                raise GraphError(f"{client_name} has no service '{service}'")
            self._order({"op": "unadvertise_service", "service": service})
        for reply in tuple(offer.pending):
            reply.fail(GraphError(f"service '{service}': {client_name} is closed"))

    # ------------------------------------------------------------------------------------- words

    def _spelled(self, name: str) -> str:
        return ros1_name(name) if self._ros1 else name

    def _offering(self, service: str, srvtype: str) -> Operation:
        return {"op": "advertise_service", "service": service, "type": self._spelled(srvtype)}

    def _send_advertised(self, topic: str, msgtype: str, latched: bool) -> None:
        spelled = self._spelled(msgtype)
        self._order({"op": "advertise", "topic": topic, "type": spelled, "latch": latched})

    def _send_unadvertised(self, topic: str) -> None:
        self._order({"op": "unadvertise", "topic": topic})

    def _send_subscribed(self, topic: str, subscription: Subscription) -> None:
        operation: Operation = {
            "op": "subscribe",
            "topic": topic,
            "type": self._spelled(subscription.msgtype),
            "queue_length": subscription.depth,
            "compression": "cbor",
        }
        if subscription.reliable:
            operation["qos"] = {"reliability": "reliable"}
        self._order(operation)

    def _send_unsubscribed(self, topic: str) -> None:
        self._order({"op": "unsubscribe", "topic": topic})

    def _send(self, topic: str, message: Any, msgtype: str) -> None:
        if not self._connected:
            self.dropped += 1
            return
        form = self._typed if self._cbor else self._plain
        operation = {"op": "publish", "topic": topic, "msg": form.encode(message, msgtype)}
        frame = encode_cbor(operation) if self._cbor else encode_json(operation)
        with self._lock:
            self._publications.append(frame)
            self._publication_bytes += len(frame)
            while (
                len(self._publications) > MAX_WAITING or self._publication_bytes > MAX_WAITING_BYTES
            ):
                self._publication_bytes -= len(self._publications.popleft())
                self.dropped += 1
        self._wake()

    # ------------------------------------------------------------------------------------- input

    def receive(self, frame: Frame, now_s: float) -> None:
        """Handles a frame from the server, in the client's thread; stores errors as problems."""
        try:
            self._handle(decode_frame(frame), now_s)
        except VoleryError as error:
            self.problems.append(str(error))

    def _handle(self, operation: Operation, now_s: float) -> None:
        op = operation["op"]
        if op == "publish":
            topic = str(operation.get("topic"))
            self._deliver(topic, lambda msgtype: decode_plain(operation.get("msg"), msgtype))
        elif op == "service_response":
            self._take_response(operation)
        elif op == "call_service":
            self._take_request(operation)
        elif op == "fragment":
            whole = self._assembly.add(operation, now_s)
            if whole is not None:
                self._handle(decode_frame(whole), now_s)
        elif op == "png":
            self._handle(decode_png(operation, MAX_MESSAGE_BYTES), now_s)
        elif op == "status":
            self.problems.append(str(operation.get("msg")))

    def _take_response(self, operation: Operation) -> None:
        with self._lock:
            call = self._calls.pop(str(operation.get("id")), None)
        if call is None:
            return
        values = operation.get("values")
        if operation.get("result", True) is not True:
            call.reply.fail(GraphError(str(values)))
            return
        try:
            response = call.take({} if values is None else values)
        except GraphError as error:
            call.reply.fail(error)
            return
        call.reply.answer(response)

    def _take_request(self, operation: Operation) -> None:
        service, key = str(operation.get("service")), operation.get("id")
        response: Operation = {"op": "service_response", "service": service, "id": key}

        def respond(values: Any, success: bool) -> None:
            with self._lock:
                self._order(response | {"values": values, "result": success})

        offer = self._offers.get(service)
        if offer is None:
            respond(f"service '{service}' does not exist here", False)
            return

        def answer(message: Any) -> None:
            try:
                values = self._plain.encode(message, f"{offer.srvtype}_Response")
            except GraphError as error:
                fail(error)
            else:
                respond(values, True)

        def fail(error: GraphError) -> None:
            respond(str(error), False)

        reply = ServiceReply(answer, fail)
        try:
            request = decode_plain(operation.get("args") or {}, f"{offer.srvtype}_Request")
            offer.pending.add(reply)
            reply.when_done(lambda: offer.pending.discard(reply))
            offer.handler(request, reply)
        except Exception as error:  # report an error of the handler to the caller
            reply.fail(GraphError(f"{type(error).__name__}: {error}"))


def _type_of(values: Any) -> str:
    """Returns the ROS 2 name of the message type in rosapi's answer; empty if there is none."""
    found = values.get("type") if isinstance(values, dict) else None
    return ros2_name(found) if isinstance(found, str) and found else ""


def _service_type_of(values: Any) -> str:
    """Returns the ROS 2 name of the service type in rosapi's answer; empty if there is none."""
    found = values.get("type") if isinstance(values, dict) else None
    return ros2_name(found, "srv") if isinstance(found, str) and found else ""


def _new_assembly() -> Assembly:
    """Returns an assembly with an account of its own: the server is trusted."""
    return Assembly(MAX_MESSAGE_BYTES, account=UnfinishedMessages(5 * MAX_MESSAGE_BYTES))
