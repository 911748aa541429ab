"""Commands of the radio network: its server, and a ground station at a terminal."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.error_reporting import guarded
from volery.cli.options import BatchSizeOption, TokenOption


@guarded
def comms(
    port: Annotated[int, typer.Option(min=0, max=65535, help="0: a free one.")] = 10200,
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    batch_size: BatchSizeOption = 4,
    allow_remote: Annotated[
        bool, typer.Option("--allow-remote", help="Listen beyond this machine; needs a token.")
    ] = False,
    token: TokenOption = None,
) -> None:
    """Serve the radio network's stations until Ctrl-C: UAVs and ground stations."""
    from volery.cli.comms import serve_stations
    from volery.comms.server.settings import RouterSettings

    settings = RouterSettings(planes_per_batch=batch_size, token=token)
    serve_stations(host, port, settings, anywhere=allow_remote)


@guarded
def gcs(
    server: Annotated[
        str, typer.Option(metavar="HOST:PORT", help="Of volery comms.")
    ] = "127.0.0.1:10200",
    number: Annotated[int, typer.Option(min=0, max=255, help="Of this ground station.")] = 0,
    batch_size: BatchSizeOption = 4,
    token: TokenOption = None,
    log: Annotated[Path | None, typer.Option(help="Append what is said to this file.")] = None,
) -> None:
    """Watch and command UAVs over the radio network, line by line; help lists the commands."""
    from volery.cli.gcs import command_station

    command_station(server, number, token, batch_size, log)
