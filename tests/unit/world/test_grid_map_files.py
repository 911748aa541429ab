"""Grid maps from files: each format, which way up it is, and what is refused with which words."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from volery.core.errors import CommandError, DataFileError
from volery.scenario.access import SHIPPED_DATA
from volery.world.grid_maps import GridMap, read_cells
from volery.world.grid_maps.grid_map import MAX_CELLS
from volery.world.grid_maps.parsing import parse_cells

PATTERN = np.array([[1, 0, 0, 1], [0, 0, 1, 0], [1, 1, 0, 0]], dtype=bool)
"""Row 0: lowest y."""


def from_top(pattern=PATTERN):
    return pattern[::-1]


def as_csv(pattern):
    return "\n".join(",".join(str(int(c)) for c in row) for row in from_top(pattern)).encode()


def as_map(pattern):
    rows = "\n".join("".join("@" if c else "." for c in row) for row in from_top(pattern))
    height, width = pattern.shape
    return f"type octile\nheight {height}\nwidth {width}\nmap\n{rows}\n".encode()


def as_png(pattern, mode="L"):
    grey = np.where(from_top(pattern), 0, 255).astype(np.uint8)
    image = Image.fromarray(grey)
    if mode == "I;16":
        image = Image.fromarray(grey.astype(np.uint16) * 257)
    elif mode == "P":
        image = image.convert("RGB").quantize(2)
    elif mode == "alpha":  # all black, free where one sees through
        both = np.zeros((*grey.shape, 4), np.uint8)
        both[:, :, 3] = 255 - grey
        image = Image.fromarray(both)
    elif mode != "L":
        image = image.convert(mode)
    buffer = io.BytesIO()
    image.save(buffer, format="PNG")
    return buffer.getvalue()


def refused(data, suffix, *words):
    with pytest.raises(DataFileError) as caught:
        parse_cells(data, suffix, f"x{suffix}")
    message = str(caught.value)
    assert message.startswith(f"x{suffix}")
    assert all(word in message for word in words), message


@pytest.mark.parametrize(
    "text",
    [
        as_csv(PATTERN),
        as_csv(PATTERN).replace(b",", b", ") + b"\n\n",
        as_csv(PATTERN).replace(b",", b";"),
        as_csv(PATTERN).replace(b",", b" "),
        as_csv(PATTERN).replace(b",", b"\t"),
        as_csv(PATTERN).replace(b"\n", b",\r\n"),
        b"\xef\xbb\xbf" + as_csv(PATTERN),
        as_csv(PATTERN).replace(b"1", b"1.0e+00"),
        as_csv(PATTERN).replace(b"1", b"True").replace(b"0", b"False"),
        as_csv(PATTERN).replace(b",", b";").replace(b"1", b"1,0"),
        b"sep=;\r\n" + as_csv(PATTERN).replace(b",", b";"),
        b"# a map, 1 is blocked\n" + as_csv(PATTERN) + b"\n# end\n",
        b'"' + as_csv(PATTERN).replace(b",", b'","').replace(b"\n", b'"\n"') + b'"\n',
        as_csv(PATTERN).replace(b",", b"|"),
        as_csv(PATTERN).decode().encode("utf-16"),
    ],
)
def test_matrices_are_read_from_the_top(text):
    np.testing.assert_array_equal(parse_cells(text, ".csv", "x.csv"), PATTERN)


@pytest.mark.parametrize("mode", ["L", "1", "P", "RGB", "RGBA", "LA", "I;16", "alpha"])
def test_images_of_every_kind_are_read_from_the_top(mode):
    np.testing.assert_array_equal(parse_cells(as_png(PATTERN, mode), ".png", "x.png"), PATTERN)


def test_the_threshold_is_a_darkness():
    grey = Image.fromarray(np.array([[0, 100, 150, 255]], np.uint8))
    buffer = io.BytesIO()
    grey.save(buffer, format="PNG")
    read = [parse_cells(buffer.getvalue(), ".png", "x", t).tolist() for t in (0.3, 0.5, 0.9)]
    assert read == [
        [[True, True, True, False]],
        [[True, True, False, False]],
        [[True, *[False] * 3]],
    ]


def test_moving_ai_maps_are_read_from_the_top():
    np.testing.assert_array_equal(parse_cells(as_map(PATTERN), ".map", "x.map"), PATTERN)
    marked = b"\xef\xbb\xbf" + as_map(PATTERN)
    np.testing.assert_array_equal(parse_cells(marked, ".map", "x.map"), PATTERN)
    every = b"type octile\nwidth 7\nheight 1\nmap\n.GS@OTW"
    read = parse_cells(every, ".map", "x.map")
    assert read.tolist() == [[False] * 3 + [True] * 4]


def test_the_shipped_map_is_the_benchmark():
    cells = read_cells(SHIPPED_DATA / "gridmaps/random-32-32-10.map")
    assert cells.shape == (32, 32)
    assert cells.sum() == round(0.1 * 32 * 32)
    assert cells[31].nonzero()[0].tolist() == [7, 17, 18, 26]  # the first line: highest y


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", ["no row"]),
        (b"\n\n", ["no row"]),
        (b"0,1\n0,2\n", ["line 2, column 2", "'2'", "0 and 1"]),
        (b"sep=,\n0,1\n0,2\n", ["line 3, column 2", "'2'"]),
        (b"0,1\n#N/A,0\n", ["line 2, column 1", "'#N/A'"]),
        (b'""\n', ["line 1, column 1", "''"]),
        (b'"' + b"1" * 200_000 + b'"', ["line 1", "field limit"]),
        (b"0,1\n0,\n", ["line 2 has 1 entry", "2"]),
        (b"0,,1\n", ["line 1, column 2", "''"]),
        (b"0,1\n0,1,1\n", ["line 2 has 3"]),
        (b"0,nan\n", ["column 2", "nan"]),
        ("0,1\n0,ü".encode("latin-1"), ["line 2", "UTF-8", "0xfc"]),
        (b"x" * 5000, ["line 1, column 1", "'xxxxxxxxxxxxxxxxxxxx'"]),
    ],
)
def test_broken_matrices_are_refused(data, words):
    refused(data, ".csv", *words)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", ["line 1", "type octile"]),
        (b"type tile\nheight 1\nwidth 1\nmap\n.", ["line 1"]),
        (b"type octile\nheight 1\nheight 1\nmap\n.", ["0 x 1 cells"]),
        (b"type octile\nheight x\nwidth 1\nmap\n.", ["line 2", "height N"]),
        (b"type octile\nheight 0\nwidth 5\nmap\n", ["5 x 0 cells"]),
        (b"type octile\nheight 99999\nwidth 99999\nmap\n", ["cells; allowed are 1 to"]),
        (b"type octile\nheight 1\nwidth 1\nmpa\n.", ["line 4", "'map' is missing"]),
        (b"type octile\nheight 2\nwidth 2\nmap\n..\n", ["1 row after", "2"]),
        (b"type octile\nheight 2\nwidth 2\nmap\n..\n...\n", ["line 6 has 3 cells", "2"]),
        (b"type octile\nheight 1\nwidth 3\nmap\n.@x", ["line 5, column 3", "'x'"]),
    ],
)
def test_broken_moving_ai_maps_are_refused(data, words):
    refused(data, ".map", *words)


def test_broken_images_are_refused():
    good = as_png(PATTERN)
    refused(b"", ".png", "not a PNG")
    refused(b"GIF89a" + good, ".png", "not a PNG")
    refused(good[:40], ".png", "damaged")
    refused(good[:-30], ".png", "damaged")
    huge = bytearray(good)
    huge[16:24] = (60000).to_bytes(4) + (60000).to_bytes(4)
    refused(bytes(huge), ".png", "60000 x 60000 pixels")  # before any memory is taken
    none = bytearray(good)
    none[16:20] = bytes(4)
    refused(bytes(none), ".png", "0 x 3 pixels")


def test_files_are_refused_by_kind_and_absence(tmp_path):
    with pytest.raises(DataFileError, match=r"unknown grid map format '.jpg'.*\.csv, \.txt"):
        read_cells(tmp_path / "x.jpg")
    with pytest.raises(DataFileError, match="cannot be read"):
        read_cells(tmp_path / "x.csv")
    (tmp_path / "x.csv").mkdir()
    with pytest.raises(DataFileError, match="cannot be read"):
        read_cells(tmp_path / "x.csv")


@pytest.mark.parametrize(("suffix", "write"), [(".csv", as_csv), (".map", as_map)])
def test_large_text_is_read_at_once(suffix, write):
    cells = np.random.default_rng(1).random((700, 901)) < 0.3
    np.testing.assert_array_equal(parse_cells(write(cells), suffix, "x"), cells)


def test_sizes_that_cannot_be_are_refused():
    cells = np.zeros((2, 2), bool)
    assert GridMap("m", cells, 1.0, 1.0).bounds_of_blocks() is None
    for wrong in (
        {"blocked": np.zeros((0, 3), bool)},
        {"blocked": np.zeros(3, bool)},
        {"blocked": np.broadcast_to(False, (1, MAX_CELLS + 1))},
        {"cell_size_m": 0.0},
        {"cell_size_m": float("nan")},
        {"block_height_m": -1.0},
        {"block_height_m": float("inf")},
        {"origin_m": (float("nan"), 0.0)},
        {"origin_m": (0.0, 1e9)},
        {"yaw_rad": float("inf")},
    ):
        usual = {"name": "m", "blocked": cells, "cell_size_m": 1.0, "block_height_m": 1.0}
        with pytest.raises(CommandError, match="'m'"):
            GridMap(**{**usual, **wrong})
