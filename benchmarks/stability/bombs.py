"""Files that ask for far more time or memory than they have bytes: depth, counts, repeats, instances, empty windows."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.stability.file_formats import GRID, MTL, NAME, PATH, PLAN, VALUES
from refgi.truth.checkpoint import FIRST_LINE
from tests.scene.samples import SCENE, glb_bytes, gltf_tree, ply_bytes

Make = Callable[[Path], Any]
DEEP, MANY, HUGE = 100_000, 200_000, 2**31 - 1


def _bytes(make: Callable[[], bytes | str]) -> Make:
    def write(path: Path) -> None:
        content = make()
        path.write_bytes(content.encode() if isinstance(content, str) else content)

    return write


def _scene(**changes: Any) -> Make:
    return _bytes(lambda: json.dumps(SCENE | changes))


def _tree(change: Callable[[dict[str, Any]], Any], as_glb: bool = True) -> Make:
    def make() -> bytes:
        tree = gltf_tree()
        change(tree)
        return glb_bytes(tree) if as_glb else json.dumps(tree).encode()

    return _bytes(make)


def _set(key: str, index: int, **values: Any) -> Make:
    return _tree(lambda tree: tree[key][index].update(values))


def _nodes(tree: dict[str, Any], children: Callable[[int], list[int]], count: int = MANY // 10) -> None:
    tree["nodes"] = [{"mesh": 0, "children": children(k)} for k in range(count)]
    tree["scenes"] = [{"nodes": [0]}]


def _sheet_in_many_places(path: Path) -> None:
    """Write a scene of a thousand objects, each 100,000 faces of one file: 10^8 faces of 2 MB."""
    side = "".join(f"v {k % 300} {k // 300} 0\n" for k in range(90_000))
    faces = "".join(f"f {k + 1} {k + 2} {k + 302}\n" for k in range(89_000))
    path.with_name("sheet.obj").write_text(side + faces)
    objects = [{"mesh": "sheet.obj", "material": "paint"}] * 20_000
    path.write_text(json.dumps(SCENE | {"objects": objects}))


def exr_bytes(window: tuple[int, int, int, int], *, tiled: bool = False, channels: int = 3,
              compression: int = 0) -> bytes:
    """Return an EXR whose header speaks of a window of pixels that nothing follows."""
    def attribute(name: bytes, kind: bytes, value: bytes) -> bytes:
        return name + b"\0" + kind + b"\0" + struct.pack("<I", len(value)) + value

    listed = b"".join(b"C%05d\0" % k + struct.pack("<iB3xii", 2, 0, 1, 1) for k in range(channels)) + b"\0"
    box = struct.pack("<4i", *window)
    head = (attribute(b"channels", b"chlist", listed) + attribute(b"compression", b"compression", bytes([compression]))
            + attribute(b"dataWindow", b"box2i", box) + attribute(b"displayWindow", b"box2i", box)
            + attribute(b"lineOrder", b"lineOrder", b"\0") + attribute(b"pixelAspectRatio", b"float", b"\0\0\x80?")
            + attribute(b"screenWindowCenter", b"v2f", bytes(8)) + attribute(b"screenWindowWidth", b"float",
                                                                            b"\0\0\x80?"))
    if tiled:
        head += attribute(b"tiles", b"tiledesc", struct.pack("<IIB", 64, 64, 1))
    return struct.pack("<II", 20000630, 2 | tiled << 9) + head + b"\0" + bytes(64)


def _checkpoint(length: int) -> Make:
    def write(path: Path) -> None:
        with path.open("wb") as file:
            file.write(FIRST_LINE + NAME)
            file.truncate(length)

    return write


def _header(vertices: str, faces: str, extra: str = "", form: str = "binary_little_endian") -> Make:
    sound = ply_bytes(text=form == "ascii")
    entries = sound[sound.index(b"end_header\n"):]
    return _bytes(lambda: (f"ply\nformat {form} 1.0\n{extra}element vertex {vertices}\nproperty float x\n"
                           f"property float y\nproperty float z\nelement face {faces}\n"
                           "property list uchar int vertex_indices\n").encode() + entries)


SHARED: dict[str, Make] = {
    "deep lists": _bytes(lambda: "[" * DEEP),
    "deep objects": _bytes(lambda: '{"a":' * DEEP + "1" + "}" * DEEP),
    "deep extras": _bytes(lambda: '{"asset": {"version": "2.0"}, "extras": ' + "[" * 900 + "]" * 900 + "}"),
    "repeated keys": _bytes(lambda: "{" + ",".join(['"name": 1'] * MANY) + "}"),
    "many keys": _bytes(lambda: "{" + ",".join(f'"k{k}": 1' for k in range(MANY)) + "}"),
    "long number": _bytes(lambda: '{"schema": ' + "9" * 4_000_000 + "}"),
    "long text": _bytes(lambda: '{"name": "' + "x" * 40_000_000 + '"}'),
    "zeros": lambda path: _sparse(path, 1 << 40),
}
GLTF: dict[str, Make] = {
    "count": _set("accessors", 0, count=2**52),
    "view": _set("bufferViews", 0, byteLength=2**52),
    "buffer": _set("buffers", 0, byteLength=2**52),
    "stride": _set("bufferViews", 0, byteStride=0),
    "sparse": _set("accessors", 0, sparse={"count": 2**40}),
    "many nodes": _tree(lambda tree: _nodes(tree, lambda k: [k + 1] if k + 1 < MANY // 10 else [])),
    "wide nodes": _tree(lambda tree: _nodes(tree, lambda k: [] if k else list(range(1, MANY // 10)))),
    "node tree that doubles": _tree(lambda tree: _nodes(tree, lambda k: [k + 1, k + 1] if k < 60 else [], 61)),
    "cycle": _tree(lambda tree: _nodes(tree, lambda k: [(k + 1) % 9], 9)),
    "many primitives": _tree(lambda tree: tree["meshes"][0].update(
        primitives=tree["meshes"][0]["primitives"] * 10_000)),
    "many extensions": _tree(lambda tree: tree.update(extensionsRequired=[f"E{k}" for k in range(MANY)])),
    "huge chunk": _bytes(lambda: glb_bytes()[:12] + struct.pack("<II", 0xFFFFFFFF, 0x4E4F534A) + bytes(64)),
    "many chunks": _bytes(lambda: struct.pack("<4sII", b"glTF", 2, 12 + 8 * MANY) + bytes(8 * MANY)),
}
TOML: dict[str, Make] = {
    "deep lists": _bytes(lambda: "a = " + "[" * DEEP),
    "deep tables": _bytes(lambda: "a = " + "{a = " * DEEP),
    "deep key": _bytes(lambda: "a" + ".a" * DEEP + " = 1"),
    "deep header": _bytes(lambda: "[a" + ".a" * 5000 + "]\nb = 1"),
    "long number": _bytes(lambda: "a = " + "9" * 4_000_000),
    "long text": _bytes(lambda: 'a = "' + "x" * 20_000_000 + '"'),
    "many tables": _bytes(lambda: "".join(f"[t{k}]\n" for k in range(MANY))),
    "repeated tables": _bytes(lambda: "[sii]\nlights = 1\n" * 2),
    "many repeats": _bytes(lambda: "[[sii]]\nlights = 1\n" * 2_000),
    "zeros": lambda path: _sparse(path, 1 << 40),
}
PRODUCT = "".join(f"{key} = [{', '.join(map(str, range(1, 100)))}]\n"
                  for key in ("lights", "seed", "lights.grid", "a", "b", "c", "d", "e", "f"))


def _sparse(path: Path, length: int) -> None:
    with path.open("wb") as file:
        file.truncate(length)


BOMBS: dict[str, dict[str, Make]] = {
    "glb": GLTF,
    "gltf": SHARED | {"data": _tree(lambda tree: tree["buffers"][0].update(
        uri="data:application/octet-stream;base64," + "A" * 60_000_000), as_glb=False),
        "many buffers": _tree(lambda tree: tree.update(buffers=[{"byteLength": 60, "uri": "square.bin"}] * MANY),
                              as_glb=False)},
    "obj": {"corners": _bytes(lambda: "v 0 0 0\nv 1 0 0\nv 1 1 0\nf" + " 1 2 3" * (MANY // 2)),
            "continued": _bytes(lambda: "v 0 0 0 " + "\\\n" * 1_000_000),
            "materials": _bytes(lambda: "v 0 0 0\nv 1 0 0\nv 1 1 0\n" + "".join(
                f"usemtl m{k}\nf 1 2 3\n" for k in range(10_000))),
            "libraries": _bytes(lambda: "mtllib none.mtl\n" * MANY),
            "itself": _bytes(lambda: "mtllib a.obj\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"),
            "long line": _bytes(lambda: "v " + "1" * 30_000_000),
            "long index": _bytes(lambda: "v 0 0 0\nf 1 1 " + "9" * 4_000_000),
            "zeros": lambda path: _sparse(path, 1 << 40)},
    "mtl": {"textures": _bytes(lambda: MTL.decode() + "map_Kd a b c d e f g h i j k.png\n" * 20_000 + "".join(
                f"map_Kd a{k}.png\n" for k in range(20_000))),
            "words": _bytes(lambda: MTL.decode() + "map_Kd" + " a" * 500_000),
            "materials": _bytes(lambda: "".join(f"newmtl m{k}\nKd 2 2 2\n" for k in range(MANY))),
            "kinds": _bytes(lambda: MTL.decode() + "".join(f"map_{k} x.png\n" for k in range(50_000)))},
    "ply": {"vertices": _header("999999999999999", "2"), "faces": _header("4", "999999999999999"),
            "element without properties": _header("4", "2", "element odd 999999999999999\n"),
            "text element without properties": _header("4", "2", "element odd 999999999999999\n", "ascii"),
            "long list": _bytes(lambda: ply_bytes()[:-26] + b"\xff" * 26),
            "long counts": _bytes(lambda: ply_bytes().replace(b"list uchar int", b"list uint int")),
            "properties": _header("4", "2", "element odd 1\n" + "property float x\n" * 3000),
            "elements": _header("4", "2", "".join(f"element e{k} 0\n" for k in range(3000))),
            "zeros": lambda path: _sparse(path, 1 << 40)},
    "exr": {f"{name}{' tiled' * tiled}": _bytes(lambda w=window, t=tiled, c=channels: exr_bytes(
                w, tiled=t, channels=c))
            for tiled in (False, True) for name, window, channels in (
                ("wide", (0, 0, HUGE - 1, 0), 3), ("high", (0, 0, 0, HUGE - 1), 3),
                ("all", (0, 0, HUGE - 1, HUGE - 1), 3),
                ("everywhere", (-HUGE, -HUGE, HUGE, HUGE), 3), ("large", (0, 0, 99_999, 99_999), 3),
                ("half", (0, 0, 9_999, 9_999), 3), ("inside out", (9, 9, 0, 0), 3),
                ("channels", (0, 0, 999, 999), 3000))},
    "scene": SHARED | {
        "instances": _scene(objects=[*SCENE["objects"]] * 20_000),
        "instances of much": _sheet_in_many_places,
        "missing meshes": _scene(objects=[{"mesh": f"none{k}.ply", "material": "paint"} for k in range(20_000)]),
        "unknown materials": _scene(objects=[{"mesh": "square.ply", "material": f"m{k}"} for k in range(20_000)]),
        "materials": _scene(materials={f"m{k}": {"type": "diffuse", "diffuse": [2, 0, 0]} for k in range(20_000)}),
        "lights": _scene(lights=SCENE["lights"] * 20_000),
        "itself": _scene(objects=[{"mesh": "a.json", "material": "paint"}]),
        "device": _scene(objects=[{"mesh": "../../../../../../../../dev/zero", "material": "paint"}]),
        "pixels": _scene(camera=SCENE["camera"] | {"width": 2**30, "height": 2**30})},
    "plan": TOML | {"product": _bytes(lambda: PLAN.decode() + "[multires]\n" + PRODUCT),
                    "scenes": _bytes(lambda: f"[batch]\nscenes = {json.dumps(['cornell_box'] * MANY)}\n[sii]\n"),
                    "thresholds": _bytes(lambda: '[batch]\nscenes = ["cornell_box"]\n[sii]\n[expect]\n' + "".join(
                        f'"cornell_box.sii.{k}" = "< 1"\n' for k in range(20_000)))},
    "grid": TOML | {"product": _bytes(lambda: "[sii]\n" + PRODUCT),
                    "usable product": _bytes(lambda: f"[sii]\nlights = {list(range(1, 400))}\n"
                                             f"seed = {list(range(1, 400))}\n"),
                    "passes": _bytes(lambda: GRID.decode().replace("[2, 8]", str(list(range(2, MANY)))))},
    "path": TOML | {"keys": _bytes(lambda: "[[camera]]\nat = 0.5\neye = [0.0, 1.0, 3.0]\n" * 5_000),
                    "lights": _bytes(lambda: PATH.decode() + "[[lights]]\nlight = 9\nkeys = [{at = 0.0}]\n" * 5_000)},
    "checkpoint": {"4 TB": _checkpoint(1 << 42), "sound length": _checkpoint(25 + 64 + 8 * (2 + 7 * VALUES)),
                   "zeros": lambda path: _sparse(path, 1 << 40)},
}
