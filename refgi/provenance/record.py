"""The record of a picture: all that is needed to make it again, as one JSON object in every EXR, PNG and results.json.

What a scene consists of as JSON values and back, digests of its surfaces, and which refgi on which machine this is.
"""

import dataclasses
import functools
import hashlib
import math
import os
import platform
import subprocess
from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.errors import InputError
from refgi.image import canonical_json
from refgi.scene import Camera, DirectionalLight, Light, Material, PointLight, Scene, SpotLight
from refgi.scene.material import TEXTURES
from refgi.scene.placed import APPROXIMATION
from refgi.settings import Settings, flat

if TYPE_CHECKING:
    from refgi.diagnostics import LightcutsChoice, SamplingError

LIGHTS: dict[str, type[SpotLight] | type[PointLight] | type[DirectionalLight]] = {
    "spot": SpotLight, "point": PointLight, "directional": DirectionalLight}


def plain(value: Any) -> Any:
    """Turn settings and figures into finite JSON values.

    Parameters
    ----------
    value : object
        Dataclasses, mappings, sequences, sets, numbers, text, types.

    Returns
    -------
    object
        The same as dict, list, str, int, float, bool and None.
    """
    if isinstance(value, Settings):
        return {key: plain(item) for key, item in flat(value).items()}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, dict) or hasattr(value, "items"):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, set | frozenset):
        return sorted(map(plain, value))
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def geometry_digest(scene: Scene) -> str:
    """Return SHA-256 over triangles, normals, texture coordinates and materials by number; equal on every machine."""
    shape, digest = scene.geometry, hashlib.sha256()
    for array, kind in ((shape.vertices, "<f8"), (shape.faces, "<i4"), (shape.material_of_face, "<i4"),
                        (shape.vertex_normals, "<f8")):
        plane = np.zeros(0, kind) if array is None else np.ascontiguousarray(array, kind)
        digest.update(f"{plane.shape}\0".encode() + plane.tobytes())
    for key in ("uv", "colours"):
        if getattr(shape, key) is not None:  # absent, the digest is that of earlier versions
            plane = np.ascontiguousarray(getattr(shape, key), "<f8")
            digest.update(f"{key} {plane.shape}\0".encode() + plane.tobytes())
    return digest.hexdigest()


def materials_digest(scene: Scene) -> str:
    """Return SHA-256 over all materials in order, with every texel of their images; equal on every machine."""
    return hashlib.sha256(canonical_json([_material_json(one) for one in scene.materials]).encode()).hexdigest()


def _material_json(material: Material) -> dict[str, Any]:
    """Return a material as JSON values; textures, alpha and cutoff only where it has some, images by their digests."""
    without: dict[str, Any] = dict.fromkeys(TEXTURES)
    fields: dict[str, Any] = plain(dataclasses.replace(material, **without))
    del fields["one_sided"]
    for key in TEXTURES:
        del fields[key]
        texture = getattr(material, key)
        if texture is not None:
            fields[key] = {"image": texture.image.digest, "wrap": list(texture.wrap), "filter": texture.filter}
    if material.cutoff is None:  # absent, the digest is that of earlier versions
        del fields["alpha"], fields["cutoff"]
    for key in ("sends", "solid"):
        if getattr(material, key) == getattr(Material, key):
            del fields[key]
    return fields


def light_json(light: Light) -> dict[str, Any]:
    """Return a light's type and fields as JSON values, angles in rad; the smoothstep falloff is left out."""
    kind = next(name for name, one in LIGHTS.items() if isinstance(light, one))
    fields: dict[str, Any] = plain(light)
    if isinstance(light, SpotLight) and light.falloff == SpotLight.falloff:  # as in earlier versions
        del fields["falloff"]
    return {"type": kind} | fields


def light_from(content: Mapping[str, Any]) -> Light:
    """Return the light that `light_json` wrote, equal to the bit. Raises InputError if the content is not a light's."""
    kind = LIGHTS.get(str(content.get("type")), PointLight)
    usual = {"falloff": SpotLight.falloff} if kind is SpotLight else {}
    made: Light = _made(kind, usual | {key: value for key, value in content.items() if key != "type"}, "light")
    return made


def camera_from(content: Mapping[str, Any]) -> Camera:
    """Return the camera that `plain` wrote, equal to the bit. Raises InputError if the content is not a camera's."""
    camera: Camera = _made(Camera, content, "camera")
    return camera


def _made(kind: type[Any], content: Mapping[str, Any], key: str) -> Any:
    known = {field.name for field in dataclasses.fields(kind)}
    if set(content) != known:
        raise InputError(f"{key}: expected the keys {', '.join(sorted(known))}, got {', '.join(sorted(content))}",
                         key=key)
    return kind(**content)


PACKAGES = ("refgi", "numpy", "numba", "llvmlite", "scipy", "embreex", "OpenEXR", "imageio", "pillow", "matplotlib",
            "click", "rich", "pydantic", "jinja2", "flip-evaluator")
SIMD = ("sse2", "avx", "avx2", "fma", "avx512f", "avx512vl", "neon", "sve")
GIT_SECONDS = 10.0
DIRTY = "-dirty"
VERSION = 2  # of the record; its key is `provenance`
UNITS = {"irradiance": "W/m^2", "radiance": "W/m^2/sr", "variance": "(W/m^2)^2", "seconds": "s", "ledger": "W"}
CONTENT = "irradiance.*: indirect, without albedo/pi; R, G, B: emission + albedo/pi (direct + indirect)"
LOBE_UNITS = {"lobes": "W/m^2/sr", "lobe_variance": "(W/m^2/sr)^2"}
LOBE_CONTENT = f"{CONTENT} + lobes by direct light + lobes.*; lobes.*: receivers' lobes by indirect light"

