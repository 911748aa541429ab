"""`volery examples`: lists the examples that come with Volery, copies them and runs them."""

from __future__ import annotations

import ast
import os
import runpy
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from volery.cli.error_reporting import guarded
from volery.cli.tables import print_table
from volery.cli.terminal import echo_line
from volery.core.errors import CommandError, VoleryError, reason_of
from volery.core.near_names import near_miss


@guarded
def examples(
    name: Annotated[
        str, typer.Argument(help="Example to copy: its name, a part of it or its number.")
    ] = "",
    arguments: Annotated[
        list[str] | None, typer.Argument(help="With --run: arguments of the example.")
    ] = None,
    run: Annotated[bool, typer.Option("--run", help="Run it instead of copying it.")] = False,
    to: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Copy it into this folder.")
    ] = None,
) -> None:
    """List the examples, or copy or run one."""
    if not name:
        if run:
            raise CommandError("--run needs the name of an example; `volery examples` lists them")
        rows = [(path.stem, _summary(path)) for path in all_examples()]
        print_table(("example", "what it does"), rows)
        echo_line("volery examples NAME copies one, volery examples NAME --run runs it", err=True)
        return
    path = find_example(name)
    if run:
        if to is not None:
            raise CommandError("--to copies an example, --run runs it: give one of them")
        _run(path, arguments or [])
        return
    if arguments:
        raise CommandError(f"arguments need --run: volery examples {name} --run ...")
    echo_line(_copy(path, to or Path()))


def all_examples() -> list[Path]:
    """Returns scripts, then folders, sorted by name. Raises `VoleryError` if there are none."""
    package = Path(__file__).parents[1]
    for folder in (package / "examples", package.parents[1] / "examples"):  # installed, in a clone
        scripts = sorted(folder.glob("[0-9]*.py"))
        if scripts:
            return [*scripts, *sorted(each for each in folder.iterdir() if _is_example(each))]
    raise VoleryError("the examples are missing; run `pip install --force-reinstall volery`")


def find_example(name: str) -> Path:
    """Returns an example by its name, without number or ending too, its number or a part.

    Raises `CommandError` unless exactly one has the name.
    """
    wanted = name.removesuffix(".py")
    paths = all_examples()
    exact = [path for path in paths if wanted in (path.stem, _without_number(path))]
    start = f"{int(wanted):02d}_" if wanted.isdecimal() else wanted
    found = exact or [path for path in paths if path.stem.startswith(start)]
    if not found and not wanted.isdecimal():
        found = [path for path in paths if wanted in path.stem]
    if len(found) != 1:
        names = ", ".join(path.stem for path in found or paths)
        if found:
            raise CommandError(f"'{name}' may be one of: {names}")
        hint = near_miss(wanted, map(_without_number, paths))
        raise CommandError(f"there is no example '{name}'{hint} Known: {names}")
    return found[0]


def _is_example(path: Path) -> bool:
    return path.is_dir() and not path.name.startswith(("_", "."))


def _without_number(path: Path) -> str:
    return path.stem.partition("_")[2] if path.stem[0].isdigit() else path.stem


def _summary(path: Path) -> str:
    if path.is_dir():
        return "files: " + ", ".join(sorted(each.name for each in path.iterdir() if each.is_file()))
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return text.partition("\n")[0]


def _run(path: Path, arguments: list[str]) -> None:
    """Runs an example as `python PATH ARGUMENT ...` does.

    Raises `CommandError` if it cannot run.
    """
    if path.is_dir():
        raise CommandError(
            f"{path.name} is a folder of files; copy it: volery examples {path.name}"
        )
    source = path.read_text(encoding="utf-8")
    if arguments and "sys.argv" not in source:
        raise CommandError(f"{path.stem} takes no arguments")
    missing = [name for name in _imports(source) if find_spec(name) is None]
    if missing:
        raise CommandError(
            f"{path.stem} needs {' and '.join(missing)}: pip install {' '.join(missing)}"
        )
    before = sys.argv, list(sys.path)
    sys.argv = [str(path), *arguments]
    sys.path.insert(0, str(path.parent))
    try:
        runpy.run_path(str(path), run_name="__main__")
    finally:
        sys.argv, sys.path[:] = before


def _imports(source: str) -> list[str]:
    """Returns the top-level packages that a script imports, sorted."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.partition(".")[0])
    return sorted(names)


def _copy(path: Path, folder: Path) -> str:
    target = folder / path.name
    if os.path.lexists(target):
        raise CommandError(f"{target}: exists already; choose another folder with --to")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if path.is_dir():
            shutil.copytree(path, target, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copyfile(path, target)
    except OSError as error:
        raise VoleryError(f"{target}: cannot be written: {reason_of(error)}") from None
    return str(target)
