"""Questions to a graph that command-line tools wait for."""

from __future__ import annotations

import threading
from typing import Any

from volery.core.errors import BridgeError, GraphError
from volery.graph.link import Link
from volery.graph.messages import message_type
from volery.graph.reply import Reply

TIMEOUT_S = 10.0


def ask(link: Link, service: str, request: Any | None, timeout_s: float = TIMEOUT_S) -> Any:
    """Call a service and wait for its response. `GraphError` with the reason where none comes."""
    come = threading.Event()
    outcome: list[Any] = []

    def take(what: Any) -> None:
        outcome.append(what)
        come.set()

    link.call(service, request, Reply(take, take))
    if not come.wait(timeout_s):
        raise GraphError(f"service '{service}' did not answer within {timeout_s:g} s")
    if isinstance(outcome[0], GraphError):
        raise outcome[0]
    return outcome[0]


def ask_rosapi(link: Link, question: str, **fields: Any) -> Any:
    """Ask a `/rosapi` service, `question` being its type: `TopicType`."""
    request = message_type(f"rosapi_msgs/srv/{question}_Request")(**fields)
    return ask(link, "/rosapi/" + _snake(question), request)


def topic_types(link: Link) -> dict[str, str]:
    """Topics of the graph and their types, by name."""
    answer = ask_rosapi(link, "Topics")
    return dict(sorted(zip(answer.topics, answer.types, strict=True)))


def type_of_topic(link: Link, topic: str) -> str:
    """Type of a topic. `BridgeError` where there is no such topic."""
    found: str = ask_rosapi(link, "TopicType", topic=topic).type
    if not found:
        raise BridgeError(f"there is no topic '{topic}'; see `volery topic list`")
    return found


def _snake(name: str) -> str:
    return "".join(f"_{c.lower()}" if c.isupper() else c for c in name).lstrip("_")
