"""AprilTags in rendered images: accuracy of detections and poses, and the node."""

from __future__ import annotations

import math

import numpy as np
import pytest
from node_bench import NodeBench

from volery.core import rotations
from volery.core.errors import GraphError, NodeError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import CameraInfo, Image, header

pytest.importorskip("cv2")

from volery.autonomy.perception.tags.detector import DetectedTag, TagDetector, grey_of
from volery.autonomy.perception.tags.tag_detection import TagDetection, grey_image
from volery.autonomy.perception.tags.tag_messages import class_of, id_of
from volery.autonomy.perception.tags.tag_pose import position_covariance, tag_pose
from volery.autonomy.policy.tag_terms import CAMERA_FROM_OPTICAL
from volery.sensors.cameras.camera import take
from volery.sensors.cameras.light import make_light
from volery.sensors.cameras.model import CameraModel
from volery.sensors.lidar.lidar import make_batch, stack_mounts
from volery.sensors.mount import make_mount
from volery.vehicle.airframe import load_airframe
from volery.vehicle.body_shape import body_shape
from volery.vehicle.pose_history import new_history
from volery.world.actors import MovingActor, MovingActors
from volery.world.actors.motions import GivenMotion
from volery.world.actors.tags import FACE_M, tag_corners, tag_shape
from volery.world.scene import Scene
from volery.world.terrain import Terrain

TAG_ID, SIZE_M = 7, 0.5
HEIGHTS_M = (2.0, 4.0, 8.0, 12.0)
MODEL = CameraModel.load("pinhole").model_copy(update={"samples": 4})
NUMBER, DETECTIONS = "36h11:7", "/uav1/tag_detection/detections"


class Shot:
    """An image from above, tilted and off the centre, and the true geometry."""

    def __init__(self, scene, height_m):
        yaw, off = 0.4 * height_m, 0.15 * height_m
        position = np.array([off, -0.5 * off, height_m])
        level = rotations.from_rpy(math.radians(5.0), math.radians(-4.0), yaw)
        attitude = rotations.multiply(level, rotations.from_rpy(0.0, math.pi / 2.0, 0.0))
        history = new_history([position], [attitude], 1_000_000)
        batch = make_batch([0], [0], [0], [5], [0], stack_mounts([make_mount()]))
        images = take(scene, MODEL, make_light(), batch, history, parts=("colour",))
        self.colour = images.colour[0]
        camera = rotations.multiply(attitude, CAMERA_FROM_OPTICAL)
        back = rotations.conjugate(camera)
        self.corners_px = MODEL.project(rotations.rotate(back, tag_corners(SIZE_M) - position))
        self.position = rotations.rotate(back, np.array([0.0, 0.0, FACE_M]) - position)
        self.attitude = back  # the tag's axes are the map's
        self.height_m = height_m

    def message(self, encoding="rgb8"):
        height, width = self.colour.shape[:2]
        pixels = self.colour if encoding == "rgb8" else self.colour[..., ::-1]
        if encoding == "mono8":
            pixels = grey_of(self.colour)
        step = pixels.nbytes // height
        data = np.ascontiguousarray(pixels).ravel()
        frame = header(9, "uav1/camera_optical")
        return Image(frame, height, width, encoding, 0, step, data)


@pytest.fixture(scope="module")
def shots():
    scene = Scene(Terrain.flat(200.0, 0.0, origin=(-100.0, -100.0)), None)
    shape = tag_shape(TAG_ID, SIZE_M)
    pad = MovingActor("pad", "tag", shape, GivenMotion([0, 0, 0, 0, 0, 0, 1.0]), is_flat=True)
    scene.set_actors(MovingActors([pad]))
    scene.set_bodies([body_shape(load_airframe("f450"))], [0])
    yield {height: Shot(scene, height) for height in HEIGHTS_M}
    scene.close()


def info(matrix=MODEL.matrix, model="plumb_bob", lens=(0.0,) * 5):
    message = zero_message("sensor_msgs/msg/CameraInfo")
    assert isinstance(message, CameraInfo)
    message.k, message.d = np.array(matrix, float).ravel(), np.array(lens, float)
    message.distortion_model = model
    return message


@pytest.mark.parametrize("height_m", HEIGHTS_M)
def test_a_rendered_tag_is_detected_within_half_a_pixel(shots, height_m):
    shot = shots[height_m]
    (tag,) = TagDetector().detect(grey_of(shot.colour))
    assert tag.id == TAG_ID
    centre = tag.corners_px.mean(axis=0) - shot.corners_px.mean(axis=0)
    assert np.abs(centre).max() < 0.5
    assert np.abs(tag.corners_px - shot.corners_px).max() < 2.0


@pytest.mark.parametrize("height_m", HEIGHTS_M)
def test_poses_are_those_of_the_scene(shots, height_m):
    shot = shots[height_m]
    (tag,) = TagDetector().detect(grey_of(shot.colour))
    pose = tag_pose(tag, SIZE_M, MODEL.matrix)
    error = pose.position - shot.position
    # distance: a pixel of the side; across: a third of a pixel, and what the distance shifts
    assert abs(error[2]) < shot.height_m / tag.side_px
    shifted = shot.position[:2] * error[2] / shot.position[2]
    assert np.abs(error[:2] - shifted).max() < 0.34 * shot.height_m / MODEL.focal_px
    turn = rotations.multiply(pose.attitude, rotations.conjugate(shot.attitude))
    about_axis = float(rotations.logarithm(turn)[2])
    assert abs(about_axis) < math.radians(2.0) + 0.7 / tag.side_px
    assert pose.error_px < 1.0


