"""The rasterizer against Embree's packets of rays through the same pixels and against llvmpipe.

Packets of coherent rays (`embree_packets`, over a prebuilt hierarchy) and OpenGL in software (`llvmpipe`, where
moderngl is installed) run on all threads, as the rasterizer does, which starts from the triangles each time. Scenes are
`stage`, whose vase has interpolated vertex normals, and `atrium`, which has none. Pairs are interleaved; a ratio is the
median over pairs, with the least and the greatest in the note.
"""

import ctypes
import importlib.util
import math
import os
from collections.abc import Iterator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from benchmarks.harness import Ratio, Row, ratio
from refgi.jit import kernel, prange
from refgi.rays import embree
from refgi.rsm import camera_projection, gbuffer, rasterize
from refgi.rsm.raster.projection import Projection
from refgi.scene import Geometry, Scene, load_scene, material_table
from refgi.types import Array

WIDE, HIGH, LANES = 4, 2, 8
# rows of a packet: origin, tnear, direction, time, tfar, mask, id, flags; normal, u, v, triangle, geometry, 2 instances
ROWS, DIRECTION, REACH, MASK, HIT, GEOMETRY = 21, 4, 8, 9, 17, 18
ARGUMENTS = 64  # bytes: flags of RTCIntersectArguments, of which bit 16 says that rays are coherent
COHERENT = 1 << 16
SHARE = 64  # packets that one parallel iteration traces


def _call_by_address(_: Any, function: Any, valid: Any, scene: Any, packet: Any, arguments: Any) -> Any:  # noqa: ARG001
    """Type and emit a call of `void function(valid, scene, packet, arguments)`."""

    def generate(context: Any, builder: Any, _: Any, values: Any) -> Any:
        byte = ir.IntType(8).as_pointer()
        target = builder.inttoptr(values[0], ir.FunctionType(ir.VoidType(), [byte] * 4).as_pointer())
        builder.call(target, [builder.inttoptr(value, byte) for value in values[1:]])
        return context.get_dummy_value()

    return types.void(*[types.uint64] * 5), generate


_call: Any = intrinsic(_call_by_address)


