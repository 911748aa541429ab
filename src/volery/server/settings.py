"""Settings of the page's server: address, tokens, origins, folders."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from volery.server.auth import Tokens

DEFAULT_HOST, DEFAULT_PORT = "127.0.0.1", 8080


@dataclass(frozen=True)
class PageSettings:
    """Address, tokens, origins and folders of the server."""

    host: str = DEFAULT_HOST
    port: int = DEFAULT_PORT
    """0: a free port."""
    tokens: Tokens = field(default_factory=Tokens)
    anywhere: bool = False
    """Permission to listen beyond loopback."""
    origins: tuple[str, ...] = ()
    """Additional web origins to accept, such as that of a reverse proxy."""
    recordings: Path | None = None
    """Folder of recorded and uploaded logs; None: no recordings."""
    uploads: Path | None = None
    """Folder of uploaded scenarios; None: no uploads."""
    unasked: bool = False
    """Whether no option named the first scenario: the page then opens with the choice."""
    tensorboard: Path | None = None
    """Folder of event files that TensorBoard shows; None: no TensorBoard."""
