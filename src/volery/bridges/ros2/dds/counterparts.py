"""Who at the other end of a service speaks as rmw_cyclonedds does.

Both that and rmw_fastrtps call a service's topics the same, but rmw_cyclonedds begins each request
and response with who asked and a number. rmw_fastrtps tells both in the parameters of RTPS samples
(PID_RELATED_SAMPLE_IDENTITY), which Cyclone DDS neither hands over nor lets set, so that a
stranger's bytes would be misread. Endpoints of rmw_cyclonedds have `clientid=` or `serviceid=` in
their user data.
"""

from __future__ import annotations

from collections.abc import Callable

from volery.bridges.ros2.dds.announced import Announced

CLIENT, SERVER = "clientid", "serviceid"
FOREIGN = (
    "speaks as rmw_fastrtps does, not as rmw_cyclonedds; start it with "
    "RMW_IMPLEMENTATION=rmw_cyclonedds_cpp"
)
_MOST_KNOWN = 10_000


class Counterparts:
    """The matched endpoints of one side, by their instance handles.

    look_up: what an endpoint tells of itself; None once it has left.
    """

    def __init__(self, word: str, look_up: Callable[[int], Announced | None]) -> None:
        self._mark = f"{word}=".encode()
        self._look_up = look_up
        self._known: dict[int, bool] = {}

    def understands(self, handle: int) -> bool:
        """Whether it speaks as we do; who has left already gets the benefit of the doubt."""
        known = self._known.get(handle)
        if known is None:
            found = self._look_up(handle)
            if found is None or found.terms is None:
                return True
            if len(self._known) >= _MOST_KNOWN:
                self._known.clear()
            known = self._known[handle] = self._mark in found.terms.user_data
        return known
