"""Commands of the radio network: its server, and a ground station at a terminal."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.error_reporting import guarded
from volery.cli.options import GroupSizeOption, TokenOption


@guarded
def comms(
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Set the port; 0 picks a free one.")
    ] = 10200,
    host: Annotated[str, typer.Option(help="Set the address to listen on.")] = "127.0.0.1",
    group_size: GroupSizeOption = 4,
    allow_remote: Annotated[
        bool, typer.Option("--allow-remote", help="Accept remote clients; needs a token.")
    ] = False,
    token: TokenOption = None,
) -> None:
    """Run the communication server of UAVs and ground stations until Ctrl-C."""
    from volery.cli.comms import serve_stations
    from volery.comms.server.settings import RouterSettings

    settings = RouterSettings(group_size=group_size, token=token)
    serve_stations(host, port, settings, anywhere=allow_remote)


@guarded
def gcs(
    server: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Connect to this `volery comms`.")
    ] = "127.0.0.1:10200",
    station_id: Annotated[
        int, typer.Option(min=0, max=255, help="Set the number of this ground station.")
    ] = 0,
    group_size: GroupSizeOption = 4,
    token: Annotated[
        str | None, typer.Option(envvar="VOLERY_TOKEN", help="Send this token to the server.")
    ] = None,
    log: Annotated[Path | None, typer.Option(help="Append all lines to this file.")] = None,
) -> None:
    """Monitor and command UAVs over the radio network; type help for the commands."""
    from volery.cli.gcs import command_station

    command_station(server, station_id, token, group_size, log)
