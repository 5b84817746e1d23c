"""The formats that refgi reads: sound files of each, small and with all that a reader looks at, and their reader."""

import base64
import json
import re
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tests.scene.samples import BUFFER, SCENE, glb_bytes, gltf_tree, ply_bytes

NAME, VALUES = b"n" * 32, 5  # digest and size of the computation whose checkpoint is read
OBJ = (b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nusemtl a\nf 1//1 2//1 3//1 4//1\nusemtl b c\n"
       b"f -4 -3 -2\nf 1 2 \\\n 3\n# end\n")
MTL = (b"newmtl a\nKd 0.1 0.2 0.3\nKs 0.1 0.1 0.1\nNs 10\nKe 0 0 1\nmap_Kd -s 1 1 a b.png\n"
       b"newmtl b c\nKd 1 1 1\nKs 1 0 0\nNs 3\n")
PLAN = b"""[batch]
scenes = ["cornell_box", "square.json"]
size = [24, 18]
rounds = 2
rsm_resolution = 32
truth.samples = 48
path = "way.toml"
frames = 3
temporal.weight = 0.5
[expect]
"cornell_box.sii.rmse" = "< 0.5"
[sii]
lights = [1, 2]
[[val]]
lights = 64
[truth]
passes = [2, 4]
"""
GRID = b"""[sii]
lights = [16, 64]
[[multires]]
lights = 64
[[multires]]
"lights.count" = [1, 2, 3]
[truth]
passes = [2, 8]
"""
PATH = b"""frames = 48
curve = "catmull_rom"
[[camera]]
at = 0.0
eye = [0.0, 1.0, 3.0]
vfov_deg = 40.0
[[camera]]
at = 1.0
eye = [0.0, 1.0, 2.5]
up = [0.0, 1.0, 0.1]
[[lights]]
light = 0
keys = [{at = 0.0, position = [0.0, 2.0, 0.0]}, {at = 1.0, position = [1.0, 2.0, 0.0]}]
[[objects]]
faces = [0, 1]
axis = [0.0, 1.0, 0.0]
keys = [{at = 0.0}, {at = 1.0, turn_deg = 90.0, move = [0.1, 0.0, 0.0]}]
"""


class Format(NamedTuple):
    """A format that refgi reads."""

    file: str  # that is mutated
    seeds: Callable[[], list[bytes]]
    read: Callable[[Path], Any]  # what a user's file goes through; of the mutated file
    named: str = ""  # of which file an error may speak, too: that which names the mutated one


def read_scene(path: Path) -> None:
    """Load a scene, and refuse one that is not sound."""
    from refgi.scene import load_scene

    geometry = load_scene(path).geometry
    if not (np.isfinite(geometry.vertices).all() and geometry.faces.min() >= 0
            and geometry.faces.max() < len(geometry.vertices)):
        raise AssertionError("a scene with unusable vertices or faces")
    if geometry.vertex_normals is not None and not np.isfinite(geometry.vertex_normals).all():
        raise AssertionError("a scene with unusable normals")


def read_picture(path: Path) -> None:
    from refgi.image import read_exr

    channels, _ = read_exr(path)
    if not channels or any(plane.ndim != 2 for plane in channels.values()):
        raise AssertionError("a picture without planes of pixels")


def read_plan(path: Path) -> None:
    from refgi.batch.plan import read_plan as read

    read(path)


def read_grid(path: Path) -> None:
    from refgi.bench.grid import read_grid as read

    read(path)


def read_way(path: Path) -> None:
    from refgi.scene.pathfile import read_path

    read_path(path, _scene(path.parent))


def read_checkpoint(path: Path) -> None:
    from refgi.truth.checkpoint import Checkpoint

    Checkpoint(path, NAME, VALUES)


@cache
def _scene(folder: Path) -> Any:
    from refgi.scene import load_scene

    return load_scene(folder / "square.json")


def _scenes() -> list[bytes]:
    full = {**SCENE, "materials": {
        "paint": {"type": "diffuse", "diffuse": [0.1, 0.2, 0.3]},
        "gloss": {"type": "phong", "diffuse": [0.1, 0.2, 0.3], "specular": [0.1, 0.1, 0.1], "exponent": 20},
        "glass": {"type": "dielectric", "ior": 1.5}},
        "objects": [*SCENE["objects"], {"mesh": "square.ply", "material": "gloss"}],
        "lights": [*SCENE["lights"], {"type": "point", "position": [0, 0, 2], "intensity_w_per_sr": [1, 2, 3]},
                   {"type": "directional", "direction": [0, 0, -1], "irradiance_w_per_m2": [1, 1, 1]}]}
    return [json.dumps(SCENE).encode(), json.dumps(full, indent=1).encode()]


