"""`load_scene`: a `Scene` from a built-in name, a scene file or a mesh file."""

import dataclasses
import warnings
from collections.abc import Sequence
from pathlib import Path

from refgi.errors import InputError, RefgiWarning, blame, first_faults, shortened
from refgi.scene.builtin import SCENES, build_named
from refgi.scene.files import (
    Emissive,
    LightUnit,
    did_you_mean,
    is_there,
    reading,
    reading_as,
    source_of,
    text_of,
    warn_of_undefined,
)
from refgi.scene.model import Camera, Light, Scene, merge
from refgi.scene.placed import default_camera, default_light, lamps_where_asked
from refgi.scene.repair import lights_with_power, repaired_all, warn_of_flat_faces, warn_of_unit
from refgi.scene.scenefile import READERS, read_mesh_file, read_scene_file
from refgi.stages import stage


@stage("scene.load")
def load_scene(
    source: str | Path, *, camera: Camera | None = None, lights: Sequence[Light] | None = None, strict: bool = False,
    light_unit: LightUnit = "cd", emissive: Emissive = "seen",
) -> Scene:
    """Load a built-in scene, a scene file or a mesh file.

    source: A built-in scene's name, with parameters after a colon (``"atrium:faces=1000000,seed=3"``), or the path of a
        ``.json`` scene file or a ``.glb``, ``.gltf``, ``.obj`` or ``.ply`` mesh.
    camera: Replaces the scene's own camera.
    lights: Replace the scene's own lights.
    strict: Refuse what is else passed over with a warning: absent material files and textures of meshes, faces of fewer
        than three corners, indices of normals and texture coordinates that are not there.
    light_unit: What glTF's intensities are in: "cd" as the format says, "lm" (an isotropic source's flux), or "W/sr",
        which some exporters write.
    emissive: "seen": emissive surfaces of files light nothing, only the camera sees them. "lamps": each connected
        emissive part gets a lamp of its power at its middle, along its mean normal, with a cosine falloff: an
        approximation.
    -> Scene: At least one face, one light of power above zero, and a camera.

    Raises
    ------
    InputError
        If the name or a parameter is unknown, or a file cannot be used; names file, key and value.

    Notes
    -----
    A mesh file without camera or light gets a camera that frames it and a spot that lights it, with a `RefgiWarning`.

    Examples
    --------
    >>> load_scene("cornell_box").face_count
    30
    """
    try:
        with reading() as files, reading_as(light_unit, emissive, strict=strict):
            scene = _found(source, camera, lights)
    except MemoryError as error:
        raise InputError(f"{shortened(str(source))}: does not fit in memory", file=str(source)) from error
    return dataclasses.replace(scene, source=source_of(str(source), files))


def _found(source: str | Path, camera: Camera | None, lights: Sequence[Light] | None) -> Scene:
    name = str(source)
    base = name.partition(":")[0]
    if isinstance(source, str) and base in SCENES:
        return _with(build_named(name), camera, lights)
    path = Path(source)
    suffix = path.suffix.lower()
    with blame(file=str(path)):
        if suffix == ".json":
            return read_scene_file(path, camera, lights)
        if suffix in READERS:
            return _from_mesh_file(path, camera, lights)
    if suffix or is_there(path):
        what = "a folder" if path.is_dir() else f"the suffix {suffix!r}"
        raise InputError(f"{path}: expected a scene name or a file named .json, {', '.join(READERS)}; got {what}"
                         f"{did_you_mean(base, SCENES)}", file=str(path))
    raise InputError(f"scene: expected one of {', '.join(SCENES)}, or a file; got {name!r}{did_you_mean(base, SCENES)}",
                     key="scene")


def _with(scene: Scene, camera: Camera | None, lights: Sequence[Light] | None) -> Scene:
    if camera is not None:
        scene = Scene(scene.name, scene.geometry, scene.materials, camera, scene.lights, scene.description,
                      scene.exposure)
    return scene if lights is None else scene.with_lights(*lights_with_power(lights, "lights"))


def _from_mesh_file(path: Path, camera: Camera | None, lights: Sequence[Light] | None) -> Scene:
    found = read_mesh_file(path)
    warn_of_undefined(found.undefined, str(path))
    faults: list[str] = []
    meshes, dropped = repaired_all(found.meshes, lambda number: f"{path}: {found.meshes[number].name}", faults)
    if faults:
        raise InputError(first_faults(faults))
    warn_of_flat_faces(dropped, str(path))
    geometry, materials = merge(meshes, smooth=True)
    warn_of_unit(geometry, str(path))
    lamps = lamps_where_asked(geometry, materials, str(path))
    lacking = []
    try:
        if camera is None:
            camera = found.cameras[0] if found.cameras else default_camera(geometry)
            lacking += [] if found.cameras else ["camera"]
            if (others := len(found.cameras) - 1) > 0:
                warnings.warn(RefgiWarning(f"{path}: {others} camera(s) beside the first passed over"), stacklevel=5)
        if lights is None:
            lights = found.lights or (() if lamps else (default_light(geometry, camera),))
            lacking += [] if found.lights or lamps else ["light"]
    except InputError as error:
        raise InputError(f"{path}: placed to fit the mesh: {error}") from error
    if lacking:
        text = f"{path}: the file has no {' and no '.join(lacking)}; one was placed to fit the mesh"
        warnings.warn(RefgiWarning(text), stacklevel=5)
    return Scene(text_of(path.stem), geometry, materials, camera,
                 lights_with_power((*lights, *lamps), f"{path}: lights"), emissive_lamps=len(lamps))
