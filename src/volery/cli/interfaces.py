"""`volery interfaces`: writes message types as packages for ROS tools."""

from __future__ import annotations

from pathlib import Path

from volery.cli.terminal import echo_line
from volery.core.errors import VoleryError
from volery.graph.codecs.interface_packages import (
    OWN,
    needs,
    packages,
    write_generator,
    write_package,
)


def write_and_report(folder: Path, names: list[str], *, overwrite: bool, ros1: bool) -> None:
    """Writes packages into a folder of a workspace and prints what they need."""
    if not folder.is_dir():
        raise VoleryError(f"{folder}: no such folder; create it with `mkdir -p {folder}`")
    wanted = list(dict.fromkeys(names)) or [OWN]
    for name in wanted:
        echo_line(str(write_package(name, folder, overwrite=overwrite, ros1=ros1)))
    needed = sorted({other for name in wanted for other in needs(name, ros1=ros1)} - set(wanted))
    if needed:
        echo_line(f"needs   {', '.join(needed)}")
    ours = [name for name in needed if name in packages()]
    if ours:
        echo_line(
            f"Where your ROS {1 if ros1 else 2} lacks {' or '.join(ours)}: --package writes what "
            "Volery knows of it"
        )
    if ros1:
        echo_line(f"Without catkin: python3 {write_generator(folder)} makes Python modules")
