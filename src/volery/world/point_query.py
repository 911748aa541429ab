"""Compiled nearest-point queries: the exact nearest point of any triangle to a point of the map.

Embree traverses its search tree and calls back for every candidate triangle; the callback is
compiled, so no Python runs. Distances are computed in the map frame, in double precision, and are
therefore exact for trees with different scales of height and width, too.
"""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from volery.core.compiled import compiled_callback, inner_kernel, kernel, owning_kernel
from volery.world.embree import (
    CONTEXT_INSTANCE,
    CONTEXT_INSTANCE_PRIMITIVE,
    CONTEXT_STACK_SIZE,
    CONTEXT_WORD,
    CONTEXT_WORDS,
    INVALID,
    PRIMITIVE_WORD,
    QUERY_RADIUS,
    QUERY_WORD,
    USER_WORD,
    aligned,
    point_query,
)

_carray: Any = vars(numba)["carray"]
_INVALID = np.uint32(INVALID)
_FAR_AWAY_M = 1e7
# State of a query, 64-bit floats: point, squared distance, nearest point, instance.
_POINT, _SQUARED, _NEAREST, _INSTANCE, _STATE_WORDS = 0, 3, 4, 7, 8


class TriangleTable(NamedTuple):
    """Addresses of the triangles of a scene's instances."""

    vertices: NDArray[np.int64]
    """(parts,) address of a part's vertices, float32 triples."""
    triangles: NDArray[np.int64]
    """(parts,) address of a part's triangles, uint32 triples."""
    length: NDArray[np.int64]
    """(parts,) number of triangles."""
    first_part: NDArray[np.int64]
    """(instances + 1,) parts of instance i are first_part[i] .. first_part[i] + part_count[i]."""
    part_count: NDArray[np.int64]
    """(instances,) number of parts."""
    transform: NDArray[np.float64]
    """(instances, 12) rows of the 3x4 matrix, map from instance."""


class QueryMemory(NamedTuple):
    """Memory that Embree and the callback use during a query."""

    query: NDArray[np.float32]
    context: NDArray[np.uint32]
    state: NDArray[np.float64]
    user: NDArray[np.int64]


_own = threading.local()


def query_memory() -> QueryMemory:
    """Returns the calling thread's memory for queries, reused between calls."""
    memory: QueryMemory | None = _own.__dict__.get("memory")
    if memory is None:
        memory = _own.memory = new_query_memory()
    return memory


def new_query_memory() -> QueryMemory:
    """Allocates memory for one thread's queries."""
    return QueryMemory(
        aligned((16,)),
        aligned((CONTEXT_WORDS,), np.uint32),
        np.zeros(_STATE_WORDS),
        np.zeros(6, dtype=np.int64),
    )


@intrinsic
def _make_pointer(_context: Any, _address: Any) -> Any:
    """Returns a pointer with that address."""

    def generate(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(types.voidptr))

    return types.voidptr(types.intp), generate


_pointer: Any = _make_pointer


@inner_kernel
def instance_of(number: Any, trees: Any) -> Any:
    """Returns the scene instance of one of Embree's geometry numbers.

    The ground is 0 and the feet of trees 1..T, as in the scene; then follow the crowns of the same
    trees, then the solids.
    """
    return number - trees if number > trees else number


@inner_kernel
def _nearest_on_triangle(
    point: tuple[float, float, float],
    a: tuple[float, float, float],
    b: tuple[float, float, float],
    c: tuple[float, float, float],
) -> tuple[float, float, float]:
    """Returns the nearest point of a triangle, by the regions of its corners, edges and face.

    C. Ericson, Real-Time Collision Detection, 2005, section 5.1.5.
    """
    abx, aby, abz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    acx, acy, acz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    px, py, pz = point[0] - a[0], point[1] - a[1], point[2] - a[2]
    d1 = abx * px + aby * py + abz * pz
    d2 = acx * px + acy * py + acz * pz
    if d1 <= 0.0 and d2 <= 0.0:
        return a
    px, py, pz = point[0] - b[0], point[1] - b[1], point[2] - b[2]
    d3 = abx * px + aby * py + abz * pz
    d4 = acx * px + acy * py + acz * pz
    if d3 >= 0.0 and d4 <= d3:
        return b
    px, py, pz = point[0] - c[0], point[1] - c[1], point[2] - c[2]
    d5 = abx * px + aby * py + abz * pz
    d6 = acx * px + acy * py + acz * pz
    if d6 >= 0.0 and d5 <= d6:
        return c
    v, w = 0.0, 0.0
    vc = d1 * d4 - d3 * d2
    vb = d5 * d2 - d1 * d6
    va = d3 * d6 - d5 * d4
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3) if d1 > d3 else 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6) if d2 > d6 else 0.0
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        whole = (d4 - d3) + (d5 - d6)
        w = (d4 - d3) / whole if whole > 0.0 else 0.0
        v = 1.0 - w
    else:
        whole = va + vb + vc
        if whole > 0.0:
            v = vb / whole
            w = vc / whole
    return a[0] + v * abx + w * acx, a[1] + v * aby + w * acy, a[2] + v * abz + w * acz


