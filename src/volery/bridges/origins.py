"""Whose web pages may reach a server on this machine.

A web page of a stranger, open in a browser on this machine, reaches loopback too. Browsers tell
whose page it is in the header `Origin`; programs tell none.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence
from urllib.parse import urlsplit

from volery.core.network_access import LOOPBACK


class Origins:
    """Lets pages in from localhost, from the address that is connected to, and from a list.

    Parameters
    ----------
    listed
        Further origins, such as `https://studio.example.org`.
    token_needed
        Whether clients must show a token besides.

    """

    def __init__(self, listed: Sequence[str] = (), *, token_needed: bool = False) -> None:
        self._listed = frozenset(origin.rstrip("/") for origin in listed)
        self._token_needed = token_needed

    def let_in(self, origin: str | None, host: str) -> bool:
        """Whether pages of `origin` may come; host: what the client calls this server."""
        if origin is None or origin in self._listed:
            return True
        page = name_of(origin.partition("//")[2])
        if page is None:  # "null": a file, or a page that hides where it is from
            return False
        if page in LOOPBACK:
            return True
        # A name may be made to point here by whoever owns it, so only an address proves the page
        # to be from where it connects to; where a token is asked for, a name will do.
        return page == name_of(host) and (is_address(page) or self._token_needed)

    def lists(self, host: str) -> bool:
        """Whether a listed origin is of this host, such as `studio.example.org:8443`."""
        return any(origin.partition("//")[2] == host for origin in self._listed)


def name_of(host: str) -> str | None:
    """`example.org` of `example.org:8080`, `::1` of `[::1]:8080`; None where it is no host."""
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None


def is_address(host: str) -> bool:
    """Whether a host is a number, not a name."""
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True
