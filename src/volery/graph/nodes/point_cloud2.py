"""Provides the contents of the stand-in for `sensor_msgs_py.point_cloud2`.

A cloud's points are one structured array, without a copy where the cloud has the byte order of this
machine. Rows with padding are read as well.
"""

from __future__ import annotations

import sys
from collections import namedtuple
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.lib.recfunctions import structured_to_unstructured, unstructured_to_structured

from volery.core.arrays import Array
from volery.graph.messages import PointCloud2, PointField

DUMMY_FIELD_PREFIX = "unnamed_field"
_FORMATS = {
    PointField.INT8: "i1",
    PointField.UINT8: "u1",
    PointField.INT16: "i2",
    PointField.UINT16: "u2",
    PointField.INT32: "i4",
    PointField.UINT32: "u4",
    PointField.FLOAT32: "f4",
    PointField.FLOAT64: "f8",
}


def read_points(
    cloud: Any,
    field_names: Iterable[str] | None = None,
    skip_nans: bool = False,
    uvs: Iterable[int] | None = None,
    reshape_organized_cloud: bool = False,
) -> Any:
    """Returns the points of a PointCloud2 as a structured array (N,).

    field_names: None reads all fields. skip_nans: leaves out points with a NaN, unless the cloud is
    dense. uvs: indices of the points to return. reshape_organized_cloud: returns (width, height)
    for a cloud of several rows, as in ROS 2. Read-only where the cloud's data is. Raises
    `TypeError` for another message, `ValueError` for unknown fields or too little data.
    """
    _check(cloud)
    kind = dtype_from_fields(cloud.fields, cloud.point_step)
    if cloud.is_bigendian != (sys.byteorder == "big"):
        kind = kind.newbyteorder()
    points = cloud_rows(cloud, kind).reshape(-1)
    if field_names is not None:
        names = list(field_names)
        unknown = [name for name in names if name not in (kind.names or ())]
        if unknown:
            raise ValueError(f"the cloud has no field {', '.join(unknown)}; fields: {kind.names}")
        points = points[names]
    if not points.dtype.isnative:
        points = points.astype(points.dtype.newbyteorder("="))
    if skip_nans and not cloud.is_dense:
        bad = [np.isnan(points[name]) for name in points.dtype.names or ()]
        points = points[~np.any(bad, axis=0)]
    if uvs is not None:
        points = points[uvs if isinstance(uvs, np.ndarray) else np.fromiter(uvs, int)]
    if reshape_organized_cloud and cloud.height > 1:
        points = points.reshape(cloud.width, cloud.height)
    return points


def read_points_numpy(
    cloud: Any,
    field_names: Iterable[str] | None = None,
    skip_nans: bool = False,
    uvs: Iterable[int] | None = None,
    reshape_organized_cloud: bool = False,
) -> Array:
    """Returns the points as a plain array (N, fields); else as `read_points`.

    Raises `ValueError` if the fields have several types.
    """
    _check(cloud)
    names = None if field_names is None else list(field_names)
    kinds = {f.datatype for f in cloud.fields if names is None or f.name in names}
    if len(kinds) > 1:
        raise ValueError("the fields have several types: use read_points")
    points = read_points(cloud, names, skip_nans, uvs, reshape_organized_cloud)
    return structured_to_unstructured(points)


def read_points_list(
    cloud: Any,
    field_names: Iterable[str] | None = None,
    skip_nans: bool = False,
    uvs: Iterable[int] | None = None,
) -> list[Any]:
    """Returns the points as named tuples `Point`; else as `read_points`."""
    points = read_points(cloud, field_names, skip_nans, uvs)
    point = namedtuple("Point", points.dtype.names)  # type: ignore[misc]
    return [point(*values) for values in points.tolist()]


