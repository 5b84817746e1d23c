"""A comparison's files: pictures, maps and results.json, each written whole or not at all.

results.json is the record: whatever the page and the table show is in it. Numbers that JSON cannot hold are null (not
known, not defined) or the words "inf" and "-inf".
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from refgi import stages
from refgi.compare import pictures as maps
from refgi.compare.outcome import TRUTH, UNOCCLUDED, Comparison, MethodResult, Reference
from refgi.compare.pictures import linear_planes, write_preview
from refgi.image import canonical_json, write_encoded, write_exr, write_text
from refgi.provenance import UNITS, Record, method_record, plain
from refgi.types import Array

SCHEMA = 1


def write_results(comparison: Comparison, folder: Path) -> None:
    """Write an EXR and a PNG a method and reference, maps a method, and at last results.json."""
    for reference in comparison.references.values():
        _write_picture(comparison, folder, reference)
    scale = error_scale(comparison)
    brightness = maps.luminance_scale(comparison.truth.irradiance, comparison.covered)
    for result in comparison.results.values():
        record = _write_picture(comparison, folder, result)
        for judge in result.against:
            painted = maps.paint(signed_error(comparison, result, judge), comparison.covered, scale)
            title = f"{result.name} - {judge}"
            write_encoded(folder / _error_name(result.name, judge), maps.with_legend(painted, scale, title), record)
        painted = maps.paint(maps.luminance(result.irradiance), comparison.covered, brightness)
        encoded = maps.with_legend(painted, brightness, result.name)
        write_encoded(folder / _false_colour_name(result.name), encoded, record)
    write_text(folder / "results.json", canonical_json(as_json(comparison)) + "\n")


def file_names(methods: Sequence[str]) -> list[str]:
    """Return the names, without folder, of all files that a comparison of methods may write."""
    pictures = [f"{name}{suffix}" for name in (*methods, TRUTH, UNOCCLUDED) for suffix in (".exr", ".png")]
    maps_of = [name for method in methods
               for name in (_false_colour_name(method), *(_error_name(method, j) for j in (TRUTH, UNOCCLUDED)))]
    return [*pictures, *maps_of, "results.json", "index.html"]


def as_json(comparison: Comparison) -> dict[str, Any]:
    """Return everything but the pixels as JSON values, the content of results.json."""
    scene = comparison.scene
    content: dict[str, Any] = plain({
        "schema": SCHEMA,
        "refgi": comparison.record["refgi"],
        "provenance": comparison.record,
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


def record_of(comparison: Comparison, made: Reference | MethodResult) -> Record:
    """Return the record of one picture of a comparison: all that is needed to make it again."""
    if isinstance(made, Reference):
        return {**comparison.record, **made.record}
    still = {} if made.still is None else made.still.record
    return {**comparison.record, **method_record(made.name, made.settings), **still}


def ledger_json(ledger: Any) -> dict[str, Any]:
    """Return a ledger as JSON: rows by name in W, which of them sum to the first, what the sum is off by."""
    return {"rows": {row.name: row.watts for row in ledger.rows},
            "parts": [row.name for row in ledger.rows if row.is_part], "difference": ledger.difference}


def signed_error(comparison: Comparison, result: MethodResult, judge: str = TRUTH) -> Array:
    """Return the luminance of a method's irradiance less that of a reference, (h, w), W/m^2; above 0: too bright."""
    return maps.luminance(result.irradiance) - maps.luminance(comparison.references[judge].irradiance)


def error_scale(comparison: Comparison) -> maps.Scale:
    """Choose the scale, symmetric about 0, that all error maps of a comparison share."""
    errors = [signed_error(comparison, r, judge) for r in comparison.results.values() for judge in r.against]
    return maps.error_scale(errors, comparison.covered)


def _write_picture(comparison: Comparison, folder: Path, made: Reference | MethodResult) -> Record:
    """Write EXR and PNG, and return the record that they hold."""
    record = record_of(comparison, made)
    planes = made.planes if isinstance(made, Reference) else linear_planes(
        made.radiance, made.irradiance, frames=made.frames, lobes=made.lobes)
    write_exr(folder / f"{made.name}.exr", planes, record)
    write_preview(folder / f"{made.name}.png", made.radiance, record)
    return record


def _false_colour_name(method: str) -> str:
    return f"{method}_false_colour.png"


def _error_name(method: str, judge: str) -> str:
    return f"{method}_error.png" if judge == TRUTH else f"{method}_error_{judge}.png"


def _reference(reference: Reference, covered: Array) -> dict[str, Any]:
    samples, values = reference.samples[covered], reference.irradiance[:, covered]
    return {
        "settings": reference.settings, "seconds": reference.seconds, "stages": _stages(reference.runs),
        "samples": {"fewest": int(samples.min()), "most": int(samples.max()), "mean": float(samples.mean())},
        "mean_irradiance": float(values.mean()),
        "standard_error_of_a_pixel": float(np.sqrt(reference.variance[:, covered]).mean()),
        "standard_error_of_the_mean": float(np.sqrt(reference.mean_variance).mean()),
        **reference.estimate,
        "files": [f"{reference.name}.exr", f"{reference.name}.png"],
    }


def _method(result: MethodResult) -> dict[str, Any]:
    return {
        "summary": result.summary, "settings": result.settings, "seconds": result.seconds,
        "stages": _stages(result.runs),
        "against": result.against, **({"lobes_against": result.lobes_against} if result.lobes_against else {}),
        "flip": {key: getattr(result.flip, key) for key in ("mean", "exposures", "skipped")},
        "ledger": None if result.ledger is None else ledger_json(result.ledger),
        "files": [f"{result.name}.exr", f"{result.name}.png", _false_colour_name(result.name),
                  *(_error_name(result.name, judge) for judge in result.against)],
    }


def _stages(runs: tuple[stages.Run, ...]) -> list[dict[str, Any]]:
    return [{"name": r.name, "status": r.status, "seconds": r.seconds, "depth": r.depth, "reason": r.reason}
            for r in runs]
