"""`volery doctor`: checks whether this machine can run flights; each problem comes with its fix."""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from volery.cli.terminal import echo_line
from volery.core.plurals import counted

_PYTHON = (3, 11)
_MEMORY_GIB = 2.0
_DISK_GIB = 1.0
_CORES = 2


class UnfitError(Exception):
    """Reports a failed check; its text says how to fix the problem."""


@dataclass(frozen=True)
class Check:
    """Describes one check: `examine` returns what it found, or raises `UnfitError` with the fix."""

    name: str
    examine: Callable[[], str]
    essential: bool = True


def examine() -> bool:
    """Runs all checks, prints one line each; returns whether all essential checks passed."""
    fit = True
    for check in CHECKS:
        try:
            echo_line(f"ok    {check.name}: {check.examine()}")
        except Exception as error:  # a broken installation may raise anything
            reason = str(error) if isinstance(error, UnfitError) else f"{error!r}"
            fit = fit and not check.essential
            echo_line(f"{'MEND' if check.essential else 'note'}  {check.name}: {reason}")
    echo_line("ready to fly" if fit else "not fit to fly: mend the lines marked MEND")
    return fit


def _python() -> str:
    found = ".".join(str(part) for part in sys.version_info[:3])
    if sys.version_info < _PYTHON:
        raise UnfitError(f"{found} is too old; install Python 3.11 or newer")
    return found


def _packages() -> str:
    from importlib.metadata import PackageNotFoundError, requires, version

    from packaging.requirements import Requirement

    wrong = []
    names = []
    for text in requires("volery") or ():
        requirement = Requirement(text)
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": ""}):
            continue
        try:
            found = version(requirement.name)
        except PackageNotFoundError:
            wrong.append(f"{requirement.name} is missing")
            continue
        names.append(requirement.name)
        if not requirement.specifier.contains(found, prereleases=True):
            wrong.append(f"{requirement.name} is {found}, not {requirement.specifier}")
    if wrong:
        raise UnfitError(f"{'; '.join(wrong)}; run `pip install --upgrade volery`")
    return ", ".join(names)


def _kernels() -> str:
    from volery.core import compiled

    folder = compiled.cache_dir()
    if tempfile.gettempdir() in str(folder) and "volery-kernels" in str(folder):
        raise UnfitError(
            f"compiled kernels are in the temporary folder {folder}: make ~/.cache writable or "
            "set VOLERY_CACHE_DIR to a writable folder"
        )
    count = sum(1 for _ in folder.rglob("*.nbc"))
    state = counted(count, "compiled kernel") if count else "empty, the first run compiles"
    return f"{folder} ({state})"


def _compiler() -> str:
    from importlib.metadata import version

    from volery.core.rng import normal_quantile

    if abs(normal_quantile(0.975) - 1.959964) > 1e-5:
        raise UnfitError("numba compiles wrongly here; run `pip install --force-reinstall numba`")
    return f"numba {version('numba')} compiles"


def _embree() -> str:
    from importlib.metadata import version

    from volery.world import embree

    try:
        embree.load()
        device = embree.Device()
        try:
            embree.self_test(device)
        finally:
            device.close()
    except embree.EmbreeError as error:
        raise UnfitError(str(error)) from None
    return f"library of embreex {version('embreex')} loads and hits a triangle"


def _scenarios() -> str:
    from volery.core.errors import VoleryError
    from volery.scenario import library
    from volery.scenario.load import load_scenario

    try:
        names = [load_scenario(name).name for name in library.names()]
    except VoleryError as error:
        raise UnfitError(f"{error}; run `pip install --force-reinstall volery`") from None
    if not names:
        raise UnfitError("none are installed; run `pip install --force-reinstall volery`")
    return ", ".join(names)


def _extras() -> str:
    from volery.core.errors import VoleryError
    from volery.scenario import library
    from volery.scenario.load import load_scenario
    from volery.scenario.node_packages import check_packages

    lacking = []
    for name in library.names():
        try:
            scenario = load_scenario(name)
        except VoleryError:
            continue  # the check of scenarios reports it
        try:
            check_packages(scenario)
        except VoleryError as error:
            reason = str(error).removeprefix(f"{name}: ")
            lacking.append(f"{name} does not start: {reason}")
    if lacking:
        raise UnfitError("; ".join(lacking))
    return "all shipped scenarios have the packages that they need"


def _forests() -> str:
    from volery import world

    folder = Path(world.__file__).parent / "data" / "forests"
    wanted = ("bei_trees.csv", "bei_elevation.csv", "longleaf_trees.csv")
    missing = [name for name in wanted if not (folder / name).is_file()]
    if missing:
        raise UnfitError(
            f"{', '.join(missing)} missing in {folder}; run `pip install --force-reinstall volery`"
        )
    return f"{len(wanted)} data files"


def _cores() -> str:
    from volery.core.machine import usable_cores

    cores = usable_cores()
    if cores < _CORES:
        raise UnfitError(f"{cores} usable; flights run, but large fleets need {_CORES} or more")
    return f"{cores} usable"


def _memory() -> str:
    from volery.core.machine import memory_bytes

    gib = memory_bytes() / 2**30
    if gib < _MEMORY_GIB:
        raise UnfitError(f"{gib:.1f} GiB; forests need {_MEMORY_GIB:g} GiB: use a smaller one")
    return f"{gib:.1f} GiB"


def _disk() -> str:
    gib = shutil.disk_usage(Path.cwd()).free / 2**30
    if gib < _DISK_GIB:
        raise UnfitError(f"{gib:.2f} GiB free here; logs need {_DISK_GIB:g} GiB: free some space")
    return f"{gib:.1f} GiB free here"


CHECKS = (
    Check("Python", _python),
    Check("packages", _packages),
    Check("compiler", _compiler),
    Check("kernel cache", _kernels, essential=False),
    Check("Embree", _embree, essential=False),
    Check("scenarios", _scenarios),
    Check("extras", _extras, essential=False),
    Check("forest data", _forests),
    Check("cores", _cores, essential=False),
    Check("memory", _memory, essential=False),
    Check("disk", _disk, essential=False),
)
