"""AprilTags: their code words, cells and shape.

Frame of a tag, FLU: the origin is on the ground below the centre, z points out of the printed face,
x to the top of the image and y to its left. The face is `FACE_M` above the origin.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.world.actors.primitives import box
from volery.world.materials import Material
from volery.world.mesh import Mesh, concatenate
from volery.world.scene_content import BodyShape

CELLS = 8
"""Cells along a side of a tag of family 36h11: 6 of the code, and the black border's 2."""
BOARD_FRACTION = 10.0 / CELLS
"""Side of the board, by that of the tag: the white border is one cell wide."""
FACE_M = 0.005
"""Height of the printed face above the tag's origin, m: thickness of the board."""
_BOARD_TOP_M, _INK_BOTTOM_M = 0.003, 0.004
_CODE_CELLS = 6


@cache
def code_words() -> tuple[int, ...]:
    """Returns the code words of family 36h11 by id, 36 bits each; see `tag36h11.txt`."""
    text = Path(__file__).with_name("tag36h11.txt").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return tuple(int(word, 16) for word in " ".join(lines).split())


def tag_cells(tag_id: int) -> NDArray[np.bool_]:
    """Returns (8, 8) whether cells are white, row by row from the top left of the image.

    Raises `IndexError` for an unknown id.
    """
    word = code_words()[tag_id]
    bits = [(word >> k) & 1 for k in reversed(range(_CODE_CELLS**2))]
    cells = np.zeros((CELLS, CELLS), np.bool_)
    cells[1:-1, 1:-1] = np.array(bits, np.bool_).reshape(_CODE_CELLS, _CODE_CELLS)
    return cells


def tag_corners(size_m: float) -> Array:
    """Returns the corners (4, 3) m of the black border in the tag's frame.

    Order: top left, top right, bottom right, bottom left of the image, as OpenCV's detector.
    """
    half = 0.5 * size_m
    flat = np.array([[half, half], [half, -half], [-half, -half], [-half, half]])
    return np.column_stack([flat, np.full(4, FACE_M)])


def tag_shape(tag_id: int, size_m: float) -> BodyShape:
    """Returns a white board with black cells; size_m: outer side of the black border."""
    half = 0.5 * BOARD_FRACTION * size_m
    board = box([-half, -half, 0.0], [half, half, _BOARD_TOP_M])
    ink = concatenate(_ink(~tag_cells(tag_id), size_m / CELLS))
    return BodyShape(((board, Material.PRINT_WHITE), (ink, Material.PRINT_BLACK)))


def _ink(black: NDArray[np.bool_], cell_m: float) -> list[Mesh]:
    """Returns a plate for each run of black cells of a row."""
    plates = []
    for row, cells in enumerate(black):
        x = (0.5 * CELLS - row) * cell_m
        edges = np.flatnonzero(np.diff(np.concatenate([[False], cells, [False]])))
        for first, last in edges.reshape(-1, 2).tolist():
            left, right = ((0.5 * CELLS - column) * cell_m for column in (first, last))
            plates.append(box([x - cell_m, right, _INK_BOTTOM_M], [x, left, FACE_M]))
    return plates
