"""Parses addresses as users write them: `3`, `0.3`, `uav4`, `batch1`, `all`."""

from __future__ import annotations

import re
from collections.abc import Mapping

from volery.comms.addresses import ALL, Identity, batch_address
from volery.core.errors import CommsError

FORMS = "a linear id such as 3, batch.plane such as 0.3, a name such as uav4, batch1, or all"


def address_of(text: str, group_size: int, names: Mapping[str, int]) -> int:
    """Returns the address of a word; names: addresses by the names that stations report.

    `uavN`, if no station reports it, is the station with linear id N - 1. Raises CommsError if the
    word is no address.
    """
    if text == "all":
        return ALL
    if text in names:
        return names[text]
    if found := re.fullmatch(r"batch(\d{1,5})", text):
        return batch_address(int(found[1]))
    if found := re.fullmatch(r"(\d{1,5})\.(\d{1,5})", text):
        return Identity(int(found[1]), int(found[2])).address(group_size)
    if found := re.fullmatch(r"(uav)?(\d{1,5})", text):
        linear = int(found[2]) - bool(found[1])
        return Identity.of(linear, group_size).address(group_size)
    raise CommsError(f"'{text}' is not an address: write {FORMS}")
