"""Binding of Embree's C interface, from the library inside the `embreex` wheel.

ctypes builds scenes; compiled kernels cast packets of rays and query nearest points through
`numba.types.ExternalFunction`, which, unlike a ctypes function, lets a kernel be cached on disk.
Names, numbers and layouts are those of Embree 4's headers (`include/embree4/rtcore_*.h`, version
4.4, RTC_MAX_INSTANCE_LEVEL_COUNT = 1, instance arrays built in); `load` checks the library's
symbols, `Device` its version, and `self_test` casts a ray at a known triangle.

A packet holds LANES rays, structure of arrays: row r of lane k is float `r * LANES + k` of a
64-byte aligned block of PACKET_ROWS * LANES floats. An INVALID geometry number after a cast means
that the lane hit nothing.
"""

from __future__ import annotations

import ctypes
import importlib.util
import weakref
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from volery.core.errors import VoleryError
from volery.world.mesh import Mesh


class PaddedMesh(NamedTuple):
    """A mesh for Embree, which reads vertices 16 bytes at a time and so needs one more row."""

    vertices: NDArray[np.float32]
    """(V + 1, 3) m, the last row unused."""
    triangles: NDArray[np.uint32]
    """(T, 3) rows of `vertices`."""


def padded(mesh: Mesh) -> PaddedMesh:
    """Returns a copy of a mesh with the additional row."""
    vertices = np.zeros((len(mesh.vertices) + 1, 3), dtype=np.float32)
    vertices[:-1] = mesh.vertices
    return PaddedMesh(vertices, np.ascontiguousarray(mesh.triangles, dtype=np.uint32))


class EmbreeError(VoleryError):
    """A call of Embree failed; the message names the call and Embree's reason."""


EMBREEX_VERSION = "4.4.0.post1"
"""Version of the wheel, which determines the version of Embree and its file names."""


class EmbreeUnavailableError(EmbreeError):
    """The library or a required part of it is missing; the message names the fix."""

    def __init__(self, reason: str) -> None:
        command = f"pip install --force-reinstall embreex=={EMBREEX_VERSION}"
        super().__init__(f"{reason}; run `{command}`")


SUPPORTED_MAJOR_MINOR = (4, 4)
INVALID = 0xFFFFFFFF

QUALITY_LOW, QUALITY_MEDIUM, QUALITY_HIGH = 0, 1, 2
SCENE_DYNAMIC, SCENE_COMPACT, SCENE_ROBUST = 1, 2, 4

_GEOMETRY_TRIANGLE, _GEOMETRY_INSTANCE = 0, 121
_BUFFER_INDEX, _BUFFER_VERTEX = 0, 1
_FORMAT_UINT3, _FORMAT_FLOAT3, _FORMAT_FLOAT3X4_ROW_MAJOR = 0x5003, 0x9003, 0x9134
_PROPERTY_VERSION_MAJOR, _PROPERTY_VERSION_MINOR = 1, 2

# Rows of a packet: RTCRayN, then RTCHitN.
ORIGIN, NEAR, DIRECTION, TIME, FAR, MASK, RAY_ID, FLAGS = 0, 3, 4, 7, 8, 9, 10, 11
NORMAL, U, V, PRIMITIVE, GEOMETRY, INSTANCE, INSTANCE_PRIMITIVE = 12, 15, 16, 17, 18, 19, 20
PACKET_ROWS = 21

# Words (32 bit) of RTCPointQueryContext: two 4x4 matrices, column-major, then the instance stack.
CONTEXT_INSTANCE, CONTEXT_INSTANCE_PRIMITIVE, CONTEXT_STACK_SIZE = 32, 33, 34
CONTEXT_WORDS = 36
# RTCPointQueryFunctionArguments in 64-bit words; the third is primitive | geometry << 32.
QUERY_WORD, USER_WORD, PRIMITIVE_WORD, CONTEXT_WORD = 0, 1, 2, 3
QUERY_RADIUS = 4
"""Index of the radius in RTCPointQuery (x, y, z, time, radius)."""

LANES = 16 if llvm.get_host_cpu_features().get("avx512f", False) else 8
"""Rays per packet: 16 with AVX-512, otherwise 8."""
_INTERSECT, _OCCLUDED = f"rtcIntersect{LANES}", f"rtcOccluded{LANES}"

