"""Two backends of Embree: its C functions called by address, and embreex's own `run`.

The wheel of embreex carries Embree's shared library. Called by address, its functions cost nothing beyond the
traversal: kernels keep one ray on the stack, no arrays are allocated, and a mesh is shared with Embree as it lies in
memory (embreex copies it vertex by vertex in Python, 0.1 s per 100k triangles). `run` needs nothing but embreex
itself. Both take the same float32 triangles in the same order with the robust flag, hence give the same answers.
"""

import ctypes
import os
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numba
import numpy as np
import numpy.typing as npt

from refgi.rays.traversal import Calls, closest_hits, occlusions

Array = npt.NDArray[Any]

MISS = -1  # triangle id of a ray that hits nothing

_TRIANGLES, _INDICES, _VERTICES = 0, 0, 1
_UINT3, _FLOAT3 = 0x5003, 0x9003
_ROBUST = 4
_OUT_OF_MEMORY = 4  # of RTCError
_RUN_CHUNK = 1 << 18  # rays per call of `run`: its temporary arrays stay in cache


class Backend(Protocol):
    """Traces batches of float32 rays with Embree."""

    def closest(self, origins: Array, directions: Array, reach: Array, triangle_id: Array, distance: Array) -> None:
        """Fill triangle ids and distances of the nearest hits before `reach`."""

    def occluded(self, origins: Array, directions: Array, reach: Array, blocked: Array) -> None:
        """Fill whether anything lies before `reach`; rays of `reach` <= 0 count as blocked, untraced."""


def open_backend(vertices: Array, faces: Array) -> Backend:
    """Build Embree's tree over triangles and return the fastest backend that works here.

    `vertices` (n, 3) float32: vertices, world space, m. `faces` (m, 3) int32: vertex indices; at least one face.
    Result: by address, or by `run` where `REFGI_EMBREE=run` or the library is not found.
    """
    library = None if os.environ.get("REFGI_EMBREE") == "run" else _library()
    return RunBackend(vertices, faces) if library is None else AddressBackend(library, vertices, faces)


class AddressBackend:
    """Embree's C functions, called by address from compiled kernels.

    Parameters
    ----------
    library : ctypes.CDLL
        Embree.
    vertices : (n, 3) float32 ndarray
        Vertices, world space, m.
    faces : (m, 3) int32 ndarray
        Vertex indices.
    """

    def __init__(self, library: ctypes.CDLL, vertices: Array, faces: Array) -> None:
        self._buffers = (_padded(vertices, np.float32), _padded(faces, np.uint32))  # shared with Embree: keep alive
        device, scene = _build(library, *self._buffers, len(vertices), len(faces))
        self.calls = Calls(_address(library.rtcIntersect1), _address(library.rtcOccluded1), np.uint64(scene))
        weakref.finalize(self, _release, library, device, scene)

    def closest(self, origins: Array, directions: Array, reach: Array, triangle_id: Array, distance: Array) -> None:
        """Fill triangle ids and distances of the nearest hits before `reach`."""
        closest_hits(self.calls, origins, directions, reach, triangle_id, distance)

    def occluded(self, origins: Array, directions: Array, reach: Array, blocked: Array) -> None:
        """Fill whether anything lies before `reach`; rays of `reach` <= 0 count as blocked, untraced."""
        occlusions(self.calls, origins, directions, reach, blocked)


class RunBackend:
    """embreex's `run`, which releases the GIL, on as many Python threads as Numba uses.

    Where memory runs out embreex traces what Embree has not built and the process may end; only calls by address are
    asked for their errors.

    Parameters
    ----------
    vertices : (n, 3) float32 ndarray
        Vertices, world space, m.
    faces : (m, 3) int32 ndarray
        Vertex indices.
    """

    def __init__(self, vertices: Array, faces: Array) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._scene = EmbreeScene(robust=True)
        self._mesh = TriangleMesh(self._scene, np.ascontiguousarray(vertices, np.float32),
                                  np.ascontiguousarray(faces, np.int32))
        one = np.ones((1, 3), np.float32)
        self._scene.run(one, one)  # the first run builds the tree and takes no lock

    def closest(self, origins: Array, directions: Array, reach: Array, triangle_id: Array, distance: Array) -> None:
        """Fill triangle ids and distances of the nearest hits before `reach`."""

        def fill(rays: slice) -> None:
            dists = np.maximum(reach[rays], 0)  # `run` writes hit distances into this array
            found = self._scene.run(origins[rays], directions[rays], dists=dists, query="INTERSECT", output=True)
            hit = found["primID"] != MISS
            triangle_id[rays] = np.where(hit, found["primID"], MISS)
            distance[rays] = np.where(hit, found["tfar"], np.inf)

        self._share(fill, len(origins))

    def occluded(self, origins: Array, directions: Array, reach: Array, blocked: Array) -> None:
        """Fill whether anything lies before `reach`; rays of `reach` <= 0 count as blocked, untraced."""

        def fill(rays: slice) -> None:
            traced = np.flatnonzero(reach[rays] > 0) + rays.start
            blocked[rays] = True
            if len(traced):
                answers = self._scene.run(origins[traced], directions[traced], dists=reach[traced], query="OCCLUDED")
                blocked[traced] = answers != MISS

        self._share(fill, len(origins))

    @staticmethod
    def _share(fill: Callable[[slice], None], count: int) -> None:
        pieces = [slice(i, min(i + _RUN_CHUNK, count)) for i in range(0, count, _RUN_CHUNK)]
        with ThreadPoolExecutor(numba.get_num_threads()) as pool:
            list(pool.map(fill, pieces))