Record = dict[str, Any]


def versions() -> dict[str, str | None]:
    """Return the versions of Python, refgi and what it stands on.

    Returns
    -------
    dict of str to str
        None for a package that is not installed.
    """
    return {"python": platform.python_version()} | {name: _version(name) for name in PACKAGES}


def environment() -> dict[str, Any]:
    """Return versions, platform, cpu, simd (features of the processor) and threads as JSON values."""
    import llvmlite.binding

    from refgi.jit import thread_count

    features = llvmlite.binding.get_host_cpu_features()
    return {
        "versions": versions(),
        "platform": f"{platform.system()} {platform.machine()}",
        "cpu": llvmlite.binding.get_host_cpu_name(),
        "simd": [name for name in SIMD if features.get(name)],
        "threads": thread_count(),
    }


def program() -> dict[str, str]:
    """Return which refgi this is.

    Returns
    -------
    dict of str to str
        `version`, and `git` where the package lies in its own git checkout: the commit, with "-dirty" where a file of
        the package differs from it.
    """
    commit = git_id(Path(__file__).resolve().parents[1])
    return {"version": import_module("refgi").__version__} | ({} if commit is None else {"git": commit})


@functools.cache
def git_id(package: Path) -> str | None:
    """Return the commit of the checkout that keeps a package, with "-dirty" where a file differs; None without one."""
    if not _git(package, "ls-files", "__init__.py"):
        return None
    commit = _git(package, "rev-parse", "HEAD")
    changes = _git(package, "status", "--porcelain", "--", ".")
    return commit and commit + (DIRTY if changes else "")


def _git(folder: Path, *arguments: str) -> str | None:
    """Return what git says, None where there is no git or it refuses."""
    quiet = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
    try:
        done = subprocess.run(["git", *arguments], cwd=folder, env=quiet | {"GIT_OPTIONAL_LOCKS": "0"},
                              capture_output=True, text=True, timeout=GIT_SECONDS, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


@functools.cache
def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def scene_record(
    scene: Scene, options: Mapping[str, Any], *, size: tuple[int, int] | None = None, exposure: float | None = None
) -> Record:
    """Return what all pictures of one scene share, whatever the method.

    Parameters
    ----------
    scene : Scene
        As it was loaded, with the camera and lights that it is seen by.
    options : mapping
        The resolved options of its `Frame`: dtype, rsm_resolution, shadows.
    size : (int, int), optional
        Width and height in pixels; the camera's own where absent.
    exposure : float, optional
        Factor before the sRGB curve of a PNG; the scene's where absent.

    Returns
    -------
    dict
        JSON values.
    """
    camera = scene.camera if size is None else dataclasses.replace(scene.camera, width=size[0], height=size[1])
    source = scene.source
    return {
        "provenance": VERSION, "refgi": program(), "versions": versions(),
        "scene": {
            "source": None if source is None else source.name, "files": {} if source is None else dict(source.files),
            "name": scene.name, "faces": scene.face_count, "geometry_sha256": geometry_digest(scene),
            "materials_sha256": materials_digest(scene), "camera": plain(camera),
            "lights": [light_json(light) for light in scene.lights],
            **({"emissive_lamps": {"count": scene.emissive_lamps, "approximation": APPROXIMATION}}
               if scene.emissive_lamps else {}),
        },
        "options": plain(options), "exposure": scene.exposure if exposure is None else exposure,
        **({"units": UNITS | LOBE_UNITS, "content": LOBE_CONTENT} if _reflects_by_lobes(scene) else
           {"units": UNITS, "content": CONTENT}),
    }


def _reflects_by_lobes(scene: Scene) -> bool:
    """Return whether any material of a scene has a lobe, so that its pictures may hold lobes."""
    return any(material.is_glossy and not material.is_dielectric for material in scene.materials)


def method_record(method: str, settings: Any) -> Record:
    """Return what a method adds to the record of a scene.

    Parameters
    ----------
    method : str
        Short name of a method.
    settings : dataclass
        All its settings.

    Returns
    -------
    dict
        JSON values.
    """
    return {"method": method, "settings": plain(settings)}


def stated_record(stated: "SamplingError | LightcutsChoice") -> Record:
    """Return what a method says of its picture, with a statement in a line.

    Parameters
    ----------
    stated : SamplingError or LightcutsChoice
        As a picture has it.

    Returns
    -------
    dict
        JSON values.
    """
    return {**plain(stated._asdict()), "statement": stated.statement}


def estimate_record(estimate: Any, lobes: Any = None) -> Record:
    """Return what a random estimate says of itself beyond its pixels.

    Parameters
    ----------
    estimate : TruthResult
        Mean over independent passes.
    lobes : TruthResult, optional
        Of receivers' lobes, where a glossy surface is seen.

    Returns
    -------
    dict
        JSON values under the key `estimate`: mean irradiance over the pixels that see a surface and the standard
        error of that mean, W/m^2; and `TruthResult.errors`. The same of lobes, W/m^2/sr, under `lobes` within.
    """
    of_lobes = {} if lobes is None else {"lobes": _figures(lobes)}
    return {"estimate": plain({**_figures(estimate), **of_lobes})}


def _figures(estimate: Any) -> dict[str, Any]:
    return {"picture_mean": estimate.picture_mean, "picture_standard_error": np.sqrt(estimate.picture_variance),
            **estimate.errors}
