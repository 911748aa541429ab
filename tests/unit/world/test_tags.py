"""AprilTags: the code of OpenCV's dictionary, boards as actors, and what scenarios refuse."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from volery.core import rotations
from volery.core.errors import ScenarioError
from volery.runtime.construction.actors import build_actors
from volery.runtime.construction.worlds import build_scene, build_terrain
from volery.scenario.load import parse_scenario
from volery.world.actors.motions import AttachedMotion, GivenMotion, WaypointMotion
from volery.world.actors.tags import CELLS, FACE_M, code_words, tag_cells, tag_corners, tag_shape
from volery.world.materials import Material
from volery.world.scene import Scene, Solid

VAN = {"name": "van", "shape": "car", "motion": {"kind": "external", "position_m": [6.0, 0.0]}}
PAD = {
    "name": "pad",
    "shape": "tag",
    "tag": {"id": 7, "size_m": 0.8},
    "motion": {"kind": "external", "position_m": [1.0, 2.0], "yaw_deg": 90.0},
}


def scenario(*actors):
    return parse_scenario(
        {
            "name": "tags",
            "world": {"actors": list(actors)},
            "types": {"f450": {"sensors": []}},
            "uavs": [{"type": "f450", "position_m": [0.0, 30.0]}],
        }
    )


def test_code_words_are_those_of_opencv():
    cv2 = pytest.importorskip("cv2")
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    assert len(set(code_words())) == len(dictionary.bytesList) == 587
    for tag_id in range(587):
        drawn = cv2.aruco.generateImageMarker(dictionary, tag_id, CELLS) > 127
        np.testing.assert_array_equal(tag_cells(tag_id), drawn)


def test_words_differ_in_eleven_bits_at_every_turn():
    """The family's promise: Hamming distance 11, also between turned words."""
    cells = np.array([tag_cells(k)[1:-1, 1:-1] for k in range(60)])
    turned = np.concatenate([np.rot90(cells, k, axes=(1, 2)) for k in range(4)])
    differ = (turned[:, None] != cells[None]).sum(axis=(2, 3))
    assert np.sort(differ.ravel())[: len(cells)].max() == 0  # each word equals itself once
    assert np.sort(differ.ravel())[len(cells)] >= 11


def test_the_shape_shows_the_cells_to_rays_from_above():
    shape = tag_shape(7, 0.8)
    scene = Scene(None, None, solids=[Solid(mesh, material, "") for mesh, material in shape.parts])
    centre = 0.1 * (3.5 - np.arange(8))
    x, y = (a.ravel() for a in np.meshgrid(centre, centre, indexing="ij"))
    border = [[0.45, 0.0], [0.0, -0.45], [0.495, 0.495]]
    points = np.vstack([np.column_stack([x, y]), border, [[0.51, 0.0]]])
    hits = scene.cast(np.column_stack([points, np.full(len(points), 3.0)]), [[0, 0, -1.0]] * 68, 9)
    white = hits.material == Material.PRINT_WHITE
    np.testing.assert_array_equal(white[:64].reshape(8, 8), tag_cells(7))
    assert white[64:67].all()
    assert hits.material[67] == Material.NONE
    black = hits.material == Material.PRINT_BLACK
    np.testing.assert_allclose(hits.distance[black], 3.0 - FACE_M, atol=1e-5)
    assert np.ptp(hits.distance[:67]) < 0.0025  # flat for a LIDAR
    scene.close()


def test_parts_are_a_closed_board_and_closed_plates():
    for mesh, _ in tag_shape(3, 0.5).parts:
        edges = np.concatenate([mesh.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
        one_way = {tuple(e) for e in edges.tolist()}
        assert one_way == {e[::-1] for e in one_way}
    corners = tag_corners(0.5)
    np.testing.assert_allclose(corners[0], [0.25, 0.25, FACE_M])
    np.testing.assert_allclose(np.linalg.norm(np.diff(corners, axis=0), axis=1), 0.5)


def test_an_attached_tag_moves_and_turns_with_its_actor():
    base = WaypointMotion([[0.0, 0.0, 0.0], [0.0, 10.0, 0.0]], 2.0, "stop")
    half = math.radians(45.0)
    motion = AttachedMotion(base, [1.0, 0.5, 1.5, 0.0, 0.0, math.sin(half), math.cos(half)])
    pose = motion.pose_at(2.0)  # the base is at (0, 4) and faces y
    np.testing.assert_allclose(pose[:3], [-0.5, 5.0, 1.5], atol=1e-9)
    assert abs(float(rotations.yaw_of(pose[3:]))) == pytest.approx(math.pi)
    assert motion.speed_m_s == 2.0


def test_scenarios_build_tags_on_the_ground_and_on_actors():
    on_roof = {"kind": "attached", "actor": "van", "position_m": [-0.4, 0.0, 1.45]}
    roof = {**PAD, "name": "roof", "motion": on_roof}
    other = {**PAD, "name": "other", "tag": {}}
    world = scenario(roof, VAN, PAD, other)
    actors = build_actors(world, build_terrain(world))
    poses = actors.poses_at(0)
    np.testing.assert_allclose(poses[0, :3], [5.6, 0.0, 1.45])
    np.testing.assert_allclose(poses[2, :3], [1.0, 2.0, 0.0])
    assert actors.is_flat.tolist() == [True, False, True, True]
    assert actors.shapes[0] is actors.shapes[2] is not actors.shapes[3]
    tags = actors.actors[2].tags
    assert tags == ("family=36h11", "id=7", "size_m=0.8", f"code={code_words()[7]:09x}")
    assert isinstance(actors.actors[2].motion, GivenMotion)


def test_a_tag_in_a_scene_is_seen_where_it_lies():
    world = scenario(PAD)
    terrain = build_terrain(world)
    scene = build_scene(world, terrain, None)
    scene.move_actors(0, 0)
    # yaw 90 degrees: the image's top, its x, points along y of the map
    down = [[0.0, 0.0, -1.0]] * 3
    hits = scene.cast([[1.0, 2.45, 2.0], [1.0, 2.35, 2.0], [1.0, 2.6, 2.0]], down, 5.0)
    assert hits.material.tolist() == [Material.PRINT_WHITE, Material.PRINT_BLACK, Material.GROUND]
    scene.close()


@pytest.mark.parametrize(
    ("actor", "why"),
    [
        ({**PAD, "tag": None}, "belong together"),
        ({**VAN, "tag": {"id": 1}}, "belong together"),
        ({**PAD, "tag": {"id": 587}}, "586"),
        ({**PAD, "tag": {"id": -1}}, "0"),
        ({**PAD, "tag": {"size_m": 0.0}}, "0.01"),
        ({**PAD, "tag": {"size_m": math.nan}}, "size_m"),
        ({**PAD, "tag": {"family": "25h9"}}, "36h11"),
        (
            {**PAD, "motion": {"kind": "attached", "actor": "pad", "position_m": [0, 0, 0]}},
            "pad is attached to 'pad'.* known: none",
        ),
        (
            {**VAN, "motion": {"kind": "attached", "actor": "van", "position_m": [0, 0, 0]}},
            "only actors of shape tag",
        ),
    ],
)
def test_what_makes_no_tag_is_refused_in_one_line(actor, why):
    with pytest.raises(ScenarioError) as caught:
        scenario(actor)
    assert re.search(why, str(caught.value))
    assert "\n" not in str(caught.value)
