"""The outer layer of glTF: GLB chunks, the JSON document with its extensions, buffers and typed views of them.

Every bound is checked before a byte is read. Compressed meshes and images of formats that are not read are refused,
with a tool that unpacks them.
"""

import base64
import binascii
import json
import math
import struct
import urllib.parse
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from refgi.errors import InputError, expect, shortened
from refgi.scene.files import expect_utf8, read_bytes
from refgi.scene.mesh import expect_memory
from refgi.types import Array

HONOURED = frozenset({
    "EXT_mesh_gpu_instancing", "KHR_lights_punctual", "KHR_materials_emissive_strength", "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness", "KHR_mesh_quantization", "KHR_texture_transform"})
# warned of by materials themselves:
APART = frozenset({"KHR_materials_transmission", "KHR_materials_unlit", "KHR_materials_volume"})
# choices, names, tags, sounds, physics and behaviour: the picture of the file as it stands is the same
HARMLESS = frozenset({
    "AGI_articulations", "AGI_stk_metadata", "CESIUM_primitive_outline", "EXT_feature_metadata",
    "EXT_instance_features", "EXT_mesh_features", "EXT_structural_metadata", "GODOT_single_root",
    "KHR_animation_pointer", "KHR_audio_emitter", "KHR_audio_graph", "KHR_collision_shapes", "KHR_implicit_shapes",
    "KHR_interactivity", "KHR_materials_variants", "KHR_node_hoverability", "KHR_node_selectability",
    "KHR_physics_rigid_bodies", "KHR_rigid_bodies", "KHR_xmp", "KHR_xmp_json_ld", "MPEG_audio_spatial", "MSFT_lod",
    "MSFT_packing_normalRoughnessMetallic", "MSFT_packing_occlusionRoughnessMetallic", "OMI_collider",
    "OMI_physics_body", "OMI_physics_shape", "OMI_spawn_point", "VRM", "VRMC_node_constraint",
    "VRMC_springBone", "VRMC_vrm"})
DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
IMAGES = {"KHR_texture_basisu": "KTX2", "EXT_texture_webp": "WebP", "EXT_texture_avif": "AVIF",
          "MSFT_texture_dds": "DDS"}
UNPACKED_BY = {
    **dict.fromkeys((DRACO, *MESHOPT), "gltf-transform copy IN OUT"),
    **dict.fromkeys(IMAGES, 'gltf-transform png IN OUT --formats "*"'),
    "KHR_texture_basisu": "gltf-transform ktxdecompress IN OUT", "MSFT_texture_dds": "magick IMAGE.dds IMAGE.png"}
# Nothing else that is required by a file can be passed over without drawing something wrong.
READABLE = HONOURED | APART | HARMLESS | UNPACKED_BY.keys()


def packed(where: str, what: str, extension: str) -> InputError:
    """Return the error of data that only a compressed form holds, with the command of a tool that unpacks them."""
    return InputError(f"{where}: {what} ({extension}) are not read; `{UNPACKED_BY[extension]}` unpacks them")


def unread(tree: dict[str, Any]) -> Iterator[tuple[str, int]]:
    """Yield each extension that a document uses and that is passed over, and how many of its objects have it."""
    listed = tree.get("extensionsUsed", [])
    names = {name for name in listed if isinstance(name, str)} if isinstance(listed, list) else set()
    if found := names - READABLE:
        yield from sorted(_uses(tree, found).items())


def _uses(tree: dict[str, Any], names: set[str]) -> Counter[str]:
    found: Counter[str] = Counter()
    pending: list[Any] = [tree]
    while pending:
        node = pending.pop()
        if isinstance(node, dict):
            extensions = node.get("extensions")
            if isinstance(extensions, dict):
                found.update(names & extensions.keys())
            pending += [value for value in node.values() if isinstance(value, dict | list)]
        else:
            pending += [value for value in node if isinstance(value, dict | list)]
    return found


MAGIC = b"glTF"
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942


