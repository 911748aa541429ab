"""Maps of ROS' map_server as worlds: pose, thresholds, modes, and those that Volery writes."""

import numpy as np
import pytest
from PIL import Image

from volery.autonomy.mapping.grid_files import write_grid
from volery.core.errors import DataFileError
from volery.runtime.construction.grid_map import starting_grid_map
from volery.scenario.load import parse_scenario
from volery.world.grid_maps import read_cells, read_map_server

KEYS = {
    "image": "room.pgm",
    "resolution": "0.5",
    "origin": "[-1.0, -2.0, 0.5]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}
PIXELS = np.array([[254, 0, 205], [205, 254, 0]], np.uint8)
"""Free, occupied and unknown as map_saver writes them; row 0: the top."""


@pytest.fixture
def write(tmp_path):
    """Write a map with changed keys and pixels; returns the path of its .yaml."""

    def write(pixels=PIXELS, image="room.pgm", **changes):
        Image.fromarray(pixels).save(tmp_path / image)
        keys = {**KEYS, "image": image, **changes}
        text = "".join(f"{key}: {value}\n" for key, value in keys.items() if value is not None)
        path = tmp_path / "room.yaml"
        path.write_text(text, encoding="utf-8-sig")
        return path

    return write


def test_pose_and_cells(write):
    file = read_map_server(write())
    assert (file.cell_m, file.origin_m, file.yaw_rad) == (0.5, (-1.0, -2.0), 0.5)
    assert file.blocked.tolist() == [[False, False, True], [False, True, False]]
    assert file.unknown.tolist() == [[True, False, False], [False, False, True]]


@pytest.mark.parametrize("image", ["room.png", "room.bmp", "room.pgm"])
def test_images_of_three_formats(write, image):
    assert read_map_server(write(image=image)).blocked.sum() == 2


def test_text_and_deep_images(write, tmp_path):
    path = write()
    (tmp_path / "room.pgm").write_text("P2\n# a comment\n3 2\n255\n254 0 205\n205 254 0\n")
    np.testing.assert_array_equal(read_map_server(path).blocked[::-1], PIXELS == 0)
    deep = b"P5 3 2 65535\n" + (PIXELS.astype(">u2") * 257).tobytes()
    (tmp_path / "room.pgm").write_bytes(deep)
    np.testing.assert_array_equal(read_map_server(path).blocked[::-1], PIXELS == 0)
    np.testing.assert_array_equal(read_map_server(path).unknown[::-1], PIXELS == 205)
    np.testing.assert_array_equal(read_cells(tmp_path / "room.pgm")[::-1], PIXELS == 0)


def test_thresholds_negation_and_modes(write):
    shades = np.array([[0, 60, 128, 200, 255]], np.uint8)
    dark = {"occupied_thresh": "0.6", "free_thresh": "0.3"}

    def cells(**changes):
        file = read_map_server(write(shades, **changes))
        return "".join("#" if b else "?" if u else "." for b, u in zip(
            file.blocked[0], file.unknown[0], strict=True))  # fmt: skip

    assert cells(**dark) == "##?.."
    assert cells(**dark, negate="1") == "..?##"
    assert cells(**dark, mode="scale") == "###.."  # .498 is 66 of 100
    assert cells(mode="raw") == ".#???"  # values of occupancy
    assert cells(occupied_thresh=None, free_thresh=None, negate=None) == "##?.."


@pytest.mark.parametrize("negate", ["1", '"1"', "yes", "True"])
def test_numbers_in_quotes_and_words_of_yaml(write, negate):
    file = read_map_server(write(negate=negate, occupied_thresh='"0.65"', resolution="'0.25'"))
    np.testing.assert_array_equal(file.blocked[::-1], PIXELS > 200)
    assert file.cell_m == 0.25


def test_colours_are_as_dark_as_for_map_server(write):
    """Green: a mean of 1/3, but 59 % of the luminance."""
    green = np.zeros((1, 1, 3), np.uint8)
    green[0, 0, 1] = 255
    assert read_map_server(write(green, "room.png")).blocked.all()


def test_a_yaml_file_in_utf_16(write):
    path = write()
    path.write_text(path.read_text("utf-8-sig"), encoding="utf-16")
    assert read_map_server(path).blocked.any()


def test_transparent_pixels_are_unknown(write):
    shades = np.zeros((1, 2, 4), np.uint8)
    shades[0, 0, 3] = 255
    file = read_map_server(write(shades, "room.png"))
    assert file.blocked.tolist() == [[True, False]]
    assert file.unknown.tolist() == [[False, True]]


def test_an_image_named_by_the_path_of_another_machine_lies_beside(write):
    assert read_map_server(write().with_name("room.yaml")).blocked.any()
    path = write()
    path.write_text(path.read_text().replace("room.pgm", "/home/me/maps/room.pgm"))
    assert read_map_server(path).blocked.any()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"resolution": "0"}, r"resolution is 0; allowed are 0\.001 to 1000"),
        ({"resolution": None}, "resolution is missing"),
        ({"origin": "[0, 0, .nan]"}, "origin must be"),
        ({"origin": None}, "origin must be"),
        ({"mode": "fuzzy"}, "mode is 'fuzzy'; allowed are trinary, scale, raw"),
        ({"free_thresh": "0.9"}, r"free_thresh is 0\.9; it must be below occupied_thresh, 0\.65"),
        ({"occupied_thresh": "65"}, "occupied_thresh is 65; allowed are 0 to 1"),
    ],
)
def test_wrong_keys_are_named(write, changes, message):
    with pytest.raises(DataFileError, match=message):
        read_map_server(write(**changes))


