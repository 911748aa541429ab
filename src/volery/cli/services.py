"""`volery service list|type|call`: queries a graph's services from a terminal."""

from __future__ import annotations

from contextlib import closing
from typing import Any

from volery.cli.connections import open_link
from volery.cli.graph_queries import service_names, type_of_service
from volery.cli.terminal import echo_line, echo_lines
from volery.cli.yaml_codec import read_message, to_yaml
from volery.core.errors import BridgeError
from volery.graph.connection import call_and_wait

_RESULT = "simulation_interfaces/msg/Result"


def list_services(via: str, *, types: bool) -> None:
    """Prints the services, one per line."""
    with closing(open_link(via, "volery_service_list")) as link:
        for service in service_names(link):
            echo_line(f"{service} [{type_of_service(link, service)}]" if types else service)


def show_type(via: str, service: str) -> None:
    """Prints a service's type."""
    with closing(open_link(via, "volery_service_type")) as link:
        echo_line(type_of_service(link, service))


def call(via: str, service: str, values: str | None, *, timeout_s: float) -> None:
    """Calls a service with a request typed as YAML and prints the response as YAML.

    Raises `BridgeError` if the response says that the request is refused.
    """
    with closing(open_link(via, "volery_service_call")) as link:
        srvtype = type_of_service(link, service)
        request = read_message(values or "{}", f"{srvtype}_Request")
        response = call_and_wait(link, service, request, timeout_s)
    echo_lines(to_yaml(response, whole=True) or "(an empty response)")
    reason = refusal_of(response)
    if reason is not None:
        raise BridgeError(f"{service} refuses: {reason or 'no reason given'}")


def refusal_of(response: Any) -> str | None:
    """Returns why a response refuses its request; None if it does not.

    Recognizes `success` with `message` (std_srvs and Volery's services) and the `Result` of
    simulation_interfaces.
    """
    if getattr(response, "success", True) is False:
        return str(getattr(response, "message", ""))
    result = getattr(response, "result", None)
    if getattr(result, "__msgtype__", "") == _RESULT and result is not None:
        return None if result.result == result.RESULT_OK else str(result.error_message)
    return None
