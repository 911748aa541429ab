"""Detects requests of web pages to the XML-RPC port that rospy opens.

A page of any site may post to any port of its user's machine, as long as the content type is one of
those of forms. XML-RPC demands `text/xml`. Browsers name the page's origin in each POST; programs
name none.

Sources: Fetch Standard, "CORS-safelisted request-header"; XML-RPC Specification, "Header
requirements"; RFC 6454 section 7.
"""

from __future__ import annotations

from collections.abc import Mapping


def is_of_a_page(headers: Mapping[str, str]) -> bool:
    """Returns whether a web page may have sent a request with these headers."""
    kind = (headers.get("Content-Type") or "").partition(";")[0].strip().lower()
    return "Origin" in headers or not kind.endswith("/xml")
