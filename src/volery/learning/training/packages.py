"""Checks that the packages of training are installed."""

from __future__ import annotations

import importlib

from volery.core.errors import VoleryError
from volery.core.extras import missing_package

_PACKAGES = (
    ("torch", "torch"),
    ("tensorboard", "tensorboard"),
    ("stable_baselines3", "stable-baselines3"),
)


def require_training() -> None:
    """Raises `VoleryError` with the command that installs what training lacks."""
    for module, package in _PACKAGES:
        try:
            importlib.import_module(module)
        except ImportError:
            raise VoleryError(missing_package("training", package, "train")) from None
