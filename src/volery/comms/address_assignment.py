"""Assigns station addresses to UAVs: uavN has the linear id N - 1, others get a free one."""

from __future__ import annotations

import re
from collections.abc import Collection

from volery.comms.addresses import FIRST_GROUND


def free_address(uav: str, used: Collection[int]) -> int:
    """Returns the linear id of a UAV that joins stations with the ids `used`."""
    number = re.fullmatch(r"uav([1-9]\d{0,4})", uav)
    if number and int(number[1]) - 1 not in used and int(number[1]) <= FIRST_GROUND:
        return int(number[1]) - 1
    return next(address for address in range(FIRST_GROUND) if address not in used)