_CONFIG = "threads=1,set_affinity=0" + (",frequency_level=simd512" if LANES == 16 else "")
"""Device configuration: one thread; full use of AVX-512 where present (a few per cent faster)."""

# RTCIntersectArguments, 32-bit words: flags, feature mask, then pointers that stay null.
ARGUMENT_WORDS = 16
FLAGS_WORD, FEATURES_WORD = 0, 1
COHERENT = 1 << 16
"""Query flag for coherent rays, which Embree traverses together.

For the beams of a scan this halves the time with 16 lanes; scattered rays are slower with it.
"""

_P, _SIZE, _INT, _UINT = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_uint
_SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "rtcNewDevice": (_P, (ctypes.c_char_p,)),
    "rtcGetDeviceError": (_INT, (_P,)),
    "rtcGetDeviceLastErrorMessage": (ctypes.c_char_p, (_P,)),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, (_P, _INT)),
    "rtcNewScene": (_P, (_P,)),
    "rtcReleaseScene": (None, (_P,)),
    "rtcSetSceneFlags": (None, (_P, _INT)),
    "rtcSetSceneBuildQuality": (None, (_P, _INT)),
    "rtcCommitScene": (None, (_P,)),
    "rtcNewGeometry": (_P, (_P, _INT)),
    "rtcReleaseGeometry": (None, (_P,)),
    "rtcSetSharedGeometryBuffer": (None, (_P, _INT, _UINT, _INT, _P, _SIZE, _SIZE, _SIZE)),
    "rtcSetGeometryInstancedScene": (None, (_P, _P)),
    "rtcSetGeometryTransform": (None, (_P, _UINT, _INT, _P)),
    "rtcCommitGeometry": (None, (_P,)),
    "rtcAttachGeometryByID": (None, (_P, _P, _UINT)),
    "rtcDetachGeometry": (None, (_P, _UINT)),
}
_SIGNATURES[_INTERSECT] = (None, (_P, _P, _P, _P))
_CALLED_FROM_KERNELS = (_INTERSECT, _OCCLUDED, "rtcPointQuery")

intersect_packet: Any = types.ExternalFunction(
    _INTERSECT, types.void(types.intp, types.intp, types.intp, types.intp)
)
"""(valid, scene, packet, arguments): finds the closest hits of the lanes whose `valid` is -1."""
occluded_packet: Any = types.ExternalFunction(
    _OCCLUDED, types.void(types.intp, types.intp, types.intp, types.intp)
)
"""(valid, scene, packet, arguments): sets FAR of a lane that hits anything to -inf."""
point_query: Any = types.ExternalFunction(
    "rtcPointQuery",
    types.boolean(types.intp, types.intp, types.intp, types.intp, types.intp),
)
"""(scene, query, context, callback, user data)."""


def library_folder() -> Path:
    """Returns the folder of the shared libraries in the `embreex` wheel.

    Raises `EmbreeUnavailableError` if embreex is not installed.
    """
    spec = importlib.util.find_spec("embreex")
    if spec is None or spec.origin is None:
        raise EmbreeUnavailableError("the package embreex is not installed")
    return Path(spec.origin).parent.parent / "embreex.libs"


@cache
def load() -> ctypes.CDLL:
    """Loads Embree, once, for ctypes and for compiled kernels.

    Raises `EmbreeUnavailableError` if a library or symbol is missing.
    """
    folder = library_folder()
    # The wheel's tools append a hash to each library's name; Embree needs TBB, so TBB comes first.
    paths = [*sorted(folder.glob("libtbb*.so*")), *sorted(folder.glob("libembree4*.so*"))]
    if not paths or not paths[-1].name.startswith("libembree4"):
        raise EmbreeUnavailableError(f"no libembree4 in {folder}")
    try:
        for path in paths:
            library = ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
            llvm.load_library_permanently(str(path))
    except (OSError, RuntimeError) as error:
        raise EmbreeUnavailableError(f"cannot load {paths[-1]}: {error}") from error
    for name in (*_SIGNATURES, *_CALLED_FROM_KERNELS):
        try:
            function = getattr(library, name)
        except AttributeError:
            raise EmbreeUnavailableError(f"{paths[-1].name} has no symbol {name}") from None
        if name in _SIGNATURES:
            function.restype, function.argtypes = _SIGNATURES[name]
    return library


