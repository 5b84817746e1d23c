"""`refgi compare` and `refgi check`: methods on one scene, and a port's finished picture, judged by path tracing."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from refgi.cli.options import EXACT, MACHINE, SEEN, WRITING, Asked, verb
from refgi.cli.session import DONE, FAILED, Session, progress, say, table

if TYPE_CHECKING:
    from refgi.compare import Comparison

SHOWN = {"relmse": "relMSE", "rmse": "RMSE", "bias": "bias", "psnr": "PSNR", "ssim": "SSIM"}
INDIRECT = "irradiance."  # channels that hold it begin with that


@verb("compare", "SCENE", *SEEN, "methods", "preset", "set", "frames", "temporal", *MACHINE, "shadows", "out", *WRITING,
      methods="Methods to compare; all where absent.", shadows=EXACT,
      set={"metavar": "METHOD.KEY=VALUE",
           "help": "A setting of a method or of truth, such as truth.samples=64; repeatable."},
      out="Folder for EXR, PNG, error maps, results.json and index.html.")
def _compare(session: Session, asked: Asked) -> int:
    """Judge methods on SCENE by path tracing: errors, times, a page.

    Writes pictures, error maps, results.json and index.html to --out.

    With --frames, a method with a temporal filter shows its picture after so many frames; its time is that of one.

    A method that knows no visibility is also compared with the truth without visibility, to which it converges.
    """
    from refgi.cli.destination import Permission, folder
    from refgi.cli.view import on_threads, require_memory, scene_of, still_frames, warm_up
    from refgi.compare import compare
    from refgi.compare.results import file_names

    names, settings = _methods(asked)
    still = still_frames(names, asked.frames, asked.filtering)
    scene = scene_of(asked)
    if asked.out is not None:
        folder(asked.out, Permission(asked.parents, asked.force), file_names(names))
    require_memory(scene, asked.dtype, asked.rsm_resolution, traced=True, compared=len(names) + 2, settings=settings)
    with on_threads(asked.threads), progress() as tell:
        warm_up([*names, "truth"], asked.dtype, tell)
        comparison = compare(scene, names, truth_settings=settings.pop("truth"), method_settings=settings,
                             out=asked.out, still=still, progress=tell, dtype=asked.dtype,
                             rsm_resolution=asked.rsm_resolution, shadows=asked.shadows)
    _report(session, comparison, asked.out)
    return DONE if comparison.is_sound else FAILED


def _methods(asked: Asked) -> tuple[list[str], dict[str, Any]]:
    """Return the methods to compare, and settings by name, those of the truth among them."""
    from refgi.cli.view import by_method, has_seed, named_methods, settings_for
    from refgi.errors import InputError
    from refgi.method import DEFAULT
    from refgi.methods import METHODS, find_method

    names = named_methods(asked.methods) or list(METHODS)
    names = [name for name in names if find_method(name).name != "truth"]
    if not names:
        raise InputError("--methods: expected a method besides truth, got none")
    texts = by_method(asked.pairs, [*names, "truth"])
    preset = asked.preset
    having = [name for name in names if preset == DEFAULT or preset in METHODS[name].presets]
    if not having:
        raise InputError(f"--preset: expected one that a method compared here has, got {preset!r}", key="preset")
    return names, {name: settings_for(name, own, asked.seed if has_seed(name) else None,
                                      preset if name in having else DEFAULT) for name, own in texts.items()}


def _report(session: Session, comparison: "Comparison", out: str | None) -> None:
    from refgi.compare.metrics import count_non_finite
    from refgi.compare.results import as_json
    from refgi.scene.repair import faintest_irradiance

    if comparison.truth.irradiance.max() <= faintest_irradiance(comparison.scene.lights, comparison.scene.geometry):
        say("there is no indirect light in this scene: the truth is wholly black")
    if bad := count_non_finite(comparison.truth.irradiance, comparison.covered):
        say(f"{bad} pixels of the truth are NaN or infinite")
    for reference in comparison.references.values():
        for doubt in reference.doubts:
            say(f"{comparison.scene.name}: {doubt}")
    for name, result in comparison.results.items():
        if bad := result.against["truth"].non_finite:
            say(f"{name}: {bad} pixels are NaN or infinite")
    for name, reason in comparison.failures.items():
        say(f"{name} gave no picture: {reason}")
    where = f"\n\nopen {out.rstrip('/')}/index.html" if out else ""
    session.result(_table(comparison) + where, as_json(comparison) | {"out": out})


def _table(comparison: "Comparison") -> str:
    from refgi.compare.pages import number
    from refgi.compare.report import JUDGES

    rows: list[tuple[str, ...]] = [("method", "against", "time", *SHOWN.values(), "FLIP")]
    for result in comparison.results.values():
        for judge, measurement in result.against.items():
            first = judge == "truth"
            figures = (measurement.figures[name] for name in SHOWN)
            rows.append((result.name if first else "", JUDGES[judge], f"{number(result.seconds)} s" if first else "",
                         *(number(f.value) + ("*" if f.is_noise else " ") for f in figures),
                         number(result.flip.mean) if first else ""))
    text = table(rows, right=frozenset(range(2, len(rows[0]))))
    text += "\n* within the noise of the truth" if "*" in text else ""
    estimate = comparison.truth.estimate.get("estimate")
    return text + (f"\n\ntruth: {estimate['statement']}" if estimate else "")


@verb("check", "PICTURE", "against", "layer", "part", *SEEN, "method", "preset", "set", "tolerance", *MACHINE,
      "shadows",
      method={"default": "truth", "help": "What it is judged by; `refgi info` lists methods."},
      tolerance={"type": click.FloatRange(0, 10), "default": 0.01,
                 "help": "Largest RMSE above the noise, as a share of the mean."})
def _check(session: Session, asked: Asked) -> int:
    """Judge a port's PICTURE by a method on SCENE.

    PICTURE is an EXR of linear values.

    Channels irradiance.R, .G, .B are compared with indirect irradiance (W/m^2), else R, G, B with radiance. The scene
    is rendered at the size of the picture's display window; of a crop its own pixels are compared, overscan is cut.

    Exit codes: 0 within the tolerance or the noise, 1 not, or by a truth whose error is not to be trusted.
    """
    from refgi import stages
    from refgi.cli.view import on_threads, require_memory, scene_of, settings_for, warm_up
    from refgi.errors import expect
    from refgi.image.picture import read_colour
    from refgi.methods import render
    from refgi.truth.result import doubt_of_both
    from refgi.vectors.judge import judge_picture

    picture, method = asked.picture, asked.method
    found = read_colour(Path(picture), (INDIRECT, ""), asked.layer, asked.part)
    kind = "indirect irradiance" if INDIRECT in found.names[0] else "radiance"
    settings = settings_for(method, asked.pairs, asked.seed, asked.preset)
    size = found.size
    expect(asked.size in (None, size), "--size", f"{size[0]}x{size[1]} as the picture", asked.size)
    asked.scene, asked.size = asked.against, size
    scene = scene_of(asked)
    require_memory(scene, asked.dtype, asked.rsm_resolution, traced=method == "truth", settings={method: settings})
    with on_threads(asked.threads), progress() as tell, stages.observe(progress=tell):
        warm_up([method], asked.dtype, tell)
        made = render(scene, method, settings, dtype=asked.dtype, rsm_resolution=asked.rsm_resolution,
                      shadows=asked.shadows)
    variance = None if made.estimate is None else made.estimate.variance_of_mean
    if kind == "radiance" and variance is not None:
        variance = variance * (made.frame.gbuffer.albedo / math.pi) ** 2  # L = albedo / pi E
    pixels = (slice(None), found.rows, found.columns)
    right = made.radiance if kind == "radiance" else made.irradiance
    verdict = judge_picture(found.planes, right[pixels], None if variance is None else variance[pixels],
                            tolerance=asked.tolerance)
    lobes = made.lobe_estimate if kind == "radiance" else None
    doubt = "" if made.estimate is None else doubt_of_both(made.estimate, lobes)
    what = "is not" if not verdict.close else "is not known to be" if doubt else "is"
    lines = [f"{picture}: {kind} {what} that of {scene.name} by {method}", f"{verdict.said}{found.part_said}",
             *([f"{method}: {doubt}"] if doubt else []), *(f"likely: {one}" for one in verdict.causes)]
    session.result("\n".join(lines), {"picture": picture, "scene": scene.name, "method": method, "compared": kind,
                                      **verdict._asdict(), "trusted": not doubt})
    return DONE if verdict.close and not doubt else FAILED