def _rich_tree() -> dict[str, Any]:
    """Return a tree with a node's turn, scale and matrix, and with normals."""
    tree = gltf_tree()
    tree["nodes"][0] |= {"rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}
    tree["nodes"][1] = {"camera": 0, "matrix": np.eye(4).ravel().tolist()}
    tree["bufferViews"].append({"buffer": 0, "byteOffset": 60, "byteLength": 48})
    tree["accessors"].append({"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC3"})
    tree["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 2
    tree["buffers"][0]["byteLength"] = 108
    return tree


RICH = BUFFER + np.tile(np.array([0, 0, 1], "<f4"), 4).tobytes()


def _gltfs() -> list[bytes]:
    inline, outside = _rich_tree(), gltf_tree()
    inline["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(RICH).decode()
    outside["buffers"][0]["uri"] = "square.bin"
    return [json.dumps(inline).encode(), json.dumps(outside).encode()]


def _pictures() -> list[bytes]:
    import OpenEXR

    from refgi.image import write_exr

    planes = {name: np.arange(48, dtype=np.float32).reshape(6, 8) for name in "RGB"}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.exr"
        write_exr(path, planes, {"scene": "square"})
        ours = path.read_bytes()
        other = []
        for kind in (OpenEXR.NO_COMPRESSION, OpenEXR.PIZ_COMPRESSION, OpenEXR.ZIPS_COMPRESSION):
            OpenEXR.File({"compression": kind, "type": OpenEXR.scanlineimage}, planes).write(str(path))
            other.append(path.read_bytes())
    return [ours, *other]


def _checkpoints() -> list[bytes]:
    from refgi.truth.checkpoint import Checkpoint
    from refgi.truth.result import add_pass

    with tempfile.TemporaryDirectory() as folder:
        made = Checkpoint(Path(folder) / "c", NAME, VALUES)
        add_pass(made.moments, np.random.default_rng(2).random((3, VALUES)))
        made.save()
        return [(Path(folder) / "c").read_bytes()]


BESIDE = {"square.ply": ply_bytes(), "square.bin": BUFFER, "square.json": json.dumps(SCENE).encode(), "m.mtl": MTL,
          "square.obj": OBJ}
FORMATS: dict[str, Format] = {
    "glb": Format("a.glb", lambda: [glb_bytes(), glb_bytes(_rich_tree(), RICH)], read_scene),
    "gltf": Format("a.gltf", _gltfs, read_scene),
    "obj": Format("a.obj", lambda: [OBJ], read_scene),
    "mtl": Format("m.mtl", lambda: [MTL], lambda path: read_scene(path.with_name("square.obj")), named="square.obj"),
    "ply": Format("a.ply", lambda: [ply_bytes(), ply_bytes(text=True)], read_scene),
    "exr": Format("a.exr", _pictures, read_picture),
    "scene": Format("a.json", _scenes, read_scene),
    "plan": Format("plan.toml", lambda: [PLAN], read_plan),
    "path": Format("way.toml", lambda: [PATH], read_way),
    "grid": Format("grid.toml", lambda: [GRID], read_grid),
    "checkpoint": Format("a.truth", _checkpoints, read_checkpoint),
}


TOKENS = [b"0", b"-1", b"1e999", b"NaN", b"4294967295", b"99999999999", b"null", b"[", b"}", b'"', b"\0", b"\xff", b"",
          b"-inf", b"1e-400", b"9" * 400, b"1" * 5000, b"\n", b"\r", b"#", b"\\\n", b"''' ", b"{}", b"true", b"0x1p5",
          "\u2028".encode(), b"\xed\xa0\x80", b"x" * 3000, b"1_0"]
ODD: list[Any] = [0, -1, 1, 1e300, -1e300, 1e-300, float("inf"), float("nan"), 2**31, 2**63, 10**30, True, None, "",
                  "x", [], {}, [[]], [0, 0, 0], [1e308] * 3, [1e-320] * 3, [float("nan")] * 3, "../x", "\0", [1] * 16,
                  "x" * 5000, {"x\ny": 1}, {"k" * 3000: 0}, "a\nb", "\ud800", [[[[[[]]]]]], 10**400, -0.0, "1", [1e200]]
WORDS = np.array([0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x7F800000, 0x7FC00000, 0xFF800000, 0x00000001, 0x7F7FFFFF,
                  0x40000000, 0x10000], "<u4")
WORD = re.compile(rb"[\w.+-]+")


def spoiled(content: bytes, random: np.random.Generator) -> bytes:
    """Return the bytes with one to four flips, cuts, repeats or insertions."""
    for _ in range(int(random.integers(1, 5))):
        if not content:
            break
        place, length = int(random.integers(len(content))), int(random.integers(1, 24))
        choice = int(random.integers(5))
        if choice == 0:
            content = content[:place] + bytes([content[place] ^ (1 << int(random.integers(8)))]) + content[place + 1 :]
        elif choice == 1:
            content = content[:place] + content[place + length :]
        elif choice == 2:
            content = content[: place + length] + content[place:]
        elif choice == 3:
            content = content[:place] + TOKENS[int(random.integers(len(TOKENS)))] + content[place + length % 4 :]
        else:
            content = content[:place] + random.bytes(min(length, 4)) + content[place + min(length, 4) :]
    return content


def with_odd_token(content: bytes, random: np.random.Generator) -> bytes:
    """Return the bytes with a word, such as a number or a key, replaced by an odd one or by another of the file."""
    words = [match.span() for match in WORD.finditer(content)]
    if not words:
        return spoiled(content, random)
    start, end = words[int(random.integers(len(words)))]
    if random.random() < 0.3:
        low, high = words[int(random.integers(len(words)))]
        new = content[low:high]
    else:
        new = TOKENS[int(random.integers(len(TOKENS)))]
    return content[:start] + new + content[end:]


def with_odd_line(content: bytes, random: np.random.Generator) -> bytes:
    """Return the bytes with a line left out, said twice, or moved."""
    lines = content.split(b"\n")
    place, to, choice = int(random.integers(len(lines))), int(random.integers(len(lines))), int(random.integers(3))
    line = lines[place] if choice == 1 else lines.pop(place)
    if choice:
        lines.insert(to, line)
    return b"\n".join(lines)


def with_odd_word(content: bytes, random: np.random.Generator) -> bytes:
    """Return the bytes with four of them in a row replaced by an odd integer or float."""
    place = int(random.integers(max(1, len(content) - 3)))
    return content[:place] + WORDS[int(random.integers(len(WORDS)))].tobytes() + content[place + 4 :]


def places(tree: Any, above: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Give the way to every value of a tree."""
    yield above
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ():
        yield from places(value, (*above, key))


def with_value(tree: Any, place: tuple[str | int, ...], value: Any) -> Any:
    if not place:
        return value
    changed = json.loads(json.dumps(tree))
    owner = changed
    for key in place[:-1]:
        owner = owner[key]
    owner[place[-1]] = value
    return changed


def with_odd_values(tree: Any, random: np.random.Generator) -> Any:
    """Return a tree with one to three values replaced by odd ones or by others of the tree."""
    for _ in range(int(random.integers(1, 4))):
        ways = list(places(tree))
        place, other = ways[int(random.integers(len(ways)))], ways[int(random.integers(len(ways)))]
        value = ODD[int(random.integers(len(ODD)))]
        if random.random() < 0.2:
            value = tree
            for key in other:
                value = value[key]
        tree = with_value(tree, place, value)
    return tree


BYTEWISE = (spoiled, with_odd_token, with_odd_line, with_odd_word)


def mutated(content: bytes, random: np.random.Generator) -> bytes:
    """Return the bytes of a file changed in one of all ways; JSON and that of a GLB in half of the cases as a tree."""
    is_glb = content[:4] == b"glTF"
    if (is_glb or content[:1] == b"{") and random.random() < 0.5:
        tree, buffer = _parts_of_glb(content) if is_glb else (json.loads(content), b"")
        tree = with_odd_values(tree, random)
        return glb_bytes(tree, buffer) if is_glb else json.dumps(tree).encode()
    return BYTEWISE[int(random.integers(len(BYTEWISE)))](content, random)


def _parts_of_glb(content: bytes) -> tuple[Any, bytes]:
    length = int.from_bytes(content[12:16], "little")
    return json.loads(content[20 : 20 + length]), content[28 + length :]