class _Built(NamedTuple):
    device: int
    scene: int


def _build(library: ctypes.CDLL, vertices: Array, faces: Array, vertex_count: int, face_count: int) -> _Built:
    """Build the tree. Embree reports a failed call only through rtcGetDeviceError; what it left must not be traced."""
    device, scene, geometry = library.rtcNewDevice(None), None, None
    try:
        _check(library, device, face_count)
        scene = _made(library, device, face_count, library.rtcNewScene(device))
        library.rtcSetSceneFlags(scene, _ROBUST)
        geometry = _made(library, device, face_count, library.rtcNewGeometry(device, _TRIANGLES))
        for kind, form, array, count in ((_VERTICES, _FLOAT3, vertices, vertex_count),
                                         (_INDICES, _UINT3, faces, face_count)):
            library.rtcSetSharedGeometryBuffer(geometry, kind, 0, form, array.ctypes.data, 0, 12, count)
            _check(library, device, face_count)
        for call, arguments in ((library.rtcCommitGeometry, (geometry,)),
                                (library.rtcAttachGeometry, (scene, geometry)), (library.rtcCommitScene, (scene,))):
            call(*arguments)
            _check(library, device, face_count)
    except BaseException:
        _release(library, device, scene)
        raise
    finally:
        if geometry:
            library.rtcReleaseGeometry(geometry)
    return _Built(device, scene)


def _made(library: ctypes.CDLL, device: int | None, face_count: int, handle: int | None) -> int:
    """Return a handle that Embree has made."""
    _check(library, device, face_count)
    if not handle:
        raise MemoryError(_out_of_memory(face_count))
    return handle


def _check(library: ctypes.CDLL, device: int | None, face_count: int) -> None:
    """Raise if the call before failed."""
    error = library.rtcGetDeviceError(device)
    if error == _OUT_OF_MEMORY or (not device and not error):
        raise MemoryError(_out_of_memory(face_count))
    if error:
        raise RuntimeError(f"Embree cannot build a tree over {face_count:,} triangles (its error {error})")


def _out_of_memory(face_count: int) -> str:
    return f"Embree's tree over {face_count:,} triangles does not fit"


def _release(library: ctypes.CDLL, device: int | None, scene: int | None) -> None:
    if scene:
        library.rtcReleaseScene(scene)
    if device:
        library.rtcReleaseDevice(device)


def _padded(array: Array, dtype: npt.DTypeLike) -> Array:
    """Return a flat copy with 16 bytes to spare: Embree reads whole vectors."""
    flat = np.zeros(array.size + 4, dtype)
    flat[: array.size] = array.reshape(-1)
    return flat


def _address(function: Any) -> np.uint64:
    return np.uint64(ctypes.cast(function, ctypes.c_void_p).value or 0)


@cache
def _library() -> ctypes.CDLL | None:
    """Load the library that embreex itself uses, or return None where it lies elsewhere."""
    import embreex.rtcore_scene  # loads the library with its own dependencies

    home = Path(embreex.rtcore_scene.__file__).parent
    folders = (home.parent / "embreex.libs", home / ".dylibs", home)
    for path in (found for folder in folders for found in sorted(folder.glob("*embree4*"))):
        try:
            return _declared(ctypes.CDLL(str(path)))
        except (OSError, AttributeError):
            continue
    return None


def _declared(library: ctypes.CDLL) -> ctypes.CDLL:
    pointer, unsigned, size = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
    for name, result, arguments in (
        ("rtcNewDevice", pointer, [ctypes.c_char_p]),
        ("rtcGetDeviceError", ctypes.c_int, [pointer]),
        ("rtcNewScene", pointer, [pointer]),
        ("rtcSetSceneFlags", None, [pointer, ctypes.c_int]),
        ("rtcNewGeometry", pointer, [pointer, ctypes.c_int]),
        ("rtcSetSharedGeometryBuffer", None,
         [pointer, ctypes.c_int, unsigned, ctypes.c_int, pointer, size, size, size]),
        ("rtcCommitGeometry", None, [pointer]),
        ("rtcAttachGeometry", unsigned, [pointer, pointer]),
        ("rtcReleaseGeometry", None, [pointer]),
        ("rtcCommitScene", None, [pointer]),
        ("rtcReleaseScene", None, [pointer]),
        ("rtcReleaseDevice", None, [pointer]),
        ("rtcIntersect1", None, [pointer, pointer, pointer]),
        ("rtcOccluded1", None, [pointer, pointer, pointer]),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library
