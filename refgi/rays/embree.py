"""Two backends of Embree: its C functions called by address, and embreex's own `run`.

The wheel of embreex carries Embree's shared library. Called by address, its functions cost nothing beyond the
traversal: kernels keep sixteen rays at hand, no arrays are allocated, and a mesh is shared with Embree as it lies in
memory (embreex copies it vertex by vertex in Python, 0.1 s per 100k triangles). `run` needs nothing but embreex
itself. Both take the same float32 triangles in the same order with the robust flag, hence give the same answers.

Of triangles with holes Embree asks a filter (`cutouts`); they are a mesh of their own, so that others are not asked
for. `run` knows no filters: there a ray that meets a hole is started anew behind it.
"""

import ctypes
import os
import weakref
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from refgi.jit import thread_count
from refgi.rays.cutouts import Filter, RayHoles, mark_holes
from refgi.rays.traversal import Calls, closest_hits, occlusions
from refgi.rays.watertight import STEPS
from refgi.types import Array

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


class Cut(NamedTuple):
    """Which of the triangles may have holes: the last ones."""

    holes: RayHoles
    numbers: Array  # (p,) int: which of `holes` each of the last p triangles is
    grain: float  # the tracer's, m


def open_backend(vertices: Array, faces: Array, cut: Cut | None = None) -> Backend:
    """Build Embree's tree over triangles and return the fastest backend that works here.

    `vertices` (n, 3) float32: vertices, world space, m. `faces` (m, 3) int32: vertex indices; at least one face. `cut`:
    which of them may have holes. Result: by address, or by `run` where `REFGI_EMBREE=run` or the library is not found.
    """
    library = None if os.environ.get("REFGI_EMBREE") == "run" else _library()
    return RunBackend(vertices, faces, cut) if library is None else AddressBackend(library, vertices, faces, cut)


class AddressBackend:
    """Embree's C functions, called by address from compiled kernels.

    `vertices`: (n, 3) float32, world space, m; `faces`: (m, 3) int32; `cut`: which of them may have holes.
    """

    def __init__(self, library: ctypes.CDLL, vertices: Array, faces: Array, cut: Cut | None = None) -> None:
        whole = len(faces) - (0 if cut is None else len(cut.numbers))
        # shared with Embree: keep alive
        self._buffers = (_padded(vertices, np.float32), _padded(faces[:whole], np.uint32),
                         _padded(faces[whole:], np.uint32))
        self._filter = None if cut is None else Filter(cut.holes, cut.numbers)
        meshes = [_Mesh(self._buffers[1], whole), _Mesh(self._buffers[2], len(faces) - whole, self._filter)]
        device, scene = _build(library, self._buffers[0], len(vertices), [mesh for mesh in meshes if mesh.size])
        self.calls = Calls(_address(library.rtcIntersect16), _address(library.rtcOccluded16), np.uint64(scene),
                           whole if whole < len(faces) else 0)
        weakref.finalize(self, _release, library, device, scene)

    def closest(self, origins: Array, directions: Array, reach: Array, triangle_id: Array, distance: Array) -> None:
        """Fill triangle ids and distances of the nearest hits before `reach`."""
        closest_hits(self.calls, origins, directions, reach, triangle_id, distance)

    def occluded(self, origins: Array, directions: Array, reach: Array, blocked: Array) -> None:
        """Fill whether anything lies before `reach`; rays of `reach` <= 0 count as blocked, untraced."""
        occlusions(self.calls, origins, directions, reach, blocked)


