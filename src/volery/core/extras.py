"""Imports packages of Volery's extras; the errors say what to install."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from volery.core.errors import VoleryError


def missing_package(what: str, package: str, extra: str) -> str:
    """Returns the sentence with the command that installs the package."""
    return f'{what} needs {package}: pip install "volery[{extra}]"'


def import_extra(
    what: str, module: str, package: str, extra: str, error_type: type[VoleryError] = VoleryError
) -> Any:
    """Imports a module of an extra's package, which `what` needs.

    Raises `error_type` with the command that installs the package or, where it is installed but
    does not load, with the reason, such as a missing library of the system.
    """
    try:
        return import_module(module)
    except Exception as error:  # packages of other versions raise anything
        absent = isinstance(error, ModuleNotFoundError) and f"{module}.".startswith(
            f"{error.name}."
        )
        if absent:
            raise error_type(missing_package(what, package, extra)) from None
        reason = str(error).strip().partition("\n")[0] or type(error).__name__
        raise error_type(
            f"{what} needs {package}, which is installed but cannot be imported: {reason}"
        ) from None
