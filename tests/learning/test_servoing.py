"""The task servoing: its geometry, the model of detections against images, and the ends."""

from __future__ import annotations

import math

import numpy as np
import pytest

from volery.autonomy.policy.shipped_policies import load_policy
from volery.core import rotations
from volery.learning.episodes import Episodes
from volery.learning.tags.camera import TagCamera
from volery.learning.tags.detection_model import detected_fraction, model_detections
from volery.learning.tags.memory import AGE, SEEN_YAW, TAG_YAW, TO_TAG
from volery.learning.tags.setup import downward_camera
from volery.learning.tasks import load_task
from volery.learning.terms import landing
from volery.learning.terms.observations import GOAL
from volery.vehicle.airframe import load_airframe
from volery.world.actors.tags import FACE_M

K = 12


@pytest.fixture(scope="module")
def camera() -> TagCamera:
    return downward_camera()


@pytest.fixture
def episodes():
    made = Episodes(load_task("servoing"), K, seed=3)
    made.begin(np.arange(K))
    yield made
    made.close()


def above(height, count=K, seed=1, tilt=0.1):
    """Poses above tags at the origin."""
    random = np.random.default_rng(seed)
    roll, pitch = random.normal(0.0, tilt, (2, count))
    yaw, tag_yaw = random.uniform(-3, 3, (2, count))
    aside = random.uniform(-0.3, 0.3, (2, count)) * height
    position = np.column_stack([*aside, np.full(count, height)])
    return position, rotations.from_rpy(roll, pitch, yaw), np.zeros((count, 3)), tag_yaw


def test_views_agree_with_the_projection_of_the_camera(camera):
    level = np.array([[0.0, 0.0, 0.0, 1.0]])
    view = camera.view(np.array([[0.0, 0.0, 2.06]]), level, np.zeros((1, 3)), np.zeros(1))
    np.testing.assert_allclose(view.position_optical, [[0.0, 0.0, 2.0 - FACE_M]], atol=1e-9)
    half = 0.25 * camera.model.focal_px / (2.0 - FACE_M)
    u, v = camera.model.centre_px
    # the camera looks down with its image's top ahead: the tag's left is the image's left
    wanted = [
        [u - half, v - half],
        [u + half, v - half],
        [u + half, v + half],
        [u - half, v + half],
    ]
    np.testing.assert_allclose(view.corners_px[0], wanted, atol=1e-6)
    assert view.is_whole.all()
    assert view.cell_px[0] == pytest.approx(half / 4)
    away = camera.view(np.array([[3.0, 0.0, 2.06]]), level, np.zeros((1, 3)), np.zeros(1))
    below = camera.view(np.array([[0.0, 0.0, -2.0]]), level, np.zeros((1, 3)), np.zeros(1))
    assert not away.is_whole.any()
    assert not below.is_whole.any()


def test_the_model_detects_as_often_as_measured_and_errs_as_measured(camera):
    count = 4000
    view = camera.view(*above(3.0, count))
    keys = np.arange(count, dtype=np.uint64)
    found = model_detections(camera, view, keys, np.full(count, 7))
    whole = view.is_whole
    assert whole.mean() > 0.5
    expected = detected_fraction(view.cell_px[whole]).mean()
    assert found.is_detected[whole].mean() == pytest.approx(expected, abs=0.02)
    assert not found.is_detected[~whole].any()
    seen = found.is_detected
    ratio = found.position_optical[seen, 2] / view.position_optical[seen, 2]
    assert 1.005 < ratio.mean() < 1.05  # sides look too small
    ray = found.position_optical[seen, :2] / found.position_optical[seen, 2:]
    true = view.position_optical[seen, :2] / view.position_optical[seen, 2:]
    assert np.std((ray - true) * camera.model.focal_px) == pytest.approx(0.15, abs=0.06)
    again = model_detections(camera, view, keys, np.full(count, 7))
    np.testing.assert_array_equal(found.position_optical, again.position_optical)
    other = model_detections(camera, view, keys, np.full(count, 8))
    assert (found.position_optical != other.position_optical).any()


def test_tags_of_tiny_cells_are_never_detected():
    assert detected_fraction(np.array([0.5, np.nan, 1.2])).tolist() == [0.0, 0.0, 0.0]
    fractions = detected_fraction(np.array([1.6, 2.0, 2.5, 5.0, 20.0, 90.0]))
    assert (np.diff(fractions) >= 0.0).all()
    assert fractions[-1] > 0.98


