"""Small files for the readers to read: a valid one of each format, and ways to spoil it."""

import copy
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

TRIANGLES = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.uint16)

SCENE: dict[str, Any] = {
    "schema": 1,
    "name": "sample",
    "description": "A square.",
    "units": "m", "up": "+y", "handedness": "right",
    "objects": [{"mesh": "square.ply", "material": "paint",
                 "transform": [1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}],
    "materials": {"paint": {"type": "diffuse", "diffuse": [0.1, 0.2, 0.3]}},
    "camera": {"eye": [0, 0, 3], "target": [0, 0, 0], "up": [0, 1, 0], "vfov_deg": 40, "width": 64, "height": 48},
    "lights": [{"type": "spot", "position": [0, 0, 2], "direction": [0, 0, -1], "inner_half_angle_deg": 20,
                "outer_half_angle_deg": 30, "intensity_w_per_sr": [1, 2, 3]}],
    "preview_exposure": 1.2,
}


def ply_bytes(vertices: np.ndarray = TRIANGLES, faces: np.ndarray = FACES, *, text: bool = False) -> bytes:
    """Return a PLY file, binary little-endian or ASCII."""
    form = "ascii" if text else "binary_little_endian"
    head = (f"ply\nformat {form} 1.0\nelement vertex {len(vertices)}\n"
            "property float x\nproperty float y\nproperty float z\n"
            f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n").encode()
    if text:
        rows = [" ".join(map(str, v.tolist())) for v in vertices]
        rows += [f"{len(f)} " + " ".join(map(str, f.tolist())) for f in faces]
        return head + "\n".join(rows).encode() + b"\n"
    entries = b"".join(struct.pack(f"<B{len(f)}i", len(f), *f.tolist()) for f in faces)
    return head + np.asarray(vertices, "<f4").tobytes() + entries


def gltf_tree() -> dict[str, Any]:
    """Return the JSON of a glTF square with a material, a camera and a spot, and its buffer of 60 bytes."""
    return copy.deepcopy({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2]}],
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "spot", "color": [1, 0.5, 0.25], "intensity": 683.0,
             "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}}]}},
        "nodes": [{"mesh": 0, "translation": [1, 2, 3]}, {"camera": 0, "translation": [0, 0, 5]},
                  {"extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [0, 0, 4]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "aspectRatio": 1.5, "znear": 0.1}}],
        "meshes": [{"name": "square", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"name": "paint", "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 1.0],
                                                               "metallicFactor": 0},}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48},
                        {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
        "buffers": [{"byteLength": 60}],
    })


BUFFER = TRIANGLES.tobytes() + FACES.tobytes()


def glb_bytes(tree: dict[str, Any] | None = None, buffer: bytes = BUFFER) -> bytes:
    """Return a GLB file of a JSON tree and a buffer."""
    text = json.dumps(gltf_tree() if tree is None else tree).encode()
    text += b" " * (-len(text) % 4)
    buffer += b"\0" * (-len(buffer) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(buffer), 0x004E4942) + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def write_scene(folder: Path, **changes: Any) -> Path:
    """Write the sample scene with top-level keys changed (None: left out), and its mesh."""
    tree = {key: value for key, value in (copy.deepcopy(SCENE) | changes).items() if value is not None}
    (folder / "square.ply").write_bytes(ply_bytes())
    path = folder / "sample.json"
    path.write_text(json.dumps(tree))
    return path
