"""The record of a picture: all that is needed to make it again.

One JSON object, written into every EXR and PNG and, for what all pictures of a comparison share, into results.json.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from refgi.provenance.content import geometry_digest, light_json, materials_digest
from refgi.provenance.plain import plain
from refgi.provenance.program import program, versions
from refgi.scene import Scene

VERSION = 1  # of the record; its key is `provenance`
UNITS = {"irradiance": "W/m^2", "radiance": "W/m^2/sr", "variance": "(W/m^2)^2", "seconds": "s", "ledger": "W"}
CONTENT = "irradiance.*: indirect, without albedo/pi; R, G, B: emission + albedo/pi (direct + indirect)"

Record = dict[str, Any]


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
        },
        "options": plain(options), "exposure": scene.exposure if exposure is None else exposure,
        "units": UNITS, "content": CONTENT,
    }


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


def estimate_record(estimate: Any) -> Record:
    """Return what a random estimate says of itself beyond its pixels.

    Parameters
    ----------
    estimate : TruthResult
        Mean over independent passes.

    Returns
    -------
    dict
        JSON values under the one key `estimate`: mean irradiance over the pixels that see a surface and the standard
        error of that mean, W/m^2; and `TruthResult.errors`.
    """
    return {"estimate": plain({"picture_mean": estimate.picture_mean,
                               "picture_standard_error": np.sqrt(estimate.picture_variance), **estimate.errors})}
