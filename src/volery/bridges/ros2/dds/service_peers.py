"""Identifies service endpoints compatible with rmw_cyclonedds, and explains the others.

rmw_cyclonedds and rmw_fastrtps give a service's topics the same names, but rmw_cyclonedds begins
each request and response with the client and a number. rmw_fastrtps sends both in the parameters of
RTPS samples (PID_RELATED_SAMPLE_IDENTITY), which Cyclone DDS neither reads nor sets, so that bytes
of another implementation would be misread. Endpoints of rmw_cyclonedds have `clientid=` or
`serviceid=` in their user data. The first two bytes of a GUID name the vendor of the DDS (RTPS 2.5,
9.3.1.5).
"""

from __future__ import annotations

from collections.abc import Callable

from volery.bridges.ros2.dds.endpoint_info import EndpointInfo

CLIENT, SERVER = "clientid", "serviceid"
_FAST_DDS = b"\x01\x0f"
_VENDORS = {b"\x01\x10": "Cyclone DDS", b"\x01\x01": "RTI Connext DDS", b"\x01\x03": "OpenDDS"}


def why_foreign(word: str, key: bytes) -> str:
    """Returns why an endpoint without `word` in its user data is not supported.

    key: its GUID.
    """
    if key.startswith(_FAST_DDS):
        return (
            "uses rmw_fastrtps, not rmw_cyclonedds; start it with "
            "RMW_IMPLEMENTATION=rmw_cyclonedds_cpp"
        )
    vendor = _VENDORS.get(key[:2], f"a DDS of vendor {key[:2].hex('.')}")
    return (
        f"is of {vendor} and lacks '{word}=...;' in its user data, by which endpoints of "
        "rmw_cyclonedds are known: add it to a plain DDS program whose requests and responses "
        "begin as those of rmw_cyclonedds do"
    )


_MAX_KNOWN = 10_000


class ServicePeers:
    """The matched endpoints of one side, by their instance handles.

    look_up: returns the description of an endpoint; None if it has left.
    """

    def __init__(self, word: str, look_up: Callable[[int], EndpointInfo | None]) -> None:
        self._word = word
        self._mark = f"{word}=".encode()
        self._look_up = look_up
        self._known: dict[int, str] = {}

    def problem(self, handle: int) -> str:
        """Returns why an endpoint is not supported; empty if it is, and for one that has left."""
        known = self._known.get(handle)
        if known is None:
            found = self._look_up(handle)
            if found is None or found.terms is None:
                return ""
            if len(self._known) >= _MAX_KNOWN:
                self._known.clear()
            is_marked = self._mark in found.terms.user_data
            known = "" if is_marked else why_foreign(self._word, found.key)
            self._known[handle] = known
        return known
