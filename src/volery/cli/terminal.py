"""Prints text on a terminal; what acts on it, as names of logs and clients may, is spelled out."""

from __future__ import annotations

import typer

from volery.core.plain_text import plain


def echo_line(text: str = "", *, err: bool = False) -> None:
    """Prints a line on stdout, or on stderr."""
    typer.echo(plain(text), err=err)


def echo_lines(text: str, *, err: bool = False) -> None:
    """Prints a text of several lines, whose foreign parts cannot hold new lines."""
    typer.echo(plain(text, "\n\t"), err=err)