def test_files_that_are_no_maps_are_one_error(write, tmp_path):
    path = write()
    (tmp_path / "room.pgm").write_bytes(b"P5\n60000 60000\n255\n")
    with pytest.raises(DataFileError, match="too many pixels"):
        read_map_server(path)
    (tmp_path / "room.pgm").write_bytes(b"P5\n9000 6000\n255\n")
    with pytest.raises(DataFileError, match="9000 x 6000 pixels"):
        read_map_server(path)
    (tmp_path / "room.pgm").write_bytes(b"P5\n3 2\n255\n\0")
    with pytest.raises(DataFileError, match=r"room\.pgm: the image is damaged"):
        read_map_server(path)
    (tmp_path / "room.pgm").write_bytes(b"GIF89a")
    with pytest.raises(DataFileError, match="not PPM or PNG or BMP"):
        read_map_server(path)
    (tmp_path / "room.pgm").unlink()
    with pytest.raises(DataFileError, match=r"no image 'room\.pgm' in its folder"):
        read_map_server(path)
    for text in ("a: [", "- 1", "", "&a [*a"):
        path.write_text(text)
        with pytest.raises(DataFileError, match=r"room\.yaml"):
            read_map_server(path)
    with pytest.raises(DataFileError, match="cannot be read"):
        read_map_server(tmp_path / "none.yaml")


def world(path, **more):
    return parse_scenario(
        {
            "name": "room",
            "world": {"grid_map": {"maps": [{"file": str(path)}], "cell_size_m": 0.05, **more}},
            "types": {"a": {}},
            "uavs": [{"type": "a", "position_m": [0.0, 0.0]}],
        }
    )


def test_a_scenario_has_the_map_where_the_file_says(write):
    grid = starting_grid_map(world(write()))
    assert (grid.name, grid.cell_size_m, grid.origin_m, grid.yaw_rad) == (
        "room", 0.5, (-1.0, -2.0), 0.5)  # fmt: skip
    assert grid.blocked.sum() == 2
    assert starting_grid_map(world(write(), unknown_is_blocked=True)).blocked.sum() == 4


def test_maps_that_slam_writes_come_back(tmp_path):
    values = np.array([[0, 100, -1], [100, 0, 0], [-1, 0, 100]], np.int8)
    write_grid(tmp_path / "map", values, np.array([-3.25, 4.5]), 0.05)
    file = read_map_server(tmp_path / "map.yaml")
    np.testing.assert_array_equal(file.blocked, values == 100)
    np.testing.assert_array_equal(file.unknown, values == -1)
    assert (file.cell_m, file.origin_m, file.yaw_rad) == (0.05, (-3.25, 4.5), 0.0)
