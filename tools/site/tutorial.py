"""Runs the code blocks of a tutorial, as a reader does.

    python tools/site/tutorial.py docs/tutorials/first_flight.md FOLDER

A block with a title is a file, written into the folder. `python` blocks without a title are one
program, and `sh` blocks are commands; both run in the order of the page. Blocks titled `Terminal 1`
and `Terminal 2` run side by side. Commands of `volery` and `python` are those of this interpreter.
"""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

_BLOCK = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_TITLE = re.compile(r'title="([^"]+)"')


@dataclass(frozen=True)
class Block:
    """A code block: its language, its title (empty: none) and its text."""

    language: str
    title: str
    text: str

    @property
    def is_terminal(self) -> bool:
        """Whether the commands run side by side with those of other terminals."""
        return self.title.startswith("Terminal")


def blocks(page: Path) -> list[Block]:
    """Returns the code blocks of a page."""
    found = _BLOCK.findall(page.read_text(encoding="utf-8"))
    return [
        Block(language, "".join(_TITLE.findall(options)), text) for language, options, text in found
    ]


def run(page: Path, folder: Path, replaced: Mapping[str, str] | None = None) -> str:
    """Runs a page's code in `folder` and returns its output; raises `RuntimeError` if it fails.

    `replaced` holds texts of commands and what stands in for them, such as free ports.
    """
    program = _program(blocks(page), folder, dict(replaced or {}))
    environment = {**os.environ, "MPLBACKEND": "Agg", "PYTHONWARNINGS": "error"}
    done = subprocess.run(
        [sys.executable, "-c", program],
        check=False,
        cwd=folder,
        capture_output=True,
        text=True,
        env=environment,
    )
    if done.returncode:
        raise RuntimeError(f"{page.name}:\n{done.stdout}{done.stderr}")
    return done.stdout


def _program(parts: list[Block], folder: Path, replaced: dict[str, str]) -> str:
    lines = ["import subprocess as _subprocess"]
    terminals: list[list[str]] = []
    for block in parts:
        if terminals and not block.is_terminal:
            lines.append(_together(terminals))
            terminals = []
        if block.title and not block.is_terminal:
            (folder / block.title).write_text(block.text, encoding="utf-8")
        elif block.language == "python":
            lines.append(block.text)
        elif block.is_terminal:
            terminals += _commands(block.text, replaced)
        elif block.language == "sh":
            lines += [
                f"_subprocess.run({command!r}, check=True)"
                for command in _commands(block.text, replaced)
            ]
    if terminals:
        lines.append(_together(terminals))
    return "\n".join(lines)


def _together(commands: list[list[str]]) -> str:
    """Starts all commands; where the first one ends, Ctrl-C ends the others."""
    return (
        f"_first, *_others = [_subprocess.Popen(_c) for _c in {commands!r}]\n"
        "assert _first.wait() == 0, 'the first terminal failed'\n"
        "for _other in _others:\n"
        f"    _other.send_signal({int(signal.SIGINT)})\n"
        "    _other.wait(30)"
    )


def _commands(text: str, replaced: dict[str, str]) -> list[list[str]]:
    commands = []
    for line in text.splitlines():
        for old, new in replaced.items():
            line = line.replace(old, new)  # noqa: PLW2901
        words = shlex.split(line, comments=True)
        if words[:1] == ["volery"]:
            commands.append([sys.executable, "-m", "volery", *words[1:]])
        elif words[:1] == ["python"]:
            commands.append([sys.executable, *words[1:]])
    return commands


if __name__ == "__main__":
    print(run(Path(sys.argv[1]), Path(sys.argv[2])), end="")
