"""Long lists of parts of a message that are made only where somebody reads them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, overload


class LazyList(Sequence[Any]):
    """A list of `count` parts that `make()` yields anew each time it is read.

    A message with hundreds of parts, of which a slow client drops most, costs next to nothing until
    it is written to a wire; and its parts are gone at once, where a list of them would have
    Python's garbage collector look through everything else. `make` must always yield the same.
    """

    def __init__(self, count: int, make: Callable[[], Iterable[Any]]) -> None:
        self._count = count
        self._make = make

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Any]:
        return iter(self._make())

    @overload
    def __getitem__(self, which: int) -> Any: ...
    @overload
    def __getitem__(self, which: slice) -> list[Any]: ...
    def __getitem__(self, which: int | slice) -> Any:
        return list(self)[which]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, list | LazyList) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        """A pickle or copy is a plain list."""
        return list, (list(self),)

    def __repr__(self) -> str:
        return repr(list(self))
