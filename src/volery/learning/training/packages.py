"""Checks that the packages of training are installed."""

from __future__ import annotations

from volery.core.extras import import_extra

_PACKAGES = (
    ("torch", "torch"),
    ("tensorboard", "tensorboard"),
    ("stable_baselines3", "stable-baselines3"),
)


def require_training() -> None:
    """Raises `VoleryError` with the command that installs what training lacks."""
    for module, package in _PACKAGES:
        import_extra("training", module, package, "train")
