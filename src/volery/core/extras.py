"""What an error says where a package of one of Volery's extras is not installed."""

from __future__ import annotations


def missing_package(what: str, package: str, extra: str) -> str:
    """Return the sentence with the command that installs the package."""
    return f'{what} needs {package}: pip install "volery[{extra}]"'
