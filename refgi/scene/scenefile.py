"""Scene files (JSON with meshes, materials, camera and lights; keys in docs/scenes.md), and mesh files by suffix."""

import collections
import dataclasses
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.errors import MOST_FAULTS, InputError, expect, first_faults, shortened
from refgi.scene.files import expect_utf8, is_there, read_bytes, wants_lamps, warn_of_undefined
from refgi.scene.gltf import read_gltf
from refgi.scene.mesh import expect_memory
from refgi.scene.model import Camera, Contents, Light, Material, Mesh, Scene, merge
from refgi.scene.motion import transformed_all
from refgi.scene.obj import read_obj
from refgi.scene.placed import lamps_where_asked
from refgi.scene.ply import read_ply
from refgi.scene.repair import lights_with_power, repaired_all, warn_of_flat_faces, warn_of_unit
from refgi.scene.texture.image import expect_all_fit, image_file
from refgi.scene.texture.table import Texture
from refgi.stages import skip

READERS: dict[str, Callable[[Path], Contents]] = {
    ".glb": read_gltf, ".gltf": read_gltf, ".obj": read_obj, ".ply": read_ply,
}
PLAINER = {"missing": "expected a value, nothing given", "extra_forbidden": "unknown key",
           "union_tag_invalid": "type: expected one of {expected_tags}",
           "union_tag_not_found": "expected a type"}
KINDS = ("diffuse", "phong", "dielectric", "spot", "point", "directional", "name", "inline", "rgb", "image")

if TYPE_CHECKING:
    from refgi.scene.schema import MaterialEntry, Object, SceneFile


def read_scene_file(path: Path, camera: Camera | None, lights: Sequence[Light] | None) -> Scene:
    """Read a JSON scene file and the meshes it names.

    `path`: the file; meshes are looked for beside it. Result: the scene, in the order of the file's objects. Raises
    `InputError`: one error with all faults of the file, else one with all faults of its meshes.
    """
    content = expect_utf8(read_bytes(path), path)
    entry = _validated(content, path, need_camera=camera is None, need_lights=lights is None and not wants_lamps())
    meshes = _meshes(entry, _materials(entry, path), path)
    geometry, used = merge(meshes, smooth=any(mesh.normals is not None for mesh in meshes))
    warn_of_unit(geometry, str(path))
    lamps = lamps_where_asked(geometry, used, str(path))
    if camera is None and entry.camera is not None:
        camera = entry.camera.built("")
    chosen = tuple(light.built("") for light in entry.lights) if lights is None else tuple(lights)
    assert camera is not None  # by _validated
    return Scene(entry.name, geometry, used, camera, lights_with_power((*chosen, *lamps), f"{path}: lights"),
                 entry.description, entry.preview_exposure, emissive_lamps=len(lamps))


def _materials(entry: "SceneFile", path: Path) -> dict[str, Material]:
    """Return the named materials with their images, or raise one error with all that cannot be read."""
    faults: list[str] = []
    materials: dict[str, Material] = {}
    expect_all_fit((path.parent / one for one in map(_image_of, entry.materials.values()) if one), f"{path}: materials")
    for name, material in entry.materials.items():
        try:
            materials[name] = _built(material, name, path.parent)
        except InputError as error:
            faults.append(f"{path}: materials.{shortened(name)}.diffuse.texture: {error}")
    _raise_if_any(faults)
    return materials


def _image_of(entry: "MaterialEntry") -> str | None:
    """Return the file of a material's image, None where it has none."""
    return getattr(getattr(entry, "diffuse", None), "texture", None)


def _built(entry: "MaterialEntry", name: str, folder: Path) -> Material:
    """Return a material with its texture decoded; raises `InputError` if the image cannot be read."""
    from refgi.scene.schema import TextureEntry

    material: Material = entry.built(name)
    reflectance = getattr(entry, "diffuse", None)
    if not isinstance(reflectance, TextureEntry):
        return material
    wrap = reflectance.wrap if isinstance(reflectance.wrap, tuple) else (reflectance.wrap, reflectance.wrap)
    texture = Texture(image_file(folder / reflectance.texture), wrap, reflectance.filter)
    return dataclasses.replace(material, texture=texture)


