"""`sensor_msgs_py.point_cloud2` reads and creates clouds as in ROS 2."""

import numpy as np
import pytest

from volery.graph.message_copies import copy_message, receive_message
from volery.graph.messages import Header, Image, PointCloud2, PointField
from volery.graph.nodes import point_cloud2 as pc2

XYZ = [(0.0, 1.0, 2.0), (float("nan"), 4.0, 5.0), (6.0, 7.0, 8.0)]
MIXED = [
    PointField(name="x", offset=0, datatype=PointField.FLOAT32, count=1),
    PointField(name="ring", offset=4, datatype=PointField.UINT16, count=1),
    PointField(name="rgb", offset=6, datatype=PointField.UINT8, count=3),
]


def test_a_cloud_of_xyz_comes_back():
    cloud = pc2.create_cloud_xyz32(Header(frame_id="map"), XYZ)
    assert (cloud.width, cloud.height, cloud.point_step, cloud.row_step) == (3, 1, 12, 36)
    assert cloud.header.frame_id == "map"
    assert [field.name for field in cloud.fields] == ["x", "y", "z"]
    read = receive_message(copy_message(cloud))  # as a node receives it
    np.testing.assert_array_equal(pc2.read_points_numpy(read), np.array(XYZ, np.float32))
    points = pc2.read_points(read, field_names=("z", "x"), skip_nans=True)
    assert points.dtype.names == ("z", "x")
    assert points.tolist() == [(2.0, 0.0), (8.0, 6.0)]
    listed = pc2.read_points_list(read, skip_nans=True)
    assert [(point.x, point.z) for point in listed] == [(0.0, 2.0), (6.0, 8.0)]


def test_fields_of_several_types_and_counts():
    cloud = pc2.create_cloud(Header(), MIXED, [(0.5, 3, 1, 2, 3), (1.5, 4, 4, 5, 6)])
    points = pc2.read_points(cloud)
    assert points.dtype.names == ("x", "ring", "rgb_0", "rgb_1", "rgb_2")
    assert points["ring"].tolist() == [3, 4]
    assert pc2.read_points(cloud, uvs=[1])["x"].tolist() == [1.5]
    with pytest.raises(ValueError, match="several types"):
        pc2.read_points_numpy(cloud)
    assert pc2.read_points_numpy(cloud, ["rgb_0"]).tolist() == [[1], [4]]
    with pytest.raises(ValueError, match="no field y"):
        pc2.read_points(cloud, ["y"])
    assert pc2.create_cloud(Header(), MIXED, points).data.tolist() == cloud.data.tolist()


def test_padded_points_and_rows_of_either_byte_order():
    fields = [PointField(name="x", offset=0, datatype=PointField.FLOAT32, count=1)]
    rows = np.zeros((2, 28), np.uint8)  # 3 points of 8 bytes, and 4 bytes of padding
    for k in range(2):
        for i in range(3):
            rows[k, 8 * i : 8 * i + 4] = np.array([10 * k + i], ">f4").view(np.uint8)
    cloud = PointCloud2(
        width=3,
        height=2,
        fields=fields,
        is_bigendian=True,
        point_step=8,
        row_step=28,
        data=rows.reshape(-1),
    )
    before = cloud.data.copy()
    assert pc2.read_points(cloud)["x"].tolist() == [0, 1, 2, 10, 11, 12]
    assert pc2.read_points(cloud, reshape_organized_cloud=True).shape == (3, 2)
    assert cloud.data.tolist() == before.tolist()
    cloud.data = cloud.data[:-5]
    with pytest.raises(ValueError, match="51 bytes, not 52"):
        pc2.read_points(cloud)


def test_arrays_become_clouds_without_loops():
    points = np.arange(12.0).reshape(4, 3)
    cloud = pc2.create_cloud_xyz32(Header(), points)
    np.testing.assert_array_equal(pc2.read_points_numpy(cloud), points)
    grid = np.zeros((4, 2), pc2.dtype_from_fields(MIXED))
    organized = pc2.create_cloud(Header(), MIXED, grid)
    assert (organized.width, organized.height) == (4, 2)
    empty = pc2.create_cloud_xyz32(Header(), [])
    assert len(pc2.read_points(empty)) == 0


def test_what_is_no_cloud_is_refused():
    with pytest.raises(TypeError, match="Image is no"):
        pc2.read_points(Image())
    with pytest.raises(ValueError, match="same name"):
        pc2.create_cloud(Header(), [MIXED[0], MIXED[0]], [])
    with pytest.raises(ValueError, match="datatype 77"):
        pc2.dtype_from_fields([PointField(name="x", offset=0, datatype=77, count=1)])
