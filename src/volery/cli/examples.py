"""`volery examples`: lists the examples that come with Volery, copies them and runs them."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

from volery.cli.error_reporting import guarded
from volery.cli.tables import print_table
from volery.cli.terminal import echo_line
from volery.core.errors import CommandError, VoleryError, reason_of


@guarded
def examples(
    name: Annotated[
        str, typer.Argument(help="Example to copy: its name, the start of it or its number.")
    ] = "",
    arguments: Annotated[
        list[str] | None, typer.Argument(help="With --run: arguments of the example.")
    ] = None,
    run: Annotated[bool, typer.Option("--run", help="Run it instead of copying it.")] = False,
    to: Annotated[Path, typer.Option(metavar="DIR", help="Copy it into this folder.")] = Path(),
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
    if not run:
        if arguments:
            raise CommandError(f"arguments need --run: volery examples {name} --run ...")
        echo_line(_copy(path, to))
        return
    if path.is_dir():
        raise CommandError(
            f"{path.name} is a folder of files; copy it: volery examples {path.name}"
        )
    command = [sys.executable, str(path), *(arguments or ())]
    code = subprocess.run(command, check=False).returncode
    if code:
        raise typer.Exit(code)


def all_examples() -> list[Path]:
    """Returns scripts, then folders, sorted by name. Raises `VoleryError` if there are none."""
    package = Path(__file__).parents[1]
    for folder in (package / "examples", package.parents[1] / "examples"):  # installed, in a clone
        scripts = sorted(folder.glob("[0-9]*.py"))
        if scripts:
            return [*scripts, *sorted(each for each in folder.iterdir() if _is_example(each))]
    raise VoleryError("the examples are missing; run `pip install --force-reinstall volery`")


def find_example(name: str) -> Path:
    """Returns an example by its name, with or without number and ending, or by its number.

    Raises `CommandError` unless exactly one has the name.
    """
    wanted = name.removesuffix(".py")
    paths = all_examples()
    exact = [path for path in paths if wanted in (path.stem, _without_number(path))]
    start = f"{int(wanted):02d}_" if wanted.isdecimal() else wanted
    found = exact or [path for path in paths if path.stem.startswith(start)]
    if len(found) != 1:
        names = ", ".join(path.stem for path in found or paths)
        which = f"'{name}' may be one of" if found else f"there is no example '{name}'; known"
        raise CommandError(f"{which}: {names}")
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
