"""A G-buffer by OpenGL on a software rasterizer (Mesa's llvmpipe), read back: the yardstick of `benchmarks.raster`.

One pass writes position and depth, normal and albedo to three float targets (MRT), as a deferred renderer does, and all
three are read back. Needs the package moderngl and a software OpenGL behind EGL; `available` says what is missing.
"""

import importlib.util
import os
from typing import Any

import numpy as np

from refgi.scene import Scene
from refgi.types import Array

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
