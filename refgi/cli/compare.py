"""`refgi compare`: every method on one scene against the truth."""

from typing import TYPE_CHECKING, Any

import click

from refgi.cli.options import machine, shadows, speech, still, view, writing
from refgi.cli.session import FAILED, Session, say, table
from refgi.cli.settings import preset

if TYPE_CHECKING:
    from refgi.compare import Comparison

SHOWN = {"relmse": "relMSE", "rmse": "RMSE", "bias": "bias", "psnr": "PSNR", "ssim": "SSIM"}


@click.command("compare")
@view
@click.option("--methods", metavar="A,B", help="Methods to compare; all where absent.")
@preset
@click.option("--set", "pairs", multiple=True, metavar="METHOD.KEY=VALUE",
              help="A setting of a method or of truth, such as truth.samples=64; repeatable.")
@still
@machine
@shadows("exact")
@click.option("--out", help="Folder for EXR, PNG, error maps, results.json and index.html.")
@writing
@speech
@click.pass_obj
def _compare(session: Session, /, methods: str | None, preset: str, pairs: tuple[str, ...], dtype: str,
            rsm_resolution: int, shadows: str, threads: int | None, seed: int | None, out: str | None, parents: bool,
            force: bool, frames: int | None, filtering: tuple[str, ...], **options: Any) -> int:
    """Judge methods on SCENE by path tracing: errors, times, a page.

    Writes pictures, error maps, results.json and index.html to --out.

    With --frames, a method with a temporal filter shows its picture after so many frames; its time is that of one.

    A method that knows no visibility is also compared with the truth without visibility, to which it converges.
    """
    from refgi.cli.destination import Permission, folder
    from refgi.cli.options import on_threads
    from refgi.cli.session import progress
    from refgi.cli.settings import still_frames
    from refgi.cli.view import View, require_memory
    from refgi.cli.warm import warm_up
    from refgi.compare import compare
    from refgi.compare.results import file_names

    names, settings = _asked(methods, preset, pairs, seed)
    blended = still_frames(names, frames, filtering)
    scene = View(**options).load()
    if out is not None:
        folder(out, Permission(parents, force), file_names(names))
    require_memory(scene, dtype, rsm_resolution, traced=True, compared=len(names) + 2, settings=settings)
    with on_threads(threads), progress() as tell:
        warm_up([*names, "truth"], dtype, tell)
        comparison = compare(scene, names, truth_settings=settings.pop("truth"), method_settings=settings, out=out,
                             still=blended,
                             progress=tell, dtype=dtype, rsm_resolution=rsm_resolution, shadows=shadows)
    _report(session, comparison, out)
    return 0 if comparison.is_sound else FAILED


command = _compare


def _asked(
    methods: str | None, preset: str, pairs: tuple[str, ...], seed: int | None
) -> tuple[list[str], dict[str, Any]]:
    from refgi.cli.settings import by_method, has_seed, settings_for
    from refgi.errors import InputError
    from refgi.method import DEFAULT
    from refgi.methods import METHODS, find_method

    names = [name.strip() for name in methods.split(",")] if methods is not None else list(METHODS)
    names = [name for name in names if find_method(name).name != "truth"]
    if not names:
        raise InputError("--methods: expected a method besides truth, got none")
    texts = by_method(pairs, [*names, "truth"])
    having = [name for name in names if preset == DEFAULT or preset in METHODS[name].presets]
    if not having:
        raise InputError(f"--preset: expected one that a method compared here has, got {preset!r}", key="preset")
    settings = {}
    for name, own in texts.items():
        start = preset if name in having else DEFAULT
        settings[name] = settings_for(name, own, seed if has_seed(name) else None, start)
    return names, settings


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
    from refgi.compare.report import JUDGES, number

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
