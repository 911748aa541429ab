"""Provides long lists of message parts that are built only when read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, overload


class LazyList(Sequence[Any]):
    """A list of `count` parts that `make()` builds at each access.

    A message with hundreds of parts costs almost nothing until it is encoded, and a slow client
    drops most such messages. The parts are freed at once, whereas a permanent list of them would
    burden Python's garbage collector. `make` must always return equal parts.

    `cdr` returns the CDR of a message whose only field is this list, where that is quicker than
    encoding the parts.
    """

    def __init__(
        self,
        count: int,
        make: Callable[[], Iterable[Any]],
        cdr: Callable[[], bytes] | None = None,
    ) -> None:
        self._count = count
        self._make = make
        self.cdr = cdr

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

    def __add__(self, other: Any) -> Any:
        return list(self) + list(other) if isinstance(other, list | LazyList) else NotImplemented

    def __radd__(self, other: Any) -> Any:
        return other + list(self) if isinstance(other, list) else NotImplemented

    def __eq__(self, other: object) -> bool:
        return isinstance(other, list | LazyList) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles and copies as a plain list."""
        return list, (list(self),)

    def __repr__(self) -> str:
        return repr(list(self))