def test_rendered_images_agree_with_the_model(camera):
    """Poses of the detector are within the model's errors of the true ones."""
    pytest.importorskip("cv2")
    from volery.learning.tags.images import TagImages

    images = TagImages(camera, load_airframe("f450"), K, threads=1)
    envs = np.arange(K)
    for height in (1.2, 3.0):
        poses = above(height, seed=5)
        view = camera.view(*poses)
        rendered = images.render(envs, *poses, keys=envs.astype(np.uint64))
        found = images.detect(rendered)
        assert found.is_detected[view.is_whole].all()
        assert view.is_whole.sum() > K // 2
        rows = np.flatnonzero(view.is_whole)
        side = 8.0 * view.cell_px[rows]
        ratio = found.position_optical[rows, 2] / view.position_optical[rows, 2]
        assert (np.abs(ratio - 1.0) < 1.5 / side).all()
        ray = found.position_optical[rows, :2] / found.position_optical[rows, 2:]
        true = view.position_optical[rows, :2] / view.position_optical[rows, 2:]
        assert np.abs((ray - true) * camera.model.focal_px).max() < 0.8
        turn = rotations.multiply(
            found.attitude_optical[rows], rotations.conjugate(view.attitude_optical[rows])
        )
        assert np.abs(rotations.logarithm(turn)[:, 2]).max() < 0.1
    images.close()


def test_a_tag_is_remembered_and_carried_on(episodes):
    flight, action = episodes.flight, np.zeros((K, 1, 4))
    assert np.isinf(flight.values[AGE]).all()
    unseen = episodes.observe(np.arange(K))[:, 0, :6]
    assert (unseen == [0, 0, 0, 0, 0, 1]).all()
    episodes.decide(action)
    assert np.isinf(flight.values[AGE]).all()  # the first image arrives at the next decision
    for _ in range(3):
        episodes.decide(action)
    fresh = flight.values[AGE][:, 0] < 0.11
    assert fresh.mean() > 0.5
    true = (flight.values[GOAL] - flight.state.position_map)[:, 0]
    error = np.linalg.norm(flight.values[TO_TAG] - true, axis=1)[fresh]
    assert error.max() < 0.5
    assert np.median(error) < 0.15
    turn = flight.values[SEEN_YAW] - flight.values[TAG_YAW]
    assert np.cos(turn[fresh]).min() > math.cos(0.2)


def test_only_a_soft_touchdown_near_the_tag_succeeds(episodes):
    flight = episodes.flight
    flight._state = state = flight.envs.present_state()
    state.on_ground, state.crashed = np.ones((K, 1), np.bool_), np.zeros((K, 1), np.bool_)
    kept = flight.values[landing.MOTION]
    kept[:] = 0.0
    kept[0, 0, 5] = -0.9
    kept[1, 0, 6] = 0.35
    kept[2, 0, 6] = 0.25
    kept[2, 0, 5] = -0.5
    ends = landing.landed(0.3, 0.7).function(flight)
    assert ends[:4].tolist() == [False, False, True, True]
    assert landing.touchdown_nearness(1.0, 0.3).function(flight)[2, 0] == pytest.approx(
        math.exp(-0.25 / 0.3)
    )
    assert landing.touchdown_speed(1.0).function(flight)[0, 0] == pytest.approx(0.9)


def test_shaping_adds_up_to_the_distance(episodes):
    flight = episodes.flight
    start = np.linalg.norm(flight.values[landing.MOTION][:, 0, 6:9], axis=1)
    action = np.zeros((K, 1, 4))
    action[..., 2] = -0.4
    outcome = [episodes.decide(action) for _ in range(5)]
    assert not any(o.terminated.any() for o in outcome)
    fallen = start * 0.0 + episodes.reward_sums["descent"][:, 0]
    kept = flight.values[landing.MOTION][:, 0]
    before = np.abs(kept[:, 8]) + fallen
    assert (fallen > 0.1).all()
    assert ((before > 2.4) & (before < 4.6)).all()


def test_the_baseline_lands():
    policy = load_policy("servoing")
    made = Episodes(load_task("servoing"), 32, seed=11)
    made.begin(np.arange(32))
    over, success = np.zeros(32, np.bool_), np.zeros(32, np.bool_)
    while not over.all():
        observation = made.observe(np.arange(32))[:, 0]
        outcome = made.decide(policy.network.act(observation)[:, None])
        success |= outcome.success & ~over
        over |= outcome.terminated | outcome.truncated
    made.close()
    assert success.mean() > 0.9
