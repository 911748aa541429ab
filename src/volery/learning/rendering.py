"""What environments answer to requests for images of themselves: they do not render."""

from __future__ import annotations

import gymnasium

from volery.core.errors import ScenarioError

_INSTEAD = "volery.learning.training.video.film_episode films an episode"


class RenderingError(ScenarioError, TypeError):
    """An environment is made with a render mode, which it does not have.

    It is a `TypeError` as well, by which training libraries recognise environments that take no
    `render_mode`: stable-baselines3 makes them without one.
    """


def refuse_rendering(render_mode: str | None) -> None:
    """Raises `RenderingError` for a `render_mode` other than None."""
    if render_mode is not None:
        raise RenderingError(
            f"render_mode = {render_mode!r}: these environments do not render, only None is "
            f"possible; {_INSTEAD}"
        )


def render_nothing() -> None:
    """Warns, as Gymnasium's environments without a render mode, that there is no image."""
    gymnasium.logger.warn(
        f"render() returns no image: these environments do not render; {_INSTEAD}"
    )
