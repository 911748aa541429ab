"""Queries a graph on behalf of command-line tools; each call waits for the response."""

from __future__ import annotations

from typing import Any

from volery.core.errors import BridgeError
from volery.graph.connection import GraphConnection, ListsServices, ListsTopics, call_and_wait
from volery.graph.messages import message_type

TIMEOUT_S = 10.0


def call_rosapi(link: GraphConnection, type_name: str, **fields: Any) -> Any:
    """Calls a `/rosapi` service; `type_name` is its type, such as `TopicType`."""
    request = message_type(f"rosapi_msgs/srv/{type_name}_Request")(**fields)
    return call_and_wait(link, "/rosapi/" + _snake(type_name), request, TIMEOUT_S)


def topic_types(link: GraphConnection) -> dict[str, str]:
    """Returns the topics of the graph and their types, by name."""
    if isinstance(link, ListsTopics):
        return dict(sorted(link.topic_types().items()))
    response = call_rosapi(link, "Topics")
    return dict(sorted(zip(response.topics, response.types, strict=True)))


def type_of_topic(link: GraphConnection, topic: str) -> str:
    """Returns the type of a topic. Raises `BridgeError` if there is no such topic."""
    if isinstance(link, ListsTopics):
        found = link.topic_types().get(topic, "")
    else:
        found = call_rosapi(link, "TopicType", topic=topic).type
    if not found:
        raise BridgeError(f"there is no topic '{topic}'; see `volery topic list`")
    return found


def service_names(link: GraphConnection) -> list[str]:
    """Returns the services of the graph, sorted."""
    if isinstance(link, ListsServices):
        return sorted(link.service_types())
    return sorted(call_rosapi(link, "Services").services)


def type_of_service(link: GraphConnection, service: str) -> str:
    """Returns the type of a service. Raises `BridgeError` if the service has no server."""
    if isinstance(link, ListsServices):
        found = link.service_types().get(service, "")
    else:
        found = call_rosapi(link, "ServiceType", service=service).type
    if not found:
        raise BridgeError(f"service '{service}' has no server; see `volery service list`")
    return found


def _snake(name: str) -> str:
    return "".join(f"_{c.lower()}" if c.isupper() else c for c in name).lstrip("_")