@cache
def _device() -> int:
    """Returns the device of this process, which is never released.

    Embree ends its limit of one thread with the last device. Afterwards TBB has a worker that spins
    as long as the process lives: half a core during a flight, a whole one at rest.
    """
    library = load()
    device = library.rtcNewDevice(_CONFIG.encode())
    if not device:
        code = library.rtcGetDeviceError(None)
        reason = library.rtcGetDeviceLastErrorMessage(None) or b""
        raise EmbreeUnavailableError(
            f"Embree cannot create a device (error {code}): {reason.decode() or 'no reason given'}"
        )
    return int(device)


def _release(library: ctypes.CDLL, scenes: list[int]) -> None:
    """Releases every scene; called once, by `Device.close` or when the device is collected."""
    while scenes:
        library.rtcReleaseScene(scenes.pop())


class Device:
    """Creates and owns scenes on Embree's device; checks every call.

    Uses one thread, so that the same input gives the same tree, and the same hits, each time.
    Raises `EmbreeUnavailableError` if the library's version is not supported.
    """

    def __init__(self) -> None:
        self._library = load()
        self._device = _device()
        self._scenes: list[int] = []
        self._buffers: list[NDArray[Any]] = []
        self._finalizer = weakref.finalize(self, _release, self._library, self._scenes)
        version = (self._property(_PROPERTY_VERSION_MAJOR), self._property(_PROPERTY_VERSION_MINOR))
        if version != SUPPORTED_MAJOR_MINOR:
            self.close()
            raise EmbreeUnavailableError(
                f"Embree {version[0]}.{version[1]} is not the supported "
                f"{SUPPORTED_MAJOR_MINOR[0]}.{SUPPORTED_MAJOR_MINOR[1]}"
            )

    def close(self) -> None:
        """Releases all scenes; no handle may be used afterwards."""
        self._finalizer()
        self._buffers.clear()

    def _property(self, number: int) -> int:
        return int(self._library.rtcGetDeviceProperty(self._device, number))

    def check(self, call: str) -> None:
        """Raises `EmbreeError` if Embree reports an error of the calls so far."""
        code = self._library.rtcGetDeviceError(self._device)
        if code:
            reason = self._library.rtcGetDeviceLastErrorMessage(self._device) or b""
            raise EmbreeError(f"{call} failed (Embree error {code}): {reason.decode()}")

    def new_scene(self, *, quality: int = QUALITY_HIGH, flags: int = 0) -> int:
        """Returns the handle of a new, empty scene; raises `EmbreeError` on failure."""
        scene = self._library.rtcNewScene(self._device)
        self.check("rtcNewScene")
        self._scenes.append(scene)
        self._library.rtcSetSceneBuildQuality(scene, quality)
        self._library.rtcSetSceneFlags(scene, flags)
        return int(scene)

    def attach_mesh(self, scenes: Sequence[int], number: int, mesh: PaddedMesh) -> None:
        """Adds a mesh to each of `scenes`, which share its arrays, as geometry `number`."""
        lib = self._library
        self._buffers.extend((mesh.vertices, mesh.triangles))
        geometry = lib.rtcNewGeometry(self._device, _GEOMETRY_TRIANGLE)
        buffers = (
            (_BUFFER_VERTEX, _FORMAT_FLOAT3, mesh.vertices, len(mesh.vertices) - 1),
            (_BUFFER_INDEX, _FORMAT_UINT3, mesh.triangles, len(mesh.triangles)),
        )
        for kind, layout, array, count in buffers:
            lib.rtcSetSharedGeometryBuffer(
                geometry, kind, 0, layout, array.ctypes.data, 0, 12, count
            )
        self._attach(scenes, number, geometry)
        self.check(f"adding mesh {number} to a scene")

    def attach_instances(
        self,
        scenes: Sequence[int],
        numbers: ArrayLike,
        subscenes: Sequence[int],
        transforms: ArrayLike,
    ) -> None:
        """Adds instances of committed scenes to each of `scenes`, which share them.

        numbers: (N,) geometry numbers; subscenes: N scene handles; transforms: (N, 3, 4), scene
        from sub-scene.
        """
        lib = self._library
        matrices = np.ascontiguousarray(transforms, dtype=np.float32).reshape(-1, 3, 4)
        address = matrices.ctypes.data
        identities = np.asarray(numbers).tolist()
        for i, (number, subscene) in enumerate(zip(identities, subscenes, strict=True)):
            geometry = lib.rtcNewGeometry(self._device, _GEOMETRY_INSTANCE)
            lib.rtcSetGeometryInstancedScene(geometry, subscene)
            lib.rtcSetGeometryTransform(geometry, 0, _FORMAT_FLOAT3X4_ROW_MAJOR, address + 48 * i)
            self._attach(scenes, number, geometry)
        self.check("adding instances to a scene")

    def _attach(self, scenes: Sequence[int], number: int, geometry: int) -> None:
        self._library.rtcCommitGeometry(geometry)
        for scene in scenes:
            self._library.rtcAttachGeometryByID(scene, geometry, number)
        self._library.rtcReleaseGeometry(geometry)  # the scene holds it now

    def detach_mesh(self, scenes: Sequence[int], number: int, mesh: PaddedMesh) -> None:
        """Detaches geometry `number`, which holds `mesh`, from each of `scenes`; releases it."""
        for scene in scenes:
            self._library.rtcDetachGeometry(scene, number)
        self.check(f"removing mesh {number} from a scene")
        own = mesh.vertices, mesh.triangles
        self._buffers = [b for b in self._buffers if not any(b is array for array in own)]

    def commit(self, scene: int) -> None:
        """Builds the scene's search tree; required before casting."""
        self._library.rtcCommitScene(scene)
        self.check("rtcCommitScene")


