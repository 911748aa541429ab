"""Addresses, u16: stations by batch and plane, batches, all stations; see docs/comms.md."""

from __future__ import annotations

from dataclasses import dataclass

from volery.core.errors import CommsError

GROUP_SIZE = 4
"""As in the ROSUnitySim article: linear id = 4 x batch + plane."""
FIRST_GROUND = 0x7F00
FIRST_BATCH = 0x8000
LAST_BATCH = 0xBFFF
ALL_GROUND = 0xC000
SERVER = 0xFFFE
ALL = 0xFFFF
GROUND_BATCH = 0xFFFF
"""The batch of ground stations in HELLO."""


@dataclass(frozen=True)
class Identity:
    """A station by its batch and the number within; ground stations have `GROUND_BATCH`."""

    batch: int
    plane: int

    @classmethod
    def ground(cls, number: int = 0) -> Identity:
        """Returns the identity of a ground station."""
        return cls(GROUND_BATCH, number)

    @classmethod
    def of(cls, address: int, group_size: int = GROUP_SIZE) -> Identity:
        """Returns the identity of an address. Raises CommsError if it is not a station's."""
        if not is_station(address):
            raise CommsError(f"{address} is not a station: stations are 0 to {FIRST_BATCH - 1}")
        if address >= FIRST_GROUND:
            return cls.ground(address - FIRST_GROUND)
        return cls(*divmod(address, group_size))

    def address(self, group_size: int = GROUP_SIZE) -> int:
        """Returns the linear id. Raises CommsError if batch or plane are out of range."""
        if self.batch == GROUND_BATCH:
            if 0 <= self.plane < FIRST_BATCH - FIRST_GROUND:
                return FIRST_GROUND + self.plane
            raise CommsError(f"ground stations are numbered 0 to 255, not {self.plane}")
        if not 0 <= self.plane < group_size:
            raise CommsError(f"plane {self.plane}: a batch has the planes 0 to {group_size - 1}")
        linear = group_size * self.batch + self.plane
        if not (0 <= linear < FIRST_GROUND and self.batch <= LAST_BATCH - FIRST_BATCH):
            raise CommsError(
                f"there is no batch {self.batch}: batches go to {LAST_BATCH - FIRST_BATCH}, "
                f"linear ids to {FIRST_GROUND - 1}"
            )
        return linear


def is_station(address: int) -> bool:
    """Returns whether an address is that of one station."""
    return 0 <= address < FIRST_BATCH


def batch_address(batch: int) -> int:
    """Returns the address of all stations of a batch. Raises CommsError if it is out of range."""
    if not 0 <= batch <= LAST_BATCH - FIRST_BATCH:
        raise CommsError(f"batches are numbered 0 to {LAST_BATCH - FIRST_BATCH}, not {batch}")
    return FIRST_BATCH + batch


def is_meant(station: int, address: int, group_size: int = GROUP_SIZE) -> bool:
    """Returns whether `address` includes a station."""
    if FIRST_BATCH <= address <= LAST_BATCH:
        return station < FIRST_GROUND and station // group_size == address - FIRST_BATCH
    if address == ALL_GROUND:
        return FIRST_GROUND <= station < FIRST_BATCH
    return address in (station, ALL)