@inner_kernel
def _corner(
    vertices: NDArray[np.float32], row: int, m: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Returns vertex `row` in the map."""
    x, y, z = float(vertices[row, 0]), float(vertices[row, 1]), float(vertices[row, 2])
    return (
        m[0] * x + m[1] * y + m[2] * z + m[3],
        m[4] * x + m[5] * y + m[6] * z + m[7],
        m[8] * x + m[9] * y + m[10] * z + m[11],
    )


@owning_kernel
def _try_triangle(
    state: NDArray[np.float64],
    vertices_address: int,
    triangles_address: int,
    triangle: int,
    matrix: NDArray[np.float64],
    instance: int,
) -> bool:
    """Stores the triangle's nearest point if nearer than that in `state`; returns whether it is."""
    corners = _carray(_pointer(triangles_address + 12 * triangle), (3,), np.uint32)
    # The number of vertices is not known here and not needed: rows are read by address.
    vertices = _carray(_pointer(vertices_address), (1 << 32, 3), np.float32)
    point = (state[_POINT], state[_POINT + 1], state[_POINT + 2])
    x, y, z = _nearest_on_triangle(
        point,
        _corner(vertices, corners[0], matrix),
        _corner(vertices, corners[1], matrix),
        _corner(vertices, corners[2], matrix),
    )
    squared = (x - point[0]) ** 2 + (y - point[1]) ** 2 + (z - point[2]) ** 2
    if squared >= state[_SQUARED]:
        return False
    state[_SQUARED] = squared
    state[_NEAREST], state[_NEAREST + 1], state[_NEAREST + 2] = x, y, z
    state[_INSTANCE] = instance
    return True


def _consider(arguments: Any) -> bool:
    """Embree's callback for one triangle; reduces the query's radius if it is nearer."""
    words = _carray(arguments, (4,), np.int64)
    # User data: addresses of state, vertices, triangles, first_part, transform; then the trees.
    user = _carray(_pointer(words[USER_WORD]), (6,), np.int64)
    state = _carray(_pointer(user[0]), (_STATE_WORDS,), np.float64)
    context = _carray(_pointer(words[CONTEXT_WORD]), (CONTEXT_WORDS,), np.uint32)
    triangle = words[PRIMITIVE_WORD] & 0xFFFFFFFF
    part = (words[PRIMITIVE_WORD] >> 32) & 0xFFFFFFFF
    instance: Any = np.int64(context[CONTEXT_INSTANCE])
    if context[CONTEXT_STACK_SIZE] == 0:
        instance, part = part, 0
    instance = instance_of(instance, user[5])
    part += _carray(_pointer(user[3] + 8 * instance), (1,), np.int64)[0]
    vertices = _carray(_pointer(user[1] + 8 * part), (1,), np.int64)[0]
    triangles = _carray(_pointer(user[2] + 8 * part), (1,), np.int64)[0]
    matrix = _carray(_pointer(user[4] + 96 * instance), (12,), np.float64)
    if not _try_triangle(state, vertices, triangles, triangle, matrix, instance):
        return False
    query = _carray(_pointer(words[QUERY_WORD]), (5,), np.float32)
    query[QUERY_RADIUS] = np.sqrt(state[_SQUARED]) * (1.0 + 1e-6)
    return True


_compiled: list[Any] = []


def callback_address() -> int:
    """Returns the address of the compiled callback, compiling or loading it at first use."""
    if not _compiled:
        _compiled.append(compiled_callback(_consider, types.boolean(types.voidptr)))
    return int(_compiled[0].address)


def world_row(table: TriangleTable, trees: int) -> NDArray[np.int64]:
    """Returns the row (5,) of a world with `trees` trees for `nearest_points`.

    It holds addresses of the table's arrays, which must be kept.
    """
    arrays = table.vertices, table.triangles, table.first_part, table.transform
    return np.array([*(array.ctypes.data for array in arrays), trees], np.int64)


@kernel
def nearest_points(
    scenes: NDArray[np.int64],
    callback: int,
    tables: NDArray[np.int64],
    worlds: NDArray[np.int32],
    points: NDArray[np.float64],
    max_distance: float,
    memory: QueryMemory,
    distance: NDArray[np.float64],
    nearest: NDArray[np.float64],
    instance: NDArray[np.int32],
) -> None:
    """Finds the nearest point of an Embree scene to each of `points` (P, 3) m, map.

    scenes, tables: (W,) Embree scenes of W worlds and (W, 5) their `world_row`s. worlds: (P,) the
    world of each point; (0,): the first for all. Fills `distance` (P,), `nearest` (P, 3) and
    `instance` (P,), with `max_distance`, the point itself and -1 where nothing is within it.
    """
    query, context, state, user = memory
    user[0] = state.ctypes.data
    limit = min(max_distance, _FAR_AWAY_M)
    for i in range(points.shape[0]):
        for j in range(3):
            query[j] = points[i, j]
            state[_POINT + j] = points[i, j]
            state[_NEAREST + j] = points[i, j]
        query[3] = 0.0
        # The query's own point is rounded to 32 bits: the radius includes that error.
        query[QUERY_RADIUS] = limit * (1.0 + 1e-6) + 1e-4
        state[_SQUARED] = limit * limit
        state[_INSTANCE] = -1.0
        context[CONTEXT_INSTANCE] = _INVALID
        context[CONTEXT_INSTANCE_PRIMITIVE] = _INVALID
        context[CONTEXT_STACK_SIZE] = 0
        world = worlds[i] if worlds.shape[0] > 0 else 0
        for j in range(5):
            user[1 + j] = tables[world, j]
        point_query(
            scenes[world], query.ctypes.data, context.ctypes.data, callback, user.ctypes.data
        )
        instance[i] = int(state[_INSTANCE])
        distance[i] = np.sqrt(state[_SQUARED]) if instance[i] >= 0 else max_distance
        for j in range(3):
            nearest[i, j] = state[_NEAREST + j]