def aligned(shape: tuple[int, ...], kind: type = np.float32) -> NDArray[Any]:
    """Returns zeros of `shape` (32-bit numbers), aligned to 64 bytes."""
    count = int(np.prod(shape))
    raw: NDArray[Any] = np.zeros(count + 16, dtype=kind)
    start = (-raw.ctypes.data // 4) % 16
    return raw[start : start + count].reshape(shape)


def coherent_arguments() -> NDArray[np.int32]:
    """Returns the arguments for coherent packets; pass 0 for the default ones."""
    arguments = aligned((ARGUMENT_WORDS,), np.int32)
    arguments[FLAGS_WORD] = COHERENT
    arguments[FEATURES_WORD] = -1
    return arguments


def _cast_one(scene: int, x: float, y: float) -> tuple[float, int, int]:
    """Returns distance, geometry and instance number of a ray downward from (x, y, 1)."""
    packet = aligned((PACKET_ROWS, LANES))
    words = packet.view(np.uint32)
    valid = aligned((LANES,), np.int32)
    valid[0] = -1
    packet[ORIGIN : ORIGIN + 3, 0] = (x, y, 1.0)
    packet[DIRECTION + 2, 0] = -1.0
    packet[FAR, 0] = 10.0
    words[[MASK, GEOMETRY, INSTANCE], 0] = INVALID
    intersect = getattr(load(), _INTERSECT)
    intersect(valid.ctypes.data, scene, packet.ctypes.data, None)
    return float(packet[FAR, 0]), int(words[GEOMETRY, 0]), int(words[INSTANCE, 0])


def self_test(device: Device) -> None:
    """Casts at a known instance of a known triangle, which detects changed layouts.

    Raises `EmbreeUnavailableError` if the result is wrong.
    """
    triangle = Mesh(
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32), np.array([[0, 1, 2]], np.uint32)
    )
    part = device.new_scene()
    device.attach_mesh([part], 3, padded(triangle))
    device.commit(part)
    scene = device.new_scene()
    lowered = np.array([[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, -0.5]])
    device.attach_instances([scene], [7], [part], lowered)
    device.commit(scene)
    hit, miss = _cast_one(scene, 5.2, 0.3), _cast_one(scene, 4.2, 0.3)
    if abs(hit[0] - 1.5) > 1e-6 or hit[1:] != (3, 7) or miss[1] != INVALID:
        raise EmbreeUnavailableError("Embree's ray packets are not laid out as expected")
