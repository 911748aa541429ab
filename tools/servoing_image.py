"""Draws `docs/pictures/servoing.jpg`: what the camera of the scenario `servoing` sees.

    python tools/servoing_image.py

Detected tags are outlined; the green dot is the top left corner of the tag's picture.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from volery.autonomy.perception.tags.detector import TagDetector, grey_of
from volery.graph.messages import Published
from volery.runtime.simulation import Simulation
from volery.scenario.load import load_scenario

DURATION_S = 4.0
NUMBER = 3
GAP = 6
TARGET = Path(__file__).parents[1] / "docs" / "pictures" / "servoing.jpg"


def main() -> None:
    """Flies the scenario and writes the picture."""
    images: list[np.ndarray] = []

    def keep(published: Published) -> None:
        image = published.message
        images.append(np.array(image.data).reshape(image.height, image.width, 3))

    with Simulation(load_scenario("servoing")) as simulation:
        simulation.graph.subscribe("/uav1/down/image_raw", keep)
        simulation.run(DURATION_S)
    detector = TagDetector()
    with_tag = [pixels for pixels in images if detector.detect(grey_of(pixels))]
    chosen = np.linspace(0, len(with_tag) - 1, NUMBER).round().astype(int)
    seen = [outlined(with_tag[k]) for k in chosen.tolist()]
    width = sum(one.width for one in seen) + GAP * (len(seen) - 1)
    whole = Image.new("RGB", (width, seen[0].height), "white")
    for k, one in enumerate(seen):
        whole.paste(one, (k * (one.width + GAP), 0))
    whole.save(TARGET, quality=88)


def outlined(pixels: np.ndarray) -> Image.Image:
    """Returns an image (height, width, 3) with its tags outlined."""
    picture = Image.fromarray(pixels)
    draw = ImageDraw.Draw(picture)
    for tag in TagDetector().detect(grey_of(pixels)):
        corners = [tuple(corner) for corner in tag.corners_px.tolist()]
        draw.line([*corners, corners[0]], fill="red", width=2)
        x, y = corners[0]
        draw.ellipse([x - 4, y - 4, x + 4, y + 4], fill="lime")
    return picture


if __name__ == "__main__":
    main()