class RunBackend:
    """embreex's `run`, which releases the GIL, on as many Python threads as Numba uses; arrays as in `AddressBackend`.

    Where memory runs out embreex traces what Embree has not built and the process may end; only calls by address are
    asked for their errors.
    """

    def __init__(self, vertices: Array, faces: Array, cut: Cut | None = None) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._cut, self._whole = cut, len(faces) - (0 if cut is None else len(cut.numbers))
        self._scene = EmbreeScene(robust=True)
        self._mesh = TriangleMesh(self._scene, np.ascontiguousarray(vertices, np.float32),
                                  np.ascontiguousarray(faces, np.int32))
        one = np.ones((1, 3), np.float32)
        self._scene.run(one, one)  # the first run builds the tree and takes no lock

    def closest(self, origins: Array, directions: Array, reach: Array, triangle_id: Array, distance: Array) -> None:
        """Fill triangle ids and distances of the nearest hits before `reach`."""
        self._nearest(origins, directions, reach, triangle_id, distance)
        if self._cut is not None:
            self._pass_holes(self._cut, origins, directions, reach, triangle_id, distance)

    def _pass_holes(self, cut: Cut, origins: Array, directions: Array, reach: Array, triangle_id: Array,
                    distance: Array) -> None:
        """Start rays anew behind the holes that they meet, as far as from a surface, until none meets one."""
        rays = np.flatnonzero(triangle_id >= self._whole)
        while len(rays):
            hole = np.empty(len(rays), np.bool_)
            mark_holes(cut.holes, cut.numbers[triangle_id[rays] - self._whole], origins[rays], directions[rays], hole)
            rays = rays[hole]
            along, t = directions[rays].astype(np.float64), distance[rays].astype(np.float64)[:, None]
            place = origins[rays] + t * along
            t += STEPS * (np.abs(place).sum(axis=1, keepdims=True) + cut.grain) / np.linalg.norm(
                along, axis=1, keepdims=True)
            start, left = (origins[rays] + t * along).astype(np.float32), (reach[rays] - t[:, 0]).astype(np.float32)
            found, far = np.empty(len(rays), np.int32), np.empty(len(rays), np.float32)
            self._nearest(start, directions[rays], left, found, far)
            triangle_id[rays], distance[rays] = found, far + t[:, 0]
            rays = rays[found >= self._whole]

    def _nearest(self, origins: Array, directions: Array, reach: Array, triangle_id: Array, distance: Array) -> None:
        def fill(rays: slice) -> None:
            dists = np.maximum(reach[rays], 0)  # `run` writes hit distances into this array
            found = self._scene.run(origins[rays], directions[rays], dists=dists, query="INTERSECT", output=True)
            hit = found["primID"] != MISS
            triangle_id[rays] = np.where(hit, found["primID"], MISS)
            distance[rays] = np.where(hit, found["tfar"], np.inf)

        self._share(fill, len(origins))

    def occluded(self, origins: Array, directions: Array, reach: Array, blocked: Array) -> None:
        """Fill whether anything lies before `reach`; rays of `reach` <= 0 count as blocked, untraced."""
        if self._cut is not None:
            triangle_id, distance = np.empty(len(origins), np.int32), np.empty(len(origins), np.float32)
            self.closest(origins, directions, reach, triangle_id, distance)
            np.logical_or(triangle_id != MISS, reach <= 0, out=blocked)
            return

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
        with ThreadPoolExecutor(thread_count()) as pool:
            list(pool.map(fill, pieces))


class _Mesh(NamedTuple):
    faces: Array  # as Embree reads them
    size: int  # triangles
    filter: Filter | None = None


class _Built(NamedTuple):
    device: int
    scene: int


def _build(library: ctypes.CDLL, vertices: Array, vertex_count: int, meshes: Sequence[_Mesh]) -> _Built:
    """Build the tree. Embree reports a failed call only through rtcGetDeviceError; what it left must not be traced."""
    count = sum(mesh.size for mesh in meshes)
    device, scene = library.rtcNewDevice(None), None
    try:
        _check(library, device, count)
        scene = _made(library, device, count, library.rtcNewScene(device))
        library.rtcSetSceneFlags(scene, _ROBUST)
        for mesh in meshes:
            _attach(library, device, scene, (vertices, vertex_count), mesh, count)
        library.rtcCommitScene(scene)
        _check(library, device, count)
    except BaseException:
        _release(library, device, scene)
        raise
    return _Built(device, scene)


def _attach(
    library: ctypes.CDLL, device: int, scene: int, vertices: tuple[Array, int], mesh: _Mesh, total: int
) -> None:
    """Add a mesh to the scene, numbered in the order of calls."""
    geometry = _made(library, device, total, library.rtcNewGeometry(device, _TRIANGLES))
    try:
        for kind, form, array, count in ((_VERTICES, _FLOAT3, *vertices), (_INDICES, _UINT3, mesh.faces, mesh.size)):
            library.rtcSetSharedGeometryBuffer(geometry, kind, 0, form, array.ctypes.data, 0, 12, count)
            _check(library, device, total)
        if mesh.filter is not None:
            library.rtcSetGeometryUserData(geometry, mesh.filter.record)
            library.rtcSetGeometryIntersectFilterFunction(geometry, mesh.filter.function)
            library.rtcSetGeometryOccludedFilterFunction(geometry, mesh.filter.function)
            _check(library, device, total)
        library.rtcCommitGeometry(geometry)
        _check(library, device, total)
        library.rtcAttachGeometry(scene, geometry)
        _check(library, device, total)
    finally:
        library.rtcReleaseGeometry(geometry)


def _made(library: ctypes.CDLL, device: int | None, face_count: int, handle: int | None) -> int:
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
        ("rtcSetGeometryUserData", None, [pointer, pointer]),
        ("rtcSetGeometryIntersectFilterFunction", None, [pointer, pointer]),
        ("rtcSetGeometryOccludedFilterFunction", None, [pointer, pointer]),
        ("rtcCommitGeometry", None, [pointer]),
        ("rtcAttachGeometry", unsigned, [pointer, pointer]),
        ("rtcReleaseGeometry", None, [pointer]),
        ("rtcCommitScene", None, [pointer]),
        ("rtcReleaseScene", None, [pointer]),
        ("rtcReleaseDevice", None, [pointer]),
        ("rtcIntersect16", None, [pointer, pointer, pointer, pointer]),
        ("rtcOccluded16", None, [pointer, pointer, pointer, pointer]),
    ):
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library
