"""OctoMaps: their bytes, their files, what rays draw into them, merging."""

import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.autonomy.mapping.map_files import MapLimits, node_count, read_map, write_map
from volery.autonomy.mapping.merging import PlacedMap, encode_cells, merged, morton_codes
from volery.autonomy.mapping.octomap_stream import (
    Voxels,
    binary_from_full,
    decode_binary,
    decode_full,
)
from volery.autonomy.mapping.octree import Octree, new_tree
from volery.autonomy.mapping.projected_grid import UNKNOWN, HeightSlab, ProjectedGrid, occupancy
from volery.autonomy.perception.motion_history import Pose
from volery.autonomy.perception.scan_rays import Rays
from volery.core import rotations
from volery.core.errors import DataFileError, PlanError

LIMITS = MapLimits(0.2, 100.0, 1_000_000)


def plain_decode(data):
    """Cells {(x, y, z): occupied} of a binary stream, as its format says, by plain recursion."""
    found, stream = {}, iter(data.tobytes())

    def node(x, y, z, width):
        bits, half = next(stream) | next(stream) << 8, width // 2
        corners = [
            (x + half * (c & 1), y + half * (c >> 1 & 1), z + half * (c >> 2)) for c in range(8)
        ]
        kinds = [bits >> 2 * c & 3 for c in range(8)]
        for corner, kind in zip(corners, kinds, strict=True):
            if kind in (1, 2):
                steps = np.stack(np.meshgrid(*[np.arange(half)] * 3), -1).reshape(-1, 3)
                found.update({tuple(cell): kind == 2 for cell in (steps + corner).tolist()})
        for corner, kind in zip(corners, kinds, strict=True):
            if kind == 3:
                node(*corner, half)

    if len(data):
        node(-32768, -32768, -32768, 65536)
        assert next(stream, None) is None
    return found


def cells_of(voxels):
    found = {}
    for corner, side, occupied in zip(*map(np.ndarray.tolist, voxels), strict=True):
        steps = np.stack(np.meshgrid(*[np.arange(side)] * 3), -1).reshape(-1, 3)
        found.update({tuple(cell): occupied for cell in (steps + corner).tolist()})
    return found


def voxels_of_cells(cells):
    corner = np.array(list(cells), np.int32).reshape(-1, 3)
    return Voxels(corner, np.ones(len(corner), np.int32), np.array(list(cells.values()), bool))


def rays_to(ends, start=(0.0, 0.0, 0.0), hits=True):
    ends = np.asarray(ends, float)
    return Rays(np.tile(np.array(start, float), (len(ends), 1)), ends, np.full(len(ends), hits))


@pytest.fixture(scope="module")
def room():
    """The inside of a box of 8 m x 6 m x 3 m, seen from two positions."""
    octree, rng = Octree(0.2), np.random.default_rng(1)
    for start in ([0.0, 0.0, 0.0], [1.5, -0.5, 0.3]):
        directions = rng.normal(size=(3000, 3))
        with np.errstate(divide="ignore"):
            high = (np.array([4.0, 3.0, 1.5]) - start) / directions
            low = (np.array([-4.0, -3.0, -1.5]) - start) / directions
        ends = start + directions * np.maximum(high, low).min(axis=1)[:, None]
        octree.insert(rays_to(ends, start), 15.0)
    return octree


# ------------------------------------------------------------------------------------- streams


def test_bytes_are_those_that_octomap_itself_writes(room, tmp_path):
    data = room.binary()
    write_map(tmp_path / "room.bt", data, 0.2)
    tree = new_tree(0.2)
    assert tree.readBinary(str(tmp_path / "room.bt"))
    written = tree.writeBinary()
    assert written[written.index(b"\ndata\n") + 6 :] == data.tobytes()
    assert tree.size() == node_count(data)


def test_decoding_agrees_with_an_independent_decoder_and_with_octomap(room):
    cells = plain_decode(room.binary())
    assert cells == cells_of(decode_binary(room.binary())) == cells_of(room.voxels())
    tree = room._tree
    rng = np.random.default_rng(2)
    for cell in rng.integers(-25, 25, (500, 3)).tolist():
        node = tree.search((np.array(cell) + 0.5) * 0.2)
        known = cells.get(tuple(cell))
        assert (node is None) == (known is None)
        if node is not None:
            assert tree.isNodeOccupied(node) == known
    assert cells[0, 0, 0] is False  # the middle is free
    assert any(cells.get((19, y, 0)) or cells.get((20, y, 0)) for y in range(-3, 4))  # the wall


