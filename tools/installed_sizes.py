"""Prints the size of each package of this environment, MB without bytecode, and what requires it.

The figures of docs/extras.md: `pip install volery` into an empty environment, then there

    python tools/installed_sizes.py
"""

from __future__ import annotations

import re
from importlib.metadata import Distribution, distributions


def size_mb(distribution: Distribution) -> float:
    """Returns the size of a distribution's files without compiled bytecode, MB (10^6 bytes)."""
    paths = [distribution.locate_file(name) for name in distribution.files or ()]
    return sum(p.stat().st_size for p in paths if p.is_file() and p.suffix != ".pyc") / 1e6


def requirers(found: list[Distribution]) -> dict[str, list[str]]:
    """Returns, for each normalized name, the distributions that require it without an extra."""
    table: dict[str, list[str]] = {}
    for distribution in found:
        for line in distribution.requires or ():
            if "extra ==" not in line:
                table.setdefault(normalized(re.match(r"[\w.-]+", line)[0]), []).append(
                    distribution.name
                )
    return table


def normalized(name: str) -> str:
    """Returns the form in which PyPI compares names."""
    return re.sub(r"[-_.]+", "-", name).lower()


def main() -> None:
    """Prints the table, the largest package first, and the sum."""
    found = list(distributions())
    required_by = requirers(found)
    sizes = sorted(((size_mb(each), each) for each in found), key=lambda pair: -pair[0])
    for size, each in sizes:
        needed = ", ".join(sorted(required_by.get(normalized(each.name), ())))
        print(f"{size:7.1f}  {f'{each.name} {each.version}':34}{needed}")
    print(f"{sum(size for size, _ in sizes):7.1f}  in {len(sizes)} packages")


if __name__ == "__main__":
    main()