@kernel(parallel=True)
def _trace(function: int, scene: int, arguments: int, rays: Array, triangle_id: Array, distance: Array) -> None:
    packets = len(rays)
    for share in prange((packets + SHARE - 1) // SHARE):
        block = np.empty(ROWS * LANES + 16, np.float32)
        skip = (64 - np.int64(block.ctypes.data) % 64) // 4 % 16  # packets are aligned
        packet = block[skip : skip + ROWS * LANES]
        bits, valid = packet.view(np.int32), np.full(16, -1, np.int32)
        for p in range(share * SHARE, min((share + 1) * SHARE, packets)):
            for lane in range(LANES):
                for axis in range(3):
                    packet[axis * LANES + lane] = rays[p, axis, lane]
                    packet[(DIRECTION + axis) * LANES + lane] = rays[p, 3 + axis, lane]
                packet[3 * LANES + lane], packet[7 * LANES + lane] = 0.0, 0.0
                packet[REACH * LANES + lane], bits[MASK * LANES + lane] = np.inf, -1
                bits[(MASK + 1) * LANES + lane], bits[(MASK + 2) * LANES + lane] = 0, 0
                bits[HIT * LANES + lane], bits[GEOMETRY * LANES + lane] = -1, -1
            _call(function, np.uint64(valid.ctypes.data), scene, np.uint64(packet.ctypes.data), arguments)
            for lane in range(LANES):
                triangle_id[p, lane], distance[p, lane] = bits[HIT * LANES + lane], packet[REACH * LANES + lane]


class Packets:
    """The rays of one perspective map, of a multiple of 4 columns and of 2 rows, and the tree of a scene."""

    def __init__(self, geometry: Geometry, view: Projection) -> None:
        library: Any = embree._library()
        self._backend = embree.AddressBackend(library, geometry.vertices.astype(np.float32), geometry.faces)
        self._function = np.uint64(ctypes.cast(library.rtcIntersect8, ctypes.c_void_p).value or 0)
        self._arguments = np.zeros(ARGUMENTS // 4, np.uint32)
        self._arguments[0] = COHERENT
        self._shape = view.height, view.width
        self._rays = _packed_rays(view)
        self._found = np.empty((len(self._rays), LANES), np.int32), np.empty((len(self._rays), LANES), np.float32)

    def trace(self) -> None:
        """Find the nearest triangle of each ray."""
        _trace(self._function, self._backend.calls.scene, np.uint64(self._arguments.ctypes.data), self._rays,
               *self._found)

    def triangle_id(self) -> Array:
        """Return what the last trace found, (h, w) int32, -1 for nothing."""
        height, width = self._shape
        blocks = self._found[0].reshape(height // HIGH, width // WIDE, HIGH, WIDE)
        return np.ascontiguousarray(blocks.swapaxes(1, 2)).reshape(height, width)


def _packed_rays(view: Projection) -> Array:
    """Return origins and directions, (packets, 6, 8) float32."""
    row, column = np.mgrid[: view.height, : view.width] + 0.5
    x, y = view.half[0] * (2 * column / view.width - 1), view.half[1] * (2 * row / view.height - 1)
    directions = np.stack([x, y, np.ones_like(x)], axis=-1) @ view.frame[0]
    rays = np.concatenate([np.broadcast_to(view.origin[0], directions.shape), directions], axis=-1)
    blocks = rays.reshape(view.height // HIGH, HIGH, view.width // WIDE, WIDE, 6).transpose(0, 2, 4, 1, 3)
    return np.ascontiguousarray(blocks.reshape(-1, 6, LANES), np.float32)


NEAR, FAR = 1e-3, 1e3  # of the scene's diagonal

VERTEX = """
#version 330
uniform mat4 clip_from_world;
in vec3 position; in vec3 normal; in vec3 albedo;
out vec3 place; out vec3 side; flat out vec3 colour;
void main() { place = position; side = normal; colour = albedo; gl_Position = clip_from_world * vec4(position, 1.0); }
"""
FRAGMENT = """
#version 330
in vec3 place; in vec3 side; flat in vec3 colour;
layout(location = 0) out vec4 position_depth;
layout(location = 1) out vec4 normal;
layout(location = 2) out vec4 albedo;
void main() {
    position_depth = vec4(place, 1.0 / gl_FragCoord.w); normal = vec4(normalize(side), 0.0); albedo = vec4(colour, 0.0);
}
"""


def available() -> str:
    """Return what is missing for a G-buffer by a software OpenGL; empty where nothing is."""
    if importlib.util.find_spec("moderngl") is None:
        return "moderngl is not installed"
    try:
        renderer = _context().info["GL_RENDERER"]
    except Exception as error:  # whatever a driver raises
        return f"no OpenGL behind EGL ({error})"
    return "" if "llvmpipe" in renderer else f"OpenGL is {renderer}, no software"


class Pipe:
    """A scene on the graphics side, drawn and read back at some pixels a side; a vertex a corner without normals."""

    def __init__(self, scene: Scene, size: int) -> None:
        self._context, self._size = _context(), size
        program = self._context.program(VERTEX, FRAGMENT)
        program["clip_from_world"].write(_clip_from_world(scene).T.astype("f4").tobytes())
        buffer, faces = _vertices(scene)
        self._mesh = self._context.vertex_array(
            program, [(self._context.buffer(buffer.tobytes()), "3f 3f 3f", "position", "normal", "albedo")],
            self._context.buffer(faces.tobytes()))
        targets = [self._context.texture((size, size), 4, dtype="f4") for _ in range(3)]
        self._target = self._context.framebuffer(targets, self._context.depth_renderbuffer((size, size)))
        self._planes = [np.empty((size, size, 4), np.float32) for _ in range(3)]

    def draw(self) -> list[Array]:
        """Return position and depth, normal, albedo, (n, n, 4) float32, bottom row first; 0 where nothing is."""
        self._target.use()
        self._context.enable(self._context.DEPTH_TEST)
        self._target.clear()
        self._mesh.render()
        for attachment, plane in enumerate(self._planes):
            self._target.read_into(plane, components=4, attachment=attachment, dtype="f4")
        return self._planes


def _context() -> Any:
    import moderngl

    os.environ.setdefault("LIBGL_ALWAYS_SOFTWARE", "1")
    return moderngl.create_context(standalone=True, backend="egl")


def _vertices(scene: Scene) -> tuple[Array, Array]:
    """Return position, normal and albedo of each vertex, float32, and the faces; a material's faces share no vertex."""
    geometry = scene.geometry
    corners = geometry.vertices[geometry.faces]
    albedo = np.array([material.diffuse for material in scene.materials])[geometry.material_of_face]
    if geometry.vertex_normals is None:
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        rows = np.concatenate([corners, np.repeat(normal[:, None], 3, 1), np.repeat(albedo[:, None], 3, 1)], axis=-1)
        return rows.reshape(-1, 9).astype("f4"), np.arange(3 * len(corners), dtype="i4")
    pairs = np.stack([geometry.faces, np.repeat(geometry.material_of_face[:, None], 3, 1)], axis=-1).reshape(-1, 2)
    used, place = np.unique(pairs[:, 0].astype(np.int64) << 32 | pairs[:, 1], return_inverse=True)
    vertex, material = used >> 32, used & 0xFFFFFFFF
    colours = np.array([m.diffuse for m in scene.materials])[material]
    rows = np.concatenate([geometry.vertices[vertex], geometry.vertex_normals[vertex], colours], axis=-1)
    return rows.astype("f4"), place.reshape(-1).astype("i4")


def _clip_from_world(scene: Scene) -> Array:
    """Return OpenGL's matrix of the scene's camera, square."""
    camera = scene.camera
    ahead = np.subtract(camera.target, camera.eye)
    ahead = ahead / np.linalg.norm(ahead)
    right = np.cross(ahead, camera.up)
    right /= np.linalg.norm(right)
    view = np.eye(4)
    view[:3, :3] = right, np.cross(right, ahead), -ahead
    view[:3, 3] = view[:3, :3] @ -np.array(camera.eye)
    near, far = NEAR * scene.geometry.diagonal, FAR * scene.geometry.diagonal
    scale = 1 / np.tan(camera.vfov / 2)
    clip = np.array([[scale, 0, 0, 0], [0, scale, 0, 0],
                     [0, 0, (far + near) / (near - far), 2 * far * near / (near - far)], [0, 0, -1, 0]])
    return np.asarray(clip @ view)


TARGETS = ("depth", "position", "normal", "albedo")  # what a deferred renderer on a graphics card writes
SIZE = 1024


def rows(quick: bool) -> Iterator[Row]:
    for faces in (100_000,) if quick else (10_000, 100_000, 400_000):
        for name in ("stage", "atrium"):
            yield from _against_packets(f"{name}:faces={faces}", 5 if quick else 15)


def _against_packets(name: str, repeats: int) -> Iterator[Row]:
    """Time visibility and the whole G-buffer over Embree's packets, and over a G-buffer of OpenGL in software."""
    scene = load_scene(name)
    materials, shape = material_table(scene.materials, np.float32), scene.geometry
    projection = camera_projection(scene.camera, SIZE, SIZE)
    packets = Packets(shape, projection)

    def visibility() -> Any:
        return rasterize(shape, projection)

    def whole() -> Any:
        return gbuffer(shape, materials, scene.camera, SIZE, SIZE).resolve(*TARGETS)

    for label, function in (("visibility", visibility), ("G-buffer", whole)):
        measured = ratio(function, packets.trace, repeats)
        aim = "<= 0.5" if label == "visibility" else ""
        yield Row(f"{label} {SIZE}^2, {name} / Embree packets", measured.median, "", aim, _spread(measured))
    missing = available()
    if missing:
        yield Row(f"G-buffer {SIZE}^2, {name} / llvmpipe", math.nan, "", "", f"skipped: {missing}")
        return
    pipe = Pipe(scene, SIZE)
    measured = ratio(whole, pipe.draw, repeats)
    yield Row(f"G-buffer {SIZE}^2, {name} / llvmpipe, read back", measured.median, "", "<= 0.3", _spread(measured))


def _spread(measured: Ratio) -> str:
    return (f"{measured.low:.2f} .. {measured.high:.2f}; {1e3 * measured.seconds_a:.1f} ms against "
            f"{1e3 * measured.seconds_b:.1f} ms")
