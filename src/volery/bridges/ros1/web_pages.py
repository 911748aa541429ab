"""Keeps web pages from the XML-RPC port that rospy opens.

A page of a stranger may post to any port of its reader's machine, as long as the content type is
one of those that forms have. XML-RPC demands `text/xml`. Browsers name the page's origin in each
POST; programs name none.

Sources: Fetch Standard, "CORS-safelisted request-header"; XML-RPC Specification, "Header
requirements"; RFC 6454 section 7.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any


def is_of_a_page(headers: Mapping[str, str]) -> bool:
    """Returns whether a web page may have sent a request with these headers."""
    kind = (headers.get("Content-Type") or "").partition(";")[0].strip().lower()
    return "Origin" in headers or not kind.endswith("/xml")


def refuse_web_pages() -> None:
    """Has servers that rospy opens from now on refuse what web pages send."""
    module: Any = importlib.import_module("rosgraph.xmlrpc")
    handler: Any = module.SilenceableXMLRPCRequestHandler
    if getattr(handler, "refuses_web_pages", False):
        return

    class Handler(handler):  # type: ignore[misc]
        """rospy's own, for programs alone."""

        refuses_web_pages = True

        def do_POST(self) -> None:  # noqa: N802
            """As of `http.server`."""
            if is_of_a_page(self.headers):
                self.close_connection = True
                self.send_error(HTTPStatus.FORBIDDEN, "programs alone may call this")
                return
            super().do_POST()

    module.SilenceableXMLRPCRequestHandler = Handler
