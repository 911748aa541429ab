"""`volery service list|type|call`: a graph's services from a terminal."""

from __future__ import annotations

from contextlib import closing

import typer

from volery.cli.asking import service_names, type_of_service
from volery.cli.links import open_link
from volery.cli.yaml_form import read_message, to_yaml
from volery.graph.link import call_and_wait


def list_services(via: str, *, types: bool) -> None:
    """Print the services, one a line."""
    with closing(open_link(via, "volery_service_list")) as link:
        for service in service_names(link):
            typer.echo(f"{service} [{type_of_service(link, service)}]" if types else service)


def show_type(via: str, service: str) -> None:
    """Print a service's type."""
    with closing(open_link(via, "volery_service_type")) as link:
        typer.echo(type_of_service(link, service))


def call(via: str, service: str, values: str | None, *, timeout_s: float) -> None:
    """Call a service with a request typed as YAML and print the response as YAML."""
    with closing(open_link(via, "volery_service_call")) as link:
        srvtype = type_of_service(link, service)
        request = read_message(values or "{}", f"{srvtype}_Request")
        response = call_and_wait(link, service, request, timeout_s)
        typer.echo(to_yaml(response, whole=True) or "(an empty response)")
