"""Formats errors about missing packages of Volery's extras."""

from __future__ import annotations


def missing_package(what: str, package: str, extra: str) -> str:
    """Returns the sentence with the command that installs the package."""
    return f'{what} needs {package}: pip install "volery[{extra}]"'
