"""A comparison's files: pictures, maps, results.json, and the page; each is written whole or not at all.

results.json is the record: whatever the page and the table show is in it. Numbers that JSON cannot hold are null (not
known, not defined) or the words "inf" and "-inf".
"""

import functools
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from refgi import stages
from refgi.compare import pictures as maps
from refgi.compare.album import LABELS, Judge, Picture, View, album
from refgi.compare.outcome import TRUTH, UNOCCLUDED, Comparison, Figure, Measurement, MethodResult, Reference
from refgi.compare.pages import DASH, MINUS, TIMES, Point, markup, number, page_of, sort_key, time_against_error
from refgi.compare.pictures import linear_planes, write_preview
from refgi.image import canonical_json, write_encoded, write_exr, write_text
from refgi.provenance import UNITS, Record, method_record, plain
from refgi.scene.files import text_of
from refgi.types import Array

DEGREE = "\N{DEGREE SIGN}"


def provenance_rows(record: Record) -> list[tuple[str, str]]:
    """Return what a record says, as (name, text), in the order in which one asks."""
    scene, program = record["scene"], record["refgi"]
    return [
        ("scene", "made in Python" if scene["source"] is None else text_of(scene["source"])),
        *((f"file {text_of(name)}", f"SHA-256 {digest}") for name, digest in scene["files"].items()),
        ("geometry", f"{scene['faces']:,} faces, SHA-256 {scene['geometry_sha256']}"),
        ("materials", f"SHA-256 {scene['materials_sha256']}"),
        ("camera", _fields(scene["camera"])),
        *((f"light {number}", f"{light['type']}; {_fields(light)}") for number, light in enumerate(scene["lights"])),
        *((key.replace("_", " "), str(value)) for key, value in record["options"].items()),
        ("refgi", f"{program['version']}, commit {program.get('git', 'unknown')}"),
    ]


def _fields(content: dict[str, Any]) -> str:
    return "; ".join(f"{key.replace('_', ' ')} {_value(value)}" for key, value in content.items() if key != "type")


def _value(value: Sequence[float] | float) -> str:
    if isinstance(value, Sequence):
        return ", ".join(f"{part:g}" for part in value)
    return str(value) if isinstance(value, int) else f"{math.degrees(value):g}{DEGREE}"  # sizes, and angles


JUDGES = {TRUTH: "truth", UNOCCLUDED: "truth without visibility"}
COLUMNS = {
    "relmse": ("relMSE", "mean of (x-r)² / (r² + (0.1 mean r)²)"), "rmse": ("RMSE", "W/m²"), "mae": ("MAE", "W/m²"),
    "smape": ("SMAPE", "mean of |x-r| / (|x|+|r|)"), "bias": ("bias", "mean of x-r, W/m²"),
    "psnr": ("PSNR", "dB, peak: the reference's maximum"), "ssim": ("SSIM", "of linear values"),
}


def write_report(comparison: Comparison, folder: Path) -> None:
    """Write index.html, whole or not at all; InputError if it cannot be written."""
    write_text(Path(folder) / "index.html", page(comparison))


def page(comparison: Comparison) -> str:
    """Return the page as HTML that refers to nothing outside itself; the same for equal input."""
    return page_of(
        "report.html.j2", comparison.environment,
        kind="comparison", title=comparison.scene.name, lead=comparison.scene.description, facts=_facts(comparison),
        verdict=_verdict(comparison),
        failures=[*((name, f"gave no picture: {reason}") for name, reason in comparison.failures.items()),
                  *(doubt.split(": ", 1) for one in comparison.references.values() for doubt in one.doubts)],
        album=album([_view(comparison)]), again=next(iter(comparison.results), TRUTH),
        columns=[{"label": label, "about": about} for label, about in (*COLUMNS.values(), ("FLIP", "of the picture"))],
        rows=_rows(comparison), notes=_notes(comparison), plot=markup(_plot(comparison)), made=_made(comparison),
        ledgers=[_ledger(result) for result in comparison.results.values() if result.ledger is not None],
        provenance=provenance_rows(comparison.record))


def ledger_cells(ledger: Any) -> list[tuple[str, ...]]:
    """Write a ledger as cells: name, R, G, B in W, percent of the first row, meaning; last what the sum is off by."""
    whole = float(np.sum(ledger.rows[0].watts))
    rows = [(row.name.replace("_", " "), row.watts, row.meaning) for row in ledger.rows]
    rows.append(("difference", ledger.difference, "of emitted and the sum of its parts"))
    return [(name, *(number(float(w)) for w in watts), _percent(float(np.sum(watts)), whole), meaning)
            for name, watts, meaning in rows]


def _percent(part: float, whole: float) -> str:
    return DASH if whole == 0 else f"{round(100 * part / whole, 2) + 0.0:.2f} %".replace("-", MINUS)


def _seconds(value: float) -> str:
    return f"{number(value)}\N{NO-BREAK SPACE}s"