def _validated(content: bytes, path: Path, *, need_camera: bool, need_lights: bool) -> "SceneFile":
    """Return the parsed file, or raise one error that lists all faults."""
    from pydantic import ValidationError

    from refgi.scene.schema import Names, SceneFile

    tree = _parsed(content, path)
    faults = [f"{key}: expected {what}, nothing given" for key, what, needed in (
        ("camera", "an object", need_camera), ("lights", "at least one light", need_lights)
    ) if needed and tree.get(key) in (None, [])]
    try:
        entry = SceneFile.model_validate_json(content, context=Names(tree.get("materials")))
    except ValidationError as error:
        faults = [_fault(detail, tree) for detail in error.errors(include_url=False)] + faults
    except (ValueError, RecursionError) as error:
        faults = [str(error)]
    if faults:
        raise InputError(first_faults([f"{path}: {fault}" for fault in faults]))
    return entry


def _parsed(content: bytes, path: Path) -> dict[str, Any]:
    def without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        tree = dict(pairs)
        if len(tree) < len(pairs):
            times = collections.Counter(key for key, _ in pairs)
            repeated = sorted(shortened(key, 80) for key, count in times.items() if count > 1)
            raise InputError(f"{path}: {first_faults(repeated, ', ')}: expected each key once in an object")
        return tree

    try:
        tree = json.loads(content.decode(), object_pairs_hook=without_repeats)
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: damaged JSON: {error}") from error
    if not isinstance(tree, dict):
        raise InputError(f"{path}: expected a JSON object, got {type(tree).__name__}")
    return tree


def _fault(detail: Any, tree: Any) -> str:
    """Return "key: what was expected, got value" of one pydantic error."""
    text = str(detail["msg"]).removeprefix("Value error, ").replace("Input should be", "expected")
    for prefix in ("light: ", "camera: ", "material '': ", "transform: "):
        text = text.removeprefix(prefix)
    value, kind = detail["input"], detail["type"]
    if kind in PLAINER:
        text = PLAINER[kind].format(**detail.get("ctx", {}))
    shown = repr(value) if kind != "value_error" and not (kind == "missing" and isinstance(value, dict)) else ""
    got = f", got {shortened(shown, 80)}" if shown else ""
    return f"{_key(detail['loc'], tree, kind) or 'file'}: {text}{got}"


def _key(place: Sequence[str | int], tree: Any, kind: str) -> str:
    """Return a pydantic location as written in the file: without the kinds of light and material it went by."""
    key, node = "", tree
    for number, part in enumerate(place):
        last = number == len(place) - 1
        found = part in node if isinstance(node, dict) else isinstance(node, list) and part in range(len(node))
        if (last and kind == "value_error" and part in KINDS) or not (found or (last and kind == "missing")):
            continue
        name = f"[{part}]" if isinstance(part, int) else shortened(part)
        key += f".{name}" if key and isinstance(part, str) else name
        node = node[part] if found else None
    return key


def _meshes(entry: "SceneFile", materials: dict[str, Material], path: Path) -> list[Mesh]:
    """Return the placed meshes of all objects, or raise one error with what is wrong with any of them."""
    faults: list[str] = []
    meshes, owner = _object_meshes(entry, materials, path, faults)

    def name(number: int) -> str:
        return f"{path}: objects[{owner[number]}].mesh: {entry.objects[owner[number]].mesh}"

    meshes, dropped = repaired_all(meshes, name, faults)
    _raise_if_any(faults)
    transforms = (entry.objects[number].transform for number in owner)
    matrix_of = {k: matrix for k, matrix in enumerate(transforms) if matrix}
    moving = list(matrix_of)
    matrices = np.array(list(matrix_of.values()), np.float64).reshape(-1, 4, 4)
    moved, lost = repaired_all(transformed_all([meshes[k] for k in moving], matrices),
                             lambda k: f"{name(moving[k])}: after its transform", faults)
    _raise_if_any(faults)
    for k, mesh in zip(moving, moved, strict=True):
        meshes[k] = mesh
    warn_of_flat_faces(dropped + lost, str(path))
    return meshes


