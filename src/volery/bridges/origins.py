"""Checks the origin of web pages that connect to a server on this machine.

A web page of another site, open in a browser on this machine, can connect to loopback too. Browsers
send the page's site in the header `Origin`; other programs send none.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence
from urllib.parse import urlsplit

from volery.core.network_access import LOOPBACK


class Origins:
    """Accepts pages from localhost, from the server's own address, and from a list.

    Parameters
    ----------
    listed
        Further origins, such as `https://studio.example.org`; `null` and `file://` mean pages
        opened from files.
    token_needed
        Whether clients also need a token.

    """

    def __init__(self, listed: Sequence[str] = (), *, token_needed: bool = False) -> None:
        self._listed = frozenset(_plain(origin) for origin in listed)
        self._token_needed = token_needed

    def let_in(self, origin: str | None, host: str) -> bool:
        """Returns whether pages of `origin` may connect.

        Host: the client's name for this server.
        """
        if origin is None or _plain(origin) in self._listed:
            return True
        page = name_of(origin.partition("//")[2])
        if page is None:  # "null": a file, or a page that hides its origin
            return False
        if page in LOOPBACK:
            return True
        # The owner of a name may point it here, so only an address proves that the page is from the
        # server it connects to; if a token is required, a name is enough.
        return page == name_of(host) and (is_address(page) or self._token_needed)

    def knows(self, host: str) -> bool:
        """Returns whether a client may call a server on loopback by this name, `Host`.

        DNS rebinding: an attacker may let a host name point to 127.0.0.1; a page under that name
        then has the same origin as this server. A token keeps it out as well.
        """
        if self._token_needed or name_of(host) in LOOPBACK:
            return True
        return any(origin.partition("//")[2] == host for origin in self._listed)


def _plain(origin: str) -> str:
    """Returns an origin as browsers send it; programs in a web view send files as `file://`."""
    return "null" if origin.startswith("file:") else origin.rstrip("/")


def name_of(host: str) -> str | None:
    """Returns `example.org` for `example.org:8080`, `::1` for `[::1]:8080`; None for no host."""
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None


def is_address(host: str) -> bool:
    """Returns whether a host is an IP address, not a name."""
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True