def _facts(comparison: Comparison) -> list[str]:
    scene, truth = comparison.scene, comparison.truth
    covered = truth.samples[comparison.covered]
    return [
        f"{comparison.width} {TIMES} {comparison.height} pixels", f"{comparison.covered.mean():.0%} covered",
        _count(scene.face_count, "face"), _count(len(scene.lights), "light"),
        f"truth: {covered.mean():,.0f} samples a pixel in {_seconds(truth.seconds)}", comparison.options["dtype"],
    ]


def _count(count: int, what: str) -> str:
    return f"{count:,} {what}{'s' * (count != 1)}"


def _verdict(comparison: Comparison) -> str:
    scored = [(r.against[TRUTH].figures["relmse"], r) for r in comparison.results.values()]
    scored = [(figure, r) for figure, r in scored if math.isfinite(figure.value)]
    if not scored:
        return "No method gave a figure against the truth."
    figure, best = min(scored, key=lambda pair: pair[0].value)
    noise = ", within the noise of the truth" if figure.is_noise else ""
    return f"Closest to the truth: {best.name}, relMSE {number(figure.value)} in {_seconds(best.seconds)}{noise}."


def _light(made: MethodResult) -> tuple[Array, Array]:
    return made.irradiance, made.radiance


def _view(comparison: Comparison) -> View:
    judges = {one.name: Judge(one.irradiance, one.variance, one.radiance, _seconds(one.seconds))
              for one in comparison.references.values()}
    pictures = [Picture(one.name, one.name, f"relMSE {number(one.against[TRUTH].figures['relmse'].value)}, "
                                            + _seconds(one.seconds),
                        tuple(one.against), functools.partial(_light, one))
                for one in comparison.results.values()]
    return View("scene", comparison.scene.name, comparison.scene.exposure, comparison.covered, judges, pictures, {})


def _rows(comparison: Comparison) -> list[dict[str, Any]]:
    return [
        {"name": result.name, "first": index == 0, "judge": JUDGES[judge],
         "seconds": _seconds(result.seconds), "sort": result.seconds,
         "cells": [*(_cell(measurement.figures[name]) for name in COLUMNS), _flip_cell(result, judge)]}
        for result in comparison.results.values() for index, (judge, measurement) in enumerate(result.against.items())
    ]


def _cell(figure: Figure) -> dict[str, Any]:
    noise = "" if math.isnan(figure.noise) else number(figure.noise)
    return {"value": number(figure.value), "noise": noise, "is_noise": figure.is_noise, "sort": sort_key(figure.value)}


def _flip_cell(result: MethodResult, judge: str) -> dict[str, Any]:
    mean = result.flip.mean if judge == TRUTH else math.nan
    return {"value": "" if judge != TRUTH else number(mean), "noise": "", "is_noise": False, "sort": sort_key(mean)}


def _notes(comparison: Comparison) -> list[str]:
    notes = [f"{result.name}: {_bad_pixels(result.against[TRUTH])}." for result in comparison.results.values()
             if _bad_pixels(result.against[TRUTH])]
    for result in comparison.results.values():
        for judge, measurement in result.lobes_against.items():
            figures = measurement.figures
            notes.append(f"{result.name}: lobes of glossy receivers are off from those of the {JUDGES[judge]} by a "
                         f"RMSE of {number(figures['rmse'].value)} W/m²/sr (its noise alone: "
                         f"{number(figures['rmse'].noise)}), relMSE {number(figures['relmse'].value)}.")
    skipped = {result.flip.skipped for result in comparison.results.values() if result.flip.skipped}
    return notes + [f"FLIP was not computed: {reason}." for reason in sorted(skipped)]


def _bad_pixels(measurement: Measurement) -> str:
    parts = [(measurement.non_finite, "pixels"), (measurement.non_finite_reference, "pixels of the truth")]
    return " and ".join(f"{count} {whose} are NaN or infinite, so no figure is defined" for count, whose in parts
                        if count)


def _plot(comparison: Comparison) -> str:
    points = [Point(result.name, result.seconds, measurement.figures["relmse"].value, judge == TRUTH)
              for result in comparison.results.values() for judge, measurement in result.against.items()]
    noises = [result.against[TRUTH].figures["relmse"].noise for result in comparison.results.values()]
    return time_against_error(points, next((n for n in noises if n > 0), 0.0))


def _made(comparison: Comparison) -> list[dict[str, Any]]:
    everything: list[Reference | MethodResult] = [*comparison.results.values(), *comparison.references.values()]
    return [{"name": LABELS.get(made.name, made.name),
             "summary": made.summary if isinstance(made, MethodResult) else "path tracing",
             "settings": plain(made.settings) or {}, "stages": [_stage(run) for run in made.runs]}
            for made in everything]


def _ledger(result: MethodResult) -> dict[str, Any]:
    parts = [row.is_part for row in result.ledger.rows]
    return {"name": result.name, "rows": list(zip(ledger_cells(result.ledger), [*parts, False], strict=True))}


def _stage(run: stages.Run) -> dict[str, Any]:
    said = f"{number(1e3 * run.seconds)} ms" if run.status == "ran" else f"{run.status}: {run.reason}"
    return {"name": run.name, "status": run.status, "depth": run.depth, "said": said}


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
