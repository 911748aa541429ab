"""Writes the reference of the command line from its own description."""

from __future__ import annotations

import html
import re

import typer
from typer.cli import get_docs_for_click
from typer.main import get_command

from volery.cli.app import app

_HEAD = """\
# Command line

`volery COMMAND --help` prints the same in a terminal.
"""


def page() -> str:
    """Returns the page."""
    command = get_command(app)
    context = typer.Context(command, info_name="volery")
    text = get_docs_for_click(obj=command, ctx=context, name="volery")
    text = html.unescape(text).partition("\n")[2]
    for name, each in command.commands.items():  # whole sentences, with links
        summary = " ".join((each.help or "").partition("\n\n")[0].split())
        line = f"* [`{name}`](#volery-{name}): {summary}"
        text = re.sub(rf"^\* `{name}`: .*$", line, text, count=1, flags=re.MULTILINE)
    return _HEAD + re.sub(r"\n{3,}", "\n\n", text).rstrip() + "\n"


if __name__ == "__main__":
    print(page(), end="")
