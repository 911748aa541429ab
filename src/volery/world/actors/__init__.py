"""What moves through a world by itself: people, vehicles, birds; their shapes and their ways."""

from __future__ import annotations

from volery.world.actors.moving import MovingActor, MovingActors
from volery.world.actors.shapes import SHAPES

__all__ = ["SHAPES", "MovingActor", "MovingActors"]