def dtype_from_fields(fields: Iterable[Any], point_step: int | None = None) -> np.dtype[np.void]:
    """Returns the type of a point with these fields; `point_step`: its size in bytes.

    A field with several values becomes as many: `rgb_0`, `rgb_1`. Raises `ValueError` for an
    unknown type, a field without values, or one whose name occurs twice.
    """
    names: list[str] = []
    formats: list[str] = []
    offsets: list[int] = []
    for k, field in enumerate(fields):
        if field.datatype not in _FORMATS or field.count < 1:
            raise ValueError(
                f"field '{field.name}': datatype {field.datatype}, count {field.count} is no "
                "PointField"
            )
        name, size = field.name or f"{DUMMY_FIELD_PREFIX}_{k}", int(_FORMATS[field.datatype][1])
        for i in range(field.count):
            names.append(f"{name}_{i}" if field.count > 1 else name)
            formats.append(_FORMATS[field.datatype])
            offsets.append(field.offset + i * size)
    if len(set(names)) < len(names):
        raise ValueError(f"fields with the same name: {', '.join(names)}")
    described: Any = {"names": names, "formats": formats, "offsets": offsets}
    if point_step is not None:
        described["itemsize"] = point_step
    kind: np.dtype[np.void] = np.dtype(described)
    return kind


def create_cloud(
    header: Any, fields: Sequence[Any], points: Any, point_step: int | None = None
) -> Any:
    """Returns a PointCloud2.

    points: rows of values in the order of `fields`, an array (N, fields), or a structured array
    (N,) or (width, height). Raises `ValueError` if they do not fit the fields.
    """
    kind = dtype_from_fields(fields, point_step)
    if not isinstance(points, np.ndarray):
        cast = np.array([tuple(point) for point in points], dtype=kind)
    elif points.dtype.names is None:
        if len({field.datatype for field in fields}) > 1:
            raise ValueError("the fields have several types: give a structured array")
        cast = unstructured_to_structured(points, dtype=kind)
    elif points.dtype != kind:
        raise ValueError(f"the points have the type {points.dtype}, the fields {kind}")
    else:
        cast = points
    if cast.ndim > 2:
        raise ValueError("the points of a cloud have two dimensions at most")
    width, height = cast.shape[0], cast.shape[1] if cast.ndim == 2 else 1
    return PointCloud2(
        header=header,
        height=height,
        width=width,
        fields=list(fields),
        is_bigendian=sys.byteorder == "big",
        point_step=kind.itemsize,
        row_step=kind.itemsize * width,
        data=np.frombuffer(cast.tobytes(), np.uint8),
        is_dense=False,
    )


def create_cloud_xyz32(header: Any, points: Any) -> Any:
    """Returns a PointCloud2 with x, y, z as float32; `points` is (N, 3)."""
    fields = [PointField(axis, 4 * k, PointField.FLOAT32, 1) for k, axis in enumerate("xyz")]
    return create_cloud(header, fields, points)


def _check(cloud: Any) -> None:
    if getattr(cloud, "__msgtype__", None) != PointCloud2.__msgtype__:
        raise TypeError(f"{type(cloud).__name__} is no sensor_msgs.msg.PointCloud2")


def cloud_rows(cloud: Any, kind: np.dtype[np.void]) -> Any:
    """Returns the points as (height, width), without a copy.

    Rows may be padded, and bytes may follow the last one. Raises `ValueError` if points lack.
    """
    data = cloud.data
    if not isinstance(data, np.ndarray):  # of a cloud that was not published
        data = np.frombuffer(bytes(data), np.uint8)
    length = cloud.width * kind.itemsize
    row_step = cloud.row_step if cloud.height > 1 and cloud.row_step > length else length
    needed = (cloud.height - 1) * row_step + length if cloud.width and cloud.height else 0
    if data.size < needed:
        raise ValueError(f"the cloud has {data.size} bytes, not {needed}")
    if not needed:
        return np.zeros((cloud.height, cloud.width), kind)
    plain = data.view(np.ndarray)
    return np.ndarray((cloud.height, cloud.width), kind, plain, 0, (row_step, kind.itemsize))


def contents() -> dict[str, dict[str, Any]]:
    """Returns the names and values of each module."""
    functions = (
        read_points,
        read_points_numpy,
        read_points_list,
        dtype_from_fields,
        create_cloud,
        create_cloud_xyz32,
    )
    return {
        "sensor_msgs_py": {},
        "sensor_msgs_py.numpy_compat": {"structured_to_unstructured": structured_to_unstructured},
        "sensor_msgs_py.point_cloud2": {
            "DUMMY_FIELD_PREFIX": DUMMY_FIELD_PREFIX,
            "PointCloud2": PointCloud2,
            "PointField": PointField,
            **{each.__name__: each for each in functions},
        },
    }
