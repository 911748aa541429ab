"""Errors of studies."""

from __future__ import annotations

from volery.core.errors import VoleryError


class StudyError(VoleryError):
    """A study cannot be loaded or run; the message names file, key and allowed values."""
