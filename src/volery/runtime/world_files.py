"""Where the data files of worlds lie."""

from __future__ import annotations

from pathlib import Path

SHIPPED_DATA = Path(__file__).resolve().parent.parent / "world" / "data"
"""Folder of those that ship."""