def test_an_empty_map_is_no_bytes():
    assert Octree(0.2).binary().size == 0
    assert decode_binary(np.zeros(0, np.uint8)).size == 0
    assert decode_full(np.zeros(0, np.uint8)).size == 0


@given(st.binary(max_size=60))
def test_broken_streams_are_refused_or_read(data):
    stream = np.frombuffer(data, np.uint8)
    for decode in (decode_binary, decode_full):
        with contextlib.suppress(DataFileError):
            voxels = decode(stream)
            assert len(voxels.corner) == len(voxels.side) == len(voxels.occupied)
            assert ((voxels.side > 0) & (voxels.side <= 1 << 16)).all()
    with contextlib.suppress(DataFileError):
        binary = binary_from_full(stream)
        assert decode_binary(binary).occupied.tolist() == decode_full(stream).occupied.tolist()


def test_a_stream_that_is_cut_off_is_refused(room):
    with pytest.raises(DataFileError, match="ends too early"):
        decode_binary(room.binary()[:-2])


# ---------------------------------------------------------------------------------------- octree


def test_rays_that_meet_nothing_free_the_cells_up_to_the_range():
    octree = Octree(0.2)
    octree.insert(rays_to([[10.0, 0.1, 0.1]], (0.1, 0.1, 0.1), hits=False), 10.0)
    cells = cells_of(octree.voxels())
    assert not any(cells.values())
    assert {(x, 0, 0) for x in range(49)} <= set(cells)


def test_a_map_that_grows_too_large_forgets_what_is_far():
    octree, rng = Octree(0.2, max_nodes=30_000), np.random.default_rng(3)
    for k in range(40):
        start = np.array([5.0 * k, 0.0, 0.0])
        offsets = rng.normal(size=(200, 3))
        offsets *= 4.0 / np.linalg.norm(offsets, axis=1)[:, None]
        octree.insert(rays_to(start + offsets, start), 15.0)
        assert octree.nodes < 45_000
    assert octree.forgotten > 0
    corner = octree.voxels().corner[:, 0]
    assert corner.min() * 0.2 > 50.0  # the beginning of the path is gone
    assert corner.max() * 0.2 > 195.0


def test_state_goes_back_exactly(room):
    other = Octree(0.2)
    other.set_state(room.get_state())
    np.testing.assert_array_equal(other.binary(), room.binary())


# ----------------------------------------------------------------------------------------- files


def test_files_come_back(room, tmp_path):
    write_map(tmp_path / "a.bt", room.binary(), 0.2)
    found = read_map(tmp_path / "a.bt", LIMITS)
    np.testing.assert_array_equal(found.data, room.binary())
    taken = Octree(0.2)
    taken.take(tmp_path / "a.bt")
    np.testing.assert_array_equal(taken.binary(), room.binary())


@pytest.mark.parametrize(
    ("limits", "change", "reason"),
    [
        (LIMITS._replace(resolution_m=0.1), lambda b: b, r"0\.2 m wide; this node works with 0\.1"),
        (LIMITS._replace(extent_m=5.0), lambda b: b, "m wide; at most 5 m"),
        (LIMITS._replace(cubes=10), lambda b: b, "at most 10 are allowed"),
        (LIMITS, lambda b: b[:-40], "ends too early"),
        (LIMITS, lambda b: b.replace(b"\nsize ", b"\nsize 9"), "the head declares"),
        (LIMITS, lambda b: b.replace(b"id OcTree", b"id ColorOcTree"), "kind 'ColorOcTree'"),
        (LIMITS, lambda b: b.replace(b"\nres 0.2", b""), "lacks a number 'res'"),
        (LIMITS, lambda b: b"PNG" + b, "not a map"),
    ],
)
def test_maps_that_do_not_fit_are_refused(room, tmp_path, limits, change, reason):
    path = tmp_path / "map.bt"
    write_map(path, room.binary(), 0.2)
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(DataFileError, match=reason):
        read_map(path, limits)


def test_a_map_that_is_not_there(tmp_path):
    with pytest.raises(DataFileError, match="cannot be read"):
        read_map(tmp_path / "none.bt", LIMITS)
    (tmp_path / "file").write_text("")
    with pytest.raises(DataFileError, match="cannot be written"):
        write_map(tmp_path / "file" / "map.bt", np.zeros(0, np.uint8), 0.2)


# --------------------------------------------------------------------------------------- merging


@settings(max_examples=40)
@given(
    st.dictionaries(st.tuples(*[st.integers(-5, 4)] * 3), st.booleans(), min_size=1, max_size=300)
)
def test_cells_become_the_stream_that_holds_them(cells):
    codes = morton_codes(np.array(list(cells), np.int64))
    order = np.argsort(codes)
    data = encode_cells(codes[order], np.array(list(cells.values()))[order])
    assert plain_decode(data) == cells