def _raise_if_any(faults: list[str]) -> None:
    if faults:
        raise InputError(first_faults(faults))


def _object_meshes(
    entry: "SceneFile", materials: dict[str, Material], path: Path, faults: list[str]
) -> tuple[list[Mesh], list[int]]:
    """Return the meshes of all objects where their files have them, and the number of each one's object."""
    contents: dict[str, Contents | InputError] = {}
    meshes: list[Mesh] = []
    owner: list[int] = []
    undefined: dict[str, None] = {}
    vertices = faces = 0
    for number, item in enumerate(entry.objects):
        try:
            found = _read_once(contents, item.mesh, path.parent, suggest=len(faults) < MOST_FAULTS)
            vertices += sum(len(mesh.vertices) for mesh in found.meshes)
            faces += sum(len(mesh.faces) for mesh in found.meshes)
            expect_memory(vertices, faces, "all objects so far")
        except InputError as error:
            faults.append(f"{path}: objects[{number}].mesh: {error}")
            continue
        try:
            meshes += [_with_material(mesh, item, materials, entry.smooth_normals, path.parent, number + 1)
                       for mesh in found.meshes]
            if item.smooth_normals is None and "smooth_normals" not in entry.model_fields_set and any(
                    mesh.normals is not None for mesh in found.meshes):
                skip("scene.vertex_normals", f"{item.mesh}: the scene file says nothing of smooth_normals")
        except InputError as error:
            faults.append(f"{path}: objects[{number}].material: {error}")
            continue
        owner += [number] * len(found.meshes)
        if item.material is None:
            undefined |= dict.fromkeys(name for name in found.undefined if name not in materials)
    warn_of_undefined(list(undefined), str(path))
    return meshes, owner


def _read_once(contents: dict[str, Contents | InputError], name: str, folder: Path, *, suggest: bool) -> Contents:
    if name not in contents:
        try:
            expect("\n" not in name, "name", "one line", name)
            # suggestions for a missing name take long to find, and are not shown after so many faults
            expect(suggest or is_there(folder / name), f"{folder / name}", "a file", "none")
            contents[name] = read_mesh_file(folder / name)
        except InputError as error:
            contents[name] = error
    found = contents[name]
    if isinstance(found, InputError):
        raise found
    return found


def _with_material(
    mesh: Mesh, item: "Object", materials: dict[str, Material], smooth: bool, folder: Path, number: int
) -> Mesh:
    """Return the mesh with its material, and with normals only where the scene enables them; `number`: its object's.

    Raises `InputError` if the material's texture cannot be read, or the mesh has no coordinates for it.
    """
    if isinstance(item.material, str):
        material = materials[item.material]
    elif item.material is not None:
        material = _built(item.material, item.name or mesh.name, folder)
    else:
        material = materials.get(mesh.material.name, mesh.material)
    expect(not material.textures or mesh.uv is not None, item.mesh,
           f"texture coordinates for the texture of material {material.name!r}", "none")
    has_normals = smooth if item.smooth_normals is None else item.smooth_normals
    material = dataclasses.replace(material, sends=item.sends, solid=number if item.rigid else 0)
    return dataclasses.replace(mesh, material=material, normals=mesh.normals if has_normals else None)


def read_mesh_file(path: Path) -> Contents:
    """Read a mesh file of any known format.

    Result: its meshes, cameras and lights. Raises `InputError` if the suffix is unknown, the file is damaged or it
    holds no triangle.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: expected a file named {', '.join(READERS)}, got {path.suffix!r}")
    found = reader(path)
    expect(bool(found.meshes), f"{path}", "at least one mesh of triangles", 0)
    return found
