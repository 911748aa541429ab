"""What moves through a world by itself: people, vehicles, birds; their shapes and their ways."""

from __future__ import annotations

from volery.world.things.moving import MovingThings, Thing
from volery.world.things.shapes import SHAPES

__all__ = ["SHAPES", "MovingThings", "Thing"]
