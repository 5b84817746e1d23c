"""A comparison's files: pictures, maps and results.json, each written whole or not at all.

results.json is the record: whatever the page and the table show is in it. Numbers that JSON cannot hold are null (not
known, not defined) or the words "inf" and "-inf".
"""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi import stages
from refgi.compare import maps
from refgi.compare.flip import Flip
from refgi.compare.measurement import Measurement
from refgi.compare.outcome import TRUTH, Comparison, MethodResult, Reference
from refgi.image import canonical_json, whole_file, write_exr, write_png, write_text

Array = npt.NDArray[Any]

SCHEMA = 1
UNITS = {"irradiance": "W/m^2", "radiance": "W/m^2/sr", "variance": "(W/m^2)^2", "seconds": "s", "ledger": "W"}
CONTENT = "irradiance.*: indirect, without albedo/pi; R, G, B: emission + albedo/pi (direct + indirect)"


def write_results(comparison: Comparison, folder: Path) -> None:
    """Write an EXR and a PNG a method and reference, maps a method, and at last results.json.

    Parameters
    ----------
    comparison : Comparison
        What `compare` gave.
    folder : Path
        An existing folder.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    for reference in comparison.references.values():
        channels = _planes("irradiance", reference.irradiance) | _planes("variance", reference.variance)
        channels["samples"] = np.asarray(reference.samples, np.float32)
        _write_picture(comparison, folder, reference, channels)
    scale = error_scale(comparison)
    brightness = maps.luminance_scale(comparison.truth.irradiance, comparison.covered)
    for result in comparison.results.values():
        _write_picture(comparison, folder, result, _planes("irradiance", result.irradiance))
        for judge in result.against:
            painted = maps.paint(signed_error(comparison, result, judge), comparison.covered, scale)
            _write_map(folder / _error_name(result.name, judge), painted, scale, f"{result.name} - {judge}")
        painted = maps.paint(maps.luminance(result.irradiance), comparison.covered, brightness)
        _write_map(folder / f"{result.name}_false_colour.png", painted, brightness, result.name)
    write_text(folder / "results.json", canonical_json(as_json(comparison)) + "\n")


def as_json(comparison: Comparison) -> dict[str, Any]:
    """Return everything but the pixels as JSON values.

    Parameters
    ----------
    comparison : Comparison
        What `compare` gave.

    Returns
    -------
    dict
        The content of results.json.
    """
    scene = comparison.scene
    content: dict[str, Any] = plain({
        "schema": SCHEMA,
        "scene": {"name": scene.name, "description": scene.description, "faces": scene.face_count,
                  "lights": len(scene.lights), "exposure": scene.exposure, "camera": scene.camera},
        "size": [comparison.width, comparison.height],
        "covered_pixels": int(comparison.covered.sum()),
        "options": comparison.options,
        "environment": comparison.environment,
        "units": UNITS,
        "references": {r.name: _reference(r, comparison.covered) for r in comparison.references.values()},
        "methods": {r.name: _method(r) for r in comparison.results.values()},
        "failures": comparison.failures,
        "sound": comparison.is_sound,
    })
    return content


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


def ledger_json(ledger: Any) -> dict[str, Any]:
    """Return a ledger as values for JSON.

    Parameters
    ----------
    ledger : object
        What a method's ledger function gave.

    Returns
    -------
    dict
        The rows by name, R, G, B in W; which of them sum to the first; and what the sum is off by.
    """
    return {"rows": {row.name: row.watts for row in ledger.rows},
            "parts": [row.name for row in ledger.rows if row.is_part], "difference": ledger.difference}


def signed_error(comparison: Comparison, result: MethodResult, judge: str = TRUTH) -> Array:
    """Return the luminance of a method's indirect irradiance less the reference's.

    Parameters
    ----------
    comparison : Comparison
        Holds the reference.
    result : MethodResult
        The method.
    judge : str
        Name of the reference.

    Returns
    -------
    (h, w) ndarray
        W/m^2; positive where the method is too bright.
    """
    return maps.luminance(result.irradiance) - maps.luminance(comparison.references[judge].irradiance)


def error_scale(comparison: Comparison) -> maps.Scale:
    """Choose the scale that all error maps of a comparison share.

    Parameters
    ----------
    comparison : Comparison
        What `compare` gave.

    Returns
    -------
    Scale
        Symmetric about 0.
    """
    errors = [signed_error(comparison, r, judge) for r in comparison.results.values() for judge in r.against]
    return maps.error_scale(errors, comparison.covered)


def _write_picture(comparison: Comparison, folder: Path, made: Reference | MethodResult,
                   channels: dict[str, Array]) -> None:
    channels |= {name: np.asarray(plane, np.float32) for name, plane in zip("RGB", made.radiance, strict=True)}
    attributes = {"method": made.name, "settings": plain(made.settings), "scene": comparison.scene.name,
                  "options": plain(comparison.options), "units": UNITS, "content": CONTENT,
                  "versions": comparison.environment.get("versions", {})}
    write_exr(folder / f"{made.name}.exr", channels, attributes)
    write_png(folder / f"{made.name}.png", np.moveaxis(made.radiance, 0, -1), comparison.scene.exposure)


def _write_map(path: Path, painted: maps.Pixels, scale: maps.Scale, title: str) -> None:
    with whole_file(path) as temporary:
        temporary.write_bytes(maps.with_legend(painted, scale, title))


def _error_name(method: str, judge: str) -> str:
    return f"{method}_error.png" if judge == TRUTH else f"{method}_error_{judge}.png"


def _planes(name: str, rgb: Array) -> dict[str, Array]:
    return {f"{name}.{channel}": np.asarray(plane, np.float32) for channel, plane in zip("RGB", rgb, strict=True)}


def _reference(reference: Reference, covered: Array) -> dict[str, Any]:
    samples, values = reference.samples[covered], reference.irradiance[:, covered]
    return {
        "settings": reference.settings, "seconds": reference.seconds, "stages": _stages(reference.runs),
        "samples": {"fewest": int(samples.min()), "most": int(samples.max()), "mean": float(samples.mean())},
        "mean_irradiance": float(values.mean()),
        "standard_error_of_a_pixel": float(np.sqrt(reference.variance[:, covered]).mean()),
        "standard_error_of_the_mean": float(np.sqrt(reference.mean_variance).mean()),
        "errors": reference.errors,
        "files": [f"{reference.name}.exr", f"{reference.name}.png"],
    }


def _method(result: MethodResult) -> dict[str, Any]:
    return {
        "summary": result.summary, "settings": result.settings, "seconds": result.seconds,
        "stages": _stages(result.runs),
        "against": {judge: _measurement(m) for judge, m in result.against.items()},
        "flip": _flip(result.flip),
        "ledger": None if result.ledger is None else ledger_json(result.ledger),
        "files": [f"{result.name}.exr", f"{result.name}.png", f"{result.name}_false_colour.png",
                  *(_error_name(result.name, judge) for judge in result.against)],
    }


def _measurement(measurement: Measurement) -> dict[str, Any]:
    return {field.name: getattr(measurement, field.name) for field in dataclasses.fields(measurement)}


def _flip(flip: Flip) -> dict[str, Any]:
    return {"mean": flip.mean, "exposures": flip.exposures, "skipped": flip.skipped}


def _stages(runs: tuple[stages.Run, ...]) -> list[dict[str, Any]]:
    return [{"name": r.name, "status": r.status, "seconds": r.seconds, "depth": r.depth, "reason": r.reason}
            for r in runs]