def test_exact_corners_give_the_exact_pose(shots):
    shot = shots[4.0]
    pose = tag_pose(DetectedTag(7, shot.corners_px), SIZE_M, MODEL.matrix)
    np.testing.assert_allclose(pose.position, shot.position, atol=1e-4)
    turn = rotations.multiply(pose.attitude, rotations.conjugate(shot.attitude))
    assert np.linalg.norm(rotations.logarithm(turn)) < 1e-3
    bent = MODEL.model_copy(update={"distortion": (-0.2, 0.05, 0.001, -0.001, 0.0)})
    corners = bent.project(corners_optical(shot))
    straightened = tag_pose(DetectedTag(7, corners), SIZE_M, bent.matrix, np.array(bent.distortion))
    np.testing.assert_allclose(straightened.position, shot.position, atol=1e-3)


def corners_optical(shot):
    own = tag_corners(SIZE_M) - [0.0, 0.0, FACE_M]
    return shot.position + rotations.rotate(shot.attitude, own)


def test_covariances_follow_the_ray(shots):
    shot = shots[8.0]
    tag = DetectedTag(7, shot.corners_px)
    covariance = position_covariance(tag_pose(tag, SIZE_M, MODEL.matrix), tag, MODEL.focal_px, 0.3)
    ray = shot.position / np.linalg.norm(shot.position)
    along = math.sqrt(ray @ covariance @ ray)
    assert along == pytest.approx(0.3 * np.linalg.norm(shot.position) / tag.side_px, rel=1e-3)
    aside = np.cross(ray, [0.0, 1.0, 0.0])
    aside /= np.linalg.norm(aside)
    across = math.sqrt(aside @ covariance @ aside)
    assert across == pytest.approx(0.15 * shot.position[2] / MODEL.focal_px, rel=1e-3)
    assert (np.linalg.eigvalsh(covariance) > 0.0).all()


def started(**parameters):
    bench = NodeBench()
    node = bench.start(TagDetection, size_m=SIZE_M, **parameters)
    return bench, node, bench.listen(DETECTIONS)


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "mono8"])
def test_the_node_publishes_detections(shots, encoding):
    bench, _, received = started(publish_tf=True)
    frames = bench.listen("/tf")
    shot = shots[2.0]
    bench.send("/uav1/camera/image_raw", shot.message(encoding))
    assert not received  # without intrinsics
    bench.send("/uav1/camera/camera_info", info())
    bench.send("/uav1/camera/image_raw", shot.message(encoding))
    (array,) = received
    assert array.header.frame_id == "uav1/camera_optical"
    assert array.header.stamp.nanosec == 9
    (one,) = array.detections
    assert one.id == NUMBER == class_of(7)
    assert id_of(one.results[0].hypothesis.class_id) == 7
    p = one.results[0].pose.pose.position
    np.testing.assert_allclose([p.x, p.y, p.z], shot.position, atol=0.02)
    assert one.results[0].pose.covariance[35] == -1.0
    assert one.bbox.size.x == SIZE_M
    (placed,) = frames[0].transforms
    assert placed.child_frame_id == "uav1/tag_7"
    assert placed.transform.translation.z == p.z


def test_the_node_leaves_out_what_parameters_exclude(shots):
    for parameters in ({"ids": [3]}, {"min_side_px": 400.0}, {"max_error_px": 0.01}):
        bench, _, received = started(**parameters)
        bench.send("/uav1/camera/camera_info", info())
        bench.send("/uav1/camera/image_raw", shots[2.0].message())
        assert [len(array.detections) for array in received] == [0]


def test_parameters_have_bounds():
    for name in ("size_m", "min_side_px", "max_error_px", "corner_sigma_px"):
        for value in (-1.0, math.nan, math.inf, 1e9):
            with pytest.raises(GraphError, match=rf"parameter '{name}' must be "):
                NodeBench().start(TagDetection, **{name: value})
    for ids in ([-1], [587], [True], [1.5]):
        with pytest.raises((NodeError, GraphError), match="ids"):
            NodeBench().start(TagDetection, ids=ids)


def test_images_and_intrinsics_that_do_not_fit_are_errors(shots):
    bench, node, _ = started()
    for bad in (info(np.zeros(9)), info(model="equidistant"), info(lens=(math.nan,) * 5)):
        with pytest.raises(GraphError, match="camera_info"):
            node._on_info(bad)
    message = shots[2.0].message()
    for change in ({"encoding": "16UC1"}, {"step": 5}, {"height": 3}, {"width": 0}):
        with pytest.raises(GraphError, match=r"image|images"):
            grey_image(Image(**(vars(message) | change)))
    assert bench is not None


def test_a_snapshot_holds_the_intrinsics(shots):
    bench, node, _ = started()
    bench.send("/uav1/camera/camera_info", info())
    other_bench, other, received = started()
    other.set_state(node.get_state())
    other_bench.send("/uav1/camera/image_raw", shots[2.0].message())
    assert len(received[0].detections) == 1


def test_classes_of_other_families_are_none():
    assert [id_of(text) for text in ("36h11:12", "25h9:1", "36h11:x", "36h11:", "²")] == [
        12,
        None,
        None,
        None,
        None,
    ]


def test_grey_is_the_luma_of_opencv():
    import cv2

    random = np.random.default_rng(4)
    colour = random.integers(0, 256, (40, 50, 3)).astype(np.uint8)
    wanted = cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY)
    assert np.abs(grey_of(colour).astype(int) - wanted).max() <= 1
