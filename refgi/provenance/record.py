"""The record of a picture: all that is needed to make it again.

One JSON object, written into every EXR and PNG and, for what all pictures of a comparison share, into results.json.

Which refgi this is: its version, the commit of its source tree, and the versions of what it stands on.
"""

import dataclasses
import functools
import os
import platform
import subprocess
from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.provenance.content import geometry_digest, light_json, materials_digest, plain
from refgi.scene import Scene
from refgi.scene.placed import APPROXIMATION

if TYPE_CHECKING:
    from refgi.diagnostics import LightcutsChoice, SamplingError

PACKAGES = ("refgi", "numpy", "numba", "llvmlite", "scipy", "embreex", "OpenEXR", "imageio", "pillow", "matplotlib",
            "click", "rich", "pydantic", "jinja2", "flip-evaluator")
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
    """Return the commit of the checkout that a package's folder is part of, with "-dirty" where a file in it differs.

    None where git does not keep the folder: a package installed inside another project's checkout is not of that
    project.
    """
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
