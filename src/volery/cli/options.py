"""An option whose value may be left away."""

from __future__ import annotations

from typing import Any

from typer.core import TyperCommand


class PageCommand(TyperCommand):
    """A command that takes `--page` as well as `--page=HOST:PORT`; typer knows only the latter."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """As of typer, for the words of the command line."""
        return super().parse_args(ctx, ["--page=" if word == "--page" else word for word in args])
