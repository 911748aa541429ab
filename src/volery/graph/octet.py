"""The value of a `byte` field: a number here, `bytes` of length 1 in rclpy."""

from __future__ import annotations

from typing import Any


class Octet(int):
    """A number that nodes may also compare, index and convert as the `bytes` of rclpy.

    Numbers from -128 to 255 stand for the octets of the same bits.
    """

    def __bytes__(self) -> bytes:
        """Returns the byte."""
        return bytes((self & 0xFF,))

    def __getitem__(self, which: Any) -> Any:
        """Returns the byte as a number for the index 0."""
        return bytes(self)[which]

    def __len__(self) -> int:
        """Returns 1."""
        return 1

    def __eq__(self, other: object) -> bool:
        """Compares with numbers and bytes."""
        return bytes(self) == other if isinstance(other, bytes) else int(self) == other

    def __ne__(self, other: object) -> bool:
        """Compares with numbers and bytes."""
        return not self == other

    __hash__ = int.__hash__
