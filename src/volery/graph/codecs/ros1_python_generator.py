"""Creates Python modules of the ROS 1 packages next to this file, without catkin.

    python3 generate_python.py

The program needs Debian's python3-genpy and the definitions that the packages use (ros-std-msgs,
ros-geometry-msgs), and writes into the folder `python`. With the paths that it prints, rostopic,
rosservice and rospy know the types.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any


def main(folder: Path) -> None:
    """Generates the modules of all packages in `folder`; ends the program on an error."""
    genpy = importlib.import_module("genpy.generator")
    initpy = importlib.import_module("genpy.generate_initpy")
    genmsg = importlib.import_module("genmsg")
    packages = {found.parent.name: found.parent for found in folder.glob("*/package.xml")}
    search = {name: [str(path / "msg")] for name, path in {**_installed(), **packages}.items()}
    generators = {"msg": genpy.MsgGenerator(), "srv": genpy.SrvGenerator()}
    for name, path in sorted(packages.items()):
        for kind, generator in generators.items():
            files = sorted(str(file) for file in (path / kind).glob(f"*.{kind}"))
            if not files:
                continue
            out = folder / "python" / name / kind
            out.mkdir(parents=True, exist_ok=True)
            (out.parent / "__init__.py").touch()
            try:
                failed = generator.generate_messages(name, files, str(out), search)
            except (genmsg.InvalidMsgSpec, genmsg.MsgGenerationException) as error:
                sys.exit(f"{name}: {error}")
            if failed:
                sys.exit(f"{name}: genpy cannot create its {kind} modules")
            initpy.write_modules(str(out))
    sys.stdout.write(f"export PYTHONPATH={folder / 'python'}:$PYTHONPATH\n")
    sys.stdout.write(f"export ROS_PACKAGE_PATH={folder}:/usr/share\n")


def _installed() -> dict[str, Path]:
    """Returns the folders of the installed packages by name."""
    rospack: Any = importlib.import_module("rospkg").RosPack()
    return {name: Path(rospack.get_path(name)) for name in rospack.list()}


if __name__ == "__main__":
    main(Path(__file__).resolve().parent)
