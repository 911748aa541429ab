"""Actors: people, vehicles and birds that move independently; their shapes and motions."""

from __future__ import annotations

from volery.world.actors.moving import MovingActor, MovingActors
from volery.world.actors.shapes import SHAPES

__all__ = ["SHAPES", "MovingActor", "MovingActors"]
