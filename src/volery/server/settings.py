"""Where the page's server listens, and whom it lets in."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from volery.server.auth import Tokens

DEFAULT_HOST, DEFAULT_PORT = "127.0.0.1", 8080


@dataclass(frozen=True)
class PageSettings:
    """Where the server listens and whom it lets in."""

    host: str = DEFAULT_HOST
    port: int = DEFAULT_PORT
    """0: a free one."""
    tokens: Tokens = field(default_factory=Tokens)
    anywhere: bool = False
    """Consent to listening beyond loopback."""
    origins: tuple[str, ...] = ()
    """Further web origins to let in, such as that of a reverse proxy."""
    recordings: Path | None = None
    """Folder of the logs that clients make, fetch and bring; None: there is none."""
    uploads: Path | None = None
    """Folder of the scenarios that are made of files that clients bring; None: there is none."""