class Document:
    """The JSON of one glTF file, ``.glb`` or ``.gltf``, with checked look-ups, and its buffers.

    There are hundreds of thousands of look-ups: the text of an error is made only where there is one. Raises InputError
    if the container is damaged, or its JSON no glTF 2 document.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        content = read_bytes(path)
        text, self._chunk = _chunks(content, path) if content[:4] == MAGIC else (expect_utf8(content, path), None)
        self.tree = _parsed(text, path)
        self._buffers: dict[int, bytes] = {}
        self._items: dict[str, list[dict[str, Any]]] = {}

    def items(self, key: str) -> list[dict[str, Any]]:
        """Return a top-level list of objects, empty when absent; it is checked when first asked for."""
        if key not in self._items:
            self._items[key] = self.objects(self.tree, key, "")
        return self._items[key]

    def objects(self, owner: dict[str, Any], key: str, where: str) -> list[dict[str, Any]]:
        """Return the list of objects `owner[key]`, empty when absent."""
        found = owner.get(key, [])
        good = isinstance(found, list) and all(isinstance(item, dict) for item in found)
        expect(good, f"{self.path}: {where}{'.' if where else ''}{key}", "a list of objects", found)
        return found  # type: ignore[no-any-return]

    def item(self, key: str, index: Any, referrer: str) -> dict[str, Any]:
        """Return entry `index` of the top-level list `key`, which `referrer` points to."""
        items = self.items(key)
        if not (type(index) is int and 0 <= index < len(items)):
            expect(False, f"{self.path}: {referrer}", f"an index into the {len(items)} {key}", index)
        return items[int(index)]

    def member(self, owner: dict[str, Any], key: str, where: str) -> dict[str, Any]:
        """Return the object `owner[key]`, empty when absent."""
        found = owner.get(key, {})
        if not isinstance(found, dict):
            expect(False, f"{self.path}: {where}.{key}", "an object", found)
        return found  # type: ignore[no-any-return]

    def integer(self, owner: dict[str, Any], key: str, where: str, default: int | None = None) -> int:
        """Return the non-negative integer `owner[key]`."""
        found = owner.get(key, default)
        if not (type(found) is int and 0 <= found < 2**53):
            expect(False, f"{self.path}: {where}.{key}", "an integer from 0 to 2^53 - 1", found)
        return found  # type: ignore[return-value]

    def numbers(self, owner: dict[str, Any], key: str, where: str, default: tuple[float, ...]) -> tuple[float, ...]:
        """Return the finite numbers `owner[key]`, as many as `default` has."""
        found = owner.get(key, default)
        if not (isinstance(found, list | tuple) and len(found) == len(default) and _are_finite(found)):
            expect(False, f"{self.path}: {where}.{key}", f"{len(default)} finite numbers up to 1e+300", found)
        return tuple(map(float, found))

    def all_numbers(self, owner: dict[str, Any], key: str, where: str) -> tuple[float, ...]:
        """Return the finite numbers `owner[key]`, however many, none when absent."""
        found = owner.get(key, [])
        return self.numbers(owner, key, where, (0.0,) * len(found)) if isinstance(found, list) and found else ()

    def number(self, owner: dict[str, Any], key: str, where: str, default: float) -> float:
        """Return the finite number `owner[key]`."""
        found = owner.get(key, default)
        expect(_are_finite([found]), f"{self.path}: {where}.{key}", "a finite number up to 1e+300", found)
        return float(found)

    def name(self, owner: dict[str, Any], default: str) -> str:
        """Return the name of an entry, or `default`."""
        found = owner.get("name")
        return found if isinstance(found, str) and found else default

    def buffer(self, index: int) -> bytes:
        """Return the bytes of a buffer, read when first asked for."""
        if index not in self._buffers:
            self._buffers[index] = self._fetch(index)
        return self._buffers[index]

    def _fetch(self, index: int) -> bytes:
        where = f"buffers[{index}]"
        entry = self.item("buffers", index, where)
        length = self.integer(entry, "byteLength", where)
        uri = entry.get("uri")
        if uri is None:
            extensions = self.member(entry, "extensions", where)
            for name in MESHOPT:
                if self.member(extensions, name, where).get("fallback") is True:
                    raise packed(f"{self.path}: {where}", "meshopt-compressed meshes", name)
            expect(index == 0 and self._chunk is not None, f"{self.path}: {where}.uri", "a uri or a GLB chunk", None)
            content = self._chunk or b""
        else:
            expect(isinstance(uri, str), f"{self.path}: {where}.uri", "a string", uri)
            content = self.from_uri(uri, where)
        expect(len(content) >= length, f"{self.path}: {where}", f"{length} bytes (the file is cut short)", len(content))
        return content[:length]

    def view(self, index: Any, referrer: str) -> bytes:
        """Return the bytes of a buffer view that holds a file, such as an image."""
        entry, where = self.item("bufferViews", index, referrer), f"bufferViews[{index}]"
        content = self.buffer(self.integer(entry, "buffer", where))
        start, length = self.integer(entry, "byteOffset", where, 0), self.integer(entry, "byteLength", where)
        expect(start + length <= len(content), f"{self.path}: {where}",
               f"a range inside the buffer's {len(content)} bytes", f"{start} to {start + length}")
        return content[start : start + length]

    def from_uri(self, uri: str, where: str) -> bytes:
        """Return the bytes behind a uri, of a file beside the document or inside the uri itself."""
        if uri.startswith("data:"):
            head, _, payload = uri.partition(",")
            expect(head.endswith(";base64"), f"{self.path}: {where}.uri", "a base64 data URI", head[:40])
            try:
                return base64.b64decode(payload, validate=True)
            except (binascii.Error, ValueError) as error:
                raise InputError(f"{self.path}: {where}.uri: damaged base64: {error}") from error
        named = Path(urllib.parse.unquote(uri))
        beside = not named.is_absolute() and ".." not in named.parts and "://" not in uri and "\0" not in str(named)
        expect(beside, f"{self.path}: {where}.uri", "a file beside the .gltf", uri[:80])
        try:
            return read_bytes(self.path.parent / named)
        except InputError as error:
            raise InputError(f"{self.path}: {where}.uri: {shortened(str(error), 1000)}") from error


def _chunks(content: bytes, path: Path) -> tuple[bytes, bytes | None]:
    expect(len(content) >= 20, f"{path}", "a GLB header of 20 bytes (the file is cut short)", len(content))
    version, total = struct.unpack_from("<II", content, 4)
    expect(version == 2, f"{path}: version", "GLB version 2", version)
    expect(total <= len(content), f"{path}", f"{total} bytes (the file is cut short)", len(content))
    found: dict[int, bytes] = {}
    start = 12
    while start + 8 <= total:
        length, kind = struct.unpack_from("<II", content, start)
        expect(start + 8 + length <= total, f"{path}: chunk at byte {start}", f"at most {total - start - 8} bytes",
               length)
        found.setdefault(kind, content[start + 8 : start + 8 + length])
        start += 8 + length
    expect(JSON_CHUNK in found, f"{path}", "a JSON chunk", [hex(kind) for kind in found])
    return found[JSON_CHUNK], found.get(BINARY_CHUNK)


def _parsed(text: bytes, path: Path) -> dict[str, Any]:
    try:
        tree = json.loads(text.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: damaged JSON: {error}") from error
    expect(isinstance(tree, dict), f"{path}", "a JSON object", tree)
    asset = tree.get("asset")
    version = asset.get("version") if isinstance(asset, dict) else None
    expect(isinstance(version, str) and version.startswith("2."), f"{path}: asset.version", "glTF 2", version)
    required = tree.get("extensionsRequired", [])
    expect(isinstance(required, list) and all(isinstance(name, str) for name in required),
           f"{path}: extensionsRequired", "a list of strings", required)
    unknown = sorted(set(required) - READABLE)
    expect(not unknown, f"{path}: extensionsRequired", "extensions that are read or change no light", unknown)
    return tree  # type: ignore[no-any-return]


def _are_finite(values: Sequence[Any]) -> bool:
    """Return whether all of one or more values are numbers of JSON whose products stay finite."""
    numbers = {int, float}.issuperset(map(type, values))
    return numbers and min(values) > -1e300 and max(values) < 1e300 and not math.isnan(sum(values))


COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def accessor(document: Document, index: Any, kind: str, referrer: str) -> Array:
    """Return the elements of an accessor, those that a sparse one replaces in their place.

    `kind`: ``"SCALAR"``, ``"VEC3"`` ...: what the referrer needs. `referrer`: the key that names the accessor. Returns
    (count,) or (count, width): in the file's component type, or float64 where the accessor is normalised; zeros where
    it has no buffer view. Raises `InputError` if a key is missing or any byte lies outside its buffer.
    """
    entry = document.item("accessors", index, referrer)
    where = f"accessors[{index}]"
    path = document.path
    expect(entry.get("type") == kind, f"{path}: {where}.type", kind, entry.get("type"))
    dtype = _component_type(document, entry, where)
    if "bufferView" in entry:
        elements = _view(document, entry, where, dtype, WIDTHS[kind])
    else:
        count = document.integer(entry, "count", where)
        expect_memory(count, 0, f"{path}: {where}.count")
        elements = np.zeros((count, WIDTHS[kind]), dtype)
    if "sparse" in entry:
        elements = _replaced(document, entry, where, elements)
    if entry.get("normalized") is True and dtype.kind != "f":
        elements = np.maximum(elements / np.iinfo(dtype).max, -1.0)
    return elements if WIDTHS[kind] > 1 else elements[:, 0]


def _component_type(document: Document, entry: dict[str, Any], where: str) -> np.dtype[Any]:
    code = entry.get("componentType")
    known = isinstance(code, int) and code in COMPONENTS
    expect(known, f"{document.path}: {where}.componentType", f"one of {sorted(COMPONENTS)}", code)
    return np.dtype(COMPONENTS[code])  # type: ignore[index]


def _replaced(document: Document, entry: dict[str, Any], where: str, elements: Array) -> Array:
    """Return elements (count, width) with those replaced that `sparse` lists."""
    where = f"{where}.sparse"
    sparse = document.member(entry, "sparse", where)
    count = {"count": document.integer(sparse, "count", where)}
    listed = document.member(sparse, "indices", where) | count
    values = document.member(sparse, "values", where) | count
    for key, part in (("indices", listed), ("values", values)):
        expect("bufferView" in part, f"{document.path}: {where}.{key}.bufferView", "an index", None)
    kind = _component_type(document, listed, f"{where}.indices")
    expect(kind.kind == "u", f"{document.path}: {where}.indices.componentType", "unsigned integers", kind.name)
    index = _view(document, listed, f"{where}.indices", kind, 1)[:, 0]
    outside = int(index.max(initial=0))
    expect(outside < len(elements) or not len(index), f"{document.path}: {where}.indices",
           f"indices below {len(elements)}", outside)
    replaced = elements.copy()
    replaced[index] = _view(document, values, f"{where}.values", elements.dtype, elements.shape[1])
    return replaced


def _view(document: Document, entry: dict[str, Any], where: str, dtype: np.dtype[Any], width: int) -> Array:
    """Return (count, width) elements of an accessor after checking that they lie inside view and buffer."""
    path = document.path
    view = document.item("bufferViews", entry["bufferView"], f"{where}.bufferView")
    place = f"bufferViews[{entry['bufferView']}]"
    content = document.buffer(document.integer(view, "buffer", place))
    start = document.integer(view, "byteOffset", place, 0)
    length = document.integer(view, "byteLength", place)
    expect(start + length <= len(content), f"{path}: {place}", f"a range inside the buffer's {len(content)} bytes",
           f"{start} to {start + length}")
    size = dtype.itemsize * width
    stride = document.integer(view, "byteStride", place, size)
    expect(stride >= size and stride <= 1024, f"{path}: {place}.byteStride", f"{size} to 1024", stride)
    count = document.integer(entry, "count", where)
    offset = document.integer(entry, "byteOffset", where, 0)
    end = offset + stride * (count - 1) + size if count else offset
    expect(end <= length, f"{path}: {where}", f"a range inside the view's {length} bytes", f"{offset} to {end}")
    return np.ndarray((count, width), dtype, content, start + offset, (stride, dtype.itemsize))