def test_equal_cells_are_joined():
    cube = {(x, y, z): True for x in range(4) for y in range(4) for z in range(4)}
    data = merged([PlacedMap(voxels_of_cells(cube))], 0.2, 1000)
    (side,) = decode_binary(data).side
    assert side == 4


def test_maps_are_moved_and_the_majority_counts():
    wall = {(5, y, 0): True for y in range(4)} | {(4, y, 0): False for y in range(4)}
    shifted = {(x - 10, y, z): occupied for (x, y, z), occupied in wall.items()}
    beside = Pose(np.array([2.0, 0.0, 0.0]), rotations.IDENTITY)
    wrong = dict.fromkeys(wall, True)
    data = merged(
        [
            PlacedMap(voxels_of_cells(wall)),
            PlacedMap(voxels_of_cells(shifted), beside),
            PlacedMap(voxels_of_cells(wrong)),
        ],
        0.2,
        1000,
    )
    assert plain_decode(data) == wall


def test_a_turned_map_has_no_holes():
    block = {(x, y, z): True for x in range(12) for y in range(12) for z in range(4)}
    turn = Pose(np.array([0.03, -0.05, 0.0]), rotations.from_rpy(0.0, 0.0, 0.5))
    cells = plain_decode(merged([PlacedMap(voxels_of_cells(block), turn)], 0.2, 1000))
    back = rotations.from_rpy(0.0, 0.0, -0.5)
    for x, y, z in np.ndindex(30, 30, 4):
        cell = (x - 12, y - 6, z)
        position = rotations.rotate(back, (np.array(cell) + 0.5) * 0.2 - turn.position) / 0.2
        if ((position > 0.75) & (position < [11.25, 11.25, 3.25])).all():
            assert cells[cell]


def test_what_is_too_large_to_merge_is_refused():
    cells = {(x, 0, 0): True for x in range(20)}
    with pytest.raises(PlanError, match="at most 10 are merged"):
        merged([PlacedMap(voxels_of_cells(cells))], 0.2, 10)
    far = Pose(np.array([1e6, 0.0, 0.0]), rotations.IDENTITY)
    with pytest.raises(PlanError, match="beyond"):
        merged([PlacedMap(voxels_of_cells(cells), far)], 0.2, 100)
    assert merged([], 0.2, 10).size == 0


# ------------------------------------------------------------------------------------------ grid

FLAT = HeightSlab(0.0, np.zeros(2), 0.6)


def test_the_grid_shows_walls_and_what_is_free_before_them():
    grid = ProjectedGrid(0.4, 40.0)
    grid.begin_at(np.array([0.1, 0.1]))
    angles = np.linspace(-0.5, 0.5, 200)
    ends = np.stack([np.full(200, 5.0), 5.0 * np.tan(angles), np.zeros(200)], -1)
    grid.add(rays_to(ends, (0.1, 0.1, 0.0)), FLAT)
    value = occupancy(grid.score)
    column = lambda x: int(np.floor(x / 0.4)) - grid.origin[0]  # noqa: E731
    row = int(np.floor(0.1 / 0.4)) - grid.origin[1]
    assert value[row, column(5.0)] == 100
    assert (value[row, column(0.5) : column(5.0)] == 0).all()
    assert value[row, column(6.0)] == -1
    _, columns = grid.known_box()
    assert columns.stop - 1 == column(5.0)


def test_a_thin_trunk_stays_among_rays_that_pass_it():
    grid = ProjectedGrid(0.4, 40.0)
    grid.begin_at(np.zeros(2))
    ends = np.stack([np.full(41, 8.0), np.linspace(-1.0, 1.0, 41), np.zeros(41)], -1)
    ends[20, 0] = 4.1  # one beam of 41 meets it
    for _ in range(10):
        grid.add(rays_to(ends), FLAT)
    assert grid.score[0 - grid.origin[1], 10 - grid.origin[0]] > 0
    ends[20, 0] = 8.0  # it is carried away
    for _ in range(20):
        grid.add(rays_to(ends), FLAT)
    assert grid.score[0 - grid.origin[1], 10 - grid.origin[0]] <= 0


def test_what_is_off_the_slab_or_the_grid_is_left_out():
    grid = ProjectedGrid(0.4, 20.0)
    grid.begin_at(np.zeros(2))
    grid.add(rays_to([[4.0, 0.0, 3.0], [0.0, 30.0, 0.0]]), FLAT)
    assert not (grid.score > 0).any()
    assert grid.outside == 1
    assert grid.score[0 - grid.origin[1], 9 - grid.origin[0]] == UNKNOWN
