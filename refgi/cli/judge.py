"""The verbs that judge by path tracing.

`compare` methods on one scene, `check` a port's finished picture, `bench` run time against error over a grid, `choose`
the cheapest settings that meet a wish.
"""

import math
import os
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from refgi.cli.options import EXACT, MACHINE, SEEN, WRITING, Asked, verb
from refgi.cli.session import DONE, FAILED, Session, progress, say, table

if TYPE_CHECKING:
    from refgi.bench.choose import Chosen, Probe, Wish
    from refgi.compare import Comparison
    from refgi.scene import Scene

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
    from refgi.compare.report import file_names

    names, settings = _methods(asked)
    still = still_frames(names, asked.frames, asked.filtering, asked.preset)
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
    from refgi.compare.report import as_json
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
    session.result(_figures(comparison) + where, as_json(comparison) | {"out": out})


def _figures(comparison: "Comparison") -> str:
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


FILES = ("index.html", "results.json", "results.csv", "results.md")
QUICK_SIDE = 256  # pixels of a quick bench along the longer side at most


@verb("bench", "SCENES", "methods", "grid", "quick", "budget", "rounds", "size", "set", "split", "split-size",
      "split-frames", "threads", "out", *WRITING,
      SCENES={"nargs": -1}, methods="Methods of the grid to run; all where absent.",
      set="A setting of the truth, such as samples=1024 or checkpoint=DIR; repeatable.",
      size="Picture size in pixels; the scenes' own where absent.",
      out={"required": True, "help": "Folder for index.html, results.json, results.csv, results.md and pictures."})
def _bench(session: Session, asked: Asked) -> int:
    """Measure error over time on SCENES (cornell_box where absent).

    Methods run over a grid of settings beside the path tracer stopped early; errors are told apart into bias and
    spread over seeds. Results are written after each scene.
    """
    from refgi.bench.folder import write_results
    from refgi.bench.grid import TRUTH, built_in, chosen, read_grid
    from refgi.bench.measure import bench_scene
    from refgi.bench.pictures import FOLDER, places
    from refgi.bench.report import said_of, write_page
    from refgi.bench.results import Result, markdown
    from refgi.bench.split import with_splits
    from refgi.cli.destination import Permission, folder
    from refgi.cli.view import named_methods, on_threads, scene_of, settings_for, still_frames
    from refgi.errors import RefgiWarning, expect
    from refgi.provenance.record import environment

    out, rounds = asked.out, asked.rounds
    expect(not (asked.quick and asked.grid_file), "--grid", "--quick or --grid, not both", "both")
    expect(not (asked.split and asked.budget), "--budget", "no --split beside it", "both")
    for option, given in (("--split-size", asked.split_size), ("--split-frames", asked.split_frames)):
        expect(asked.split or given is None, option, "--split beside it", "none")
    grid = chosen(read_grid(Path(asked.grid_file)) if asked.grid_file else built_in(asked.quick),
                  named_methods(asked.methods))
    still = still_frames({one.method for one in grid.choices}, asked.split_frames, ())
    truth = settings_for(TRUTH, asked.pairs)
    sources = asked.scenes or ("cornell_box",)
    loaded = [scene_of(Asked(scene=source, size=asked.size)) for source in sources]
    if asked.quick and asked.size is None:
        loaded = [_smaller(scene) for scene in loaded]
    kept = (str(file.relative_to(out)) for file in Path(out, FOLDER).rglob("*.exr"))
    path = folder(out, Permission(asked.parents, asked.force), (*FILES, *kept))
    path.mkdir(parents=True, exist_ok=True)
    ends = time.perf_counter() + (asked.budget or math.inf)
    made: list[Any] = []
    with on_threads(asked.threads), progress() as tell, warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)  # of each of many settings in each round
        for number, (scene, place) in enumerate(zip(loaded, places(path, [one.name for one in loaded]), strict=True)):
            def told(what: str, done: float, number: int = number, name: str = scene.name) -> None:
                tell(f"{name} ({number + 1} of {len(loaded)}): {what}", done)

            one = bench_scene(scene, grid, rounds=rounds, truth=truth, tell=told, place=place,
                              source=sources[number], shadows="exact",
                              budget=(ends - time.perf_counter()) / (len(loaded) - number))
            if asked.split:
                options: dict[str, Any] = dict(zip(("width", "height"), asked.split_size or (), strict=False))
                one = with_splits(one, scene, grid, seeds=rounds, truth=truth, tell=told, still=still,
                                  shadows="exact", **options)
            made.append(one)
            result = Result(environment=environment(), scenes=tuple(made))
            write_results(result, path)
            write_page(result, path)
    lines = [f"{one.scene}: {said}" for one in made for said in said_of(one)]
    failures = [f"{one.scene}: {name} gave no picture: {why}" for one in made for name, why in one.failures.items()]
    left = [f"{one.scene}: left out for time: {said}" for one in made for said in one.left_out_said]
    for said in (*failures, *left, *(f"{one.scene}: {doubt}" for one in made for doubt in one.doubts)):
        say(said)
    session.result("\n".join([markdown(result), *lines, "", f"open {out.rstrip('/')}/index.html"]),
                   result.model_dump(mode="json"))
    return FAILED if failures else DONE


def _smaller(scene: "Scene") -> "Scene":
    width, height = scene.camera.width, scene.camera.height
    scale = min(1.0, QUICK_SIDE / max(width, height))
    return scene.with_camera(width=max(1, round(width * scale)), height=max(1, round(height * scale)))


@verb("choose", "SCENE", "error", "time", "methods", "size", "rounds", "set", "emit", "force", "threads",
      methods="Methods to look at, truth among them; all where absent.",
      rounds="How often each choice runs at full size, with a seed each.",
      set="A setting of the truth, such as target_error=0.005 or checkpoint=DIR; repeatable.",
      force="Overwrite the file of --emit.")
def _choose(session: Session, asked: Asked) -> int:
    """Find the cheapest method and settings that meet a wish on SCENE.

    A search on a small picture finds candidates; they are verified at full size. Errors are plain RMSE against path
    tracing over its mean, without the path tracer's own noise. The path tracer is among the candidates.
    """
    from refgi.bench.choose import Wish, choose
    from refgi.bench.grid import built_in_tracks
    from refgi.cli.view import named_methods, on_threads, scene_of
    from refgi.errors import expect
    from refgi.settings import from_text

    error, seconds, size, emit = asked.error, asked.seconds, asked.size, asked.emit
    expect((error is None) != (seconds is None), "--error, --time", "one of the two", "both" if error else "neither")
    wish = Wish(error, seconds)
    tracks = built_in_tracks(named_methods(asked.methods))
    truth = from_text(wish.truth, asked.pairs)
    expect(emit is None or asked.force or not Path(emit).exists(), "--emit", "a new file, or --force", emit)
    loaded = scene_of(asked)
    with on_threads(asked.threads), progress() as tell:
        chosen = choose(loaded, tracks, wish, rounds=asked.rounds, truth=truth, tell=tell, shadows="exact")
    best = chosen.found.best
    shown = f" --size {size[0]}x{size[1]}" if size else ""
    line = None if best is None else f"refgi render {asked.scene}{shown}{_options(best)} --out {best.choice.method}.exr"
    if best is not None and emit is not None:
        from refgi.image import write_text

        write_text(Path(emit), _plan(asked.scene, size, best, Path(emit).parent))
    session.result(_text(chosen, wish, line), _content(chosen, wish, line))
    return DONE if best is not None else FAILED


def _options(best: "Probe") -> str:
    return f" --method {best.choice.method}" + "".join(f" --set {change}" for change in best.choice.changes)


def _plan(scene: str, size: tuple[int, int] | None, best: "Probe", folder: Path) -> str:
    """Return the choice as a plan in a folder, with the scene it was found on; files are named from that folder."""
    from refgi.bench.grid import TRUTH, toml_line
    from refgi.scene import builtin_scenes

    choice = best.choice
    named = scene if scene.partition(":")[0] in builtin_scenes() else os.path.relpath(scene, folder)
    lines = ["[batch]", toml_line("scenes", [named]), *([toml_line("size", list(size))] if size else []), "",
             f"[{choice.method}]"]
    if choice.method == TRUTH:
        passes: int = choice.settings.passes  # type: ignore[attr-defined]
        return "\n".join([*lines, toml_line("passes", [passes])]) + "\n"
    return "\n".join([*lines, *(toml_line(*change.split("=", 1)) for change in choice.changes)]) + "\n"


def _content(chosen: "Chosen", wish: "Wish", line: str | None) -> dict[str, Any]:
    def plain(one: "Probe") -> dict[str, Any]:
        return {"method": one.choice.method, "changes": list(one.choice.changes), "seconds": _finite(one.seconds),
                "error": _finite(one.error)}

    found = chosen.found
    return {"wish": wish._asdict(), "best": None if found.best is None else plain(found.best), "line": line,
            "skips": [{"stage": name, "reason": reason} for name, reason in chosen.skips], "truth": chosen.truth,
            "trusted": not chosen.doubt,
            "judged": [plain(one) for one in found.judged], "small": [plain(one) for one in found.small]}


def _finite(value: float) -> float | None:
    return value if abs(value) < float("inf") else None


def _text(chosen: "Chosen", wish: "Wish", line: str | None) -> str:
    from refgi.compare.pages import number

    found = chosen.found
    asked = f"an error of {100 * wish.error:.3g} %" if wish.error else f"{number(1e3 * (wish.seconds or 0))} ms"
    parts = [f"nothing is known to meet {asked}: {chosen.doubt}" if chosen.doubt else f"nothing meets {asked}"]
    if found.best is not None:
        parts = [f"{found.best.choice.method}, {found.best.choice.label}: {100 * found.best.error:.3g} % in "
                 f"{number(1e3 * found.best.seconds)} ms, wished for {asked}"]
    parts += [_table("judged at full size", found.judged)] if found.judged else []
    parts += [_table("nearest on the small picture", sorted(found.small, key=lambda one: one.error)[:5])]
    parts += ["left out on this scene\n" + table([(name, reason) for name, reason in chosen.skips])] if chosen.skips \
        else []
    return "\n\n".join([*parts, f"truth: {chosen.truth}", *([line] if line else [])])


def _table(title: str, probes: Any) -> str:
    from refgi.compare.pages import number

    rows = [("method", "settings", "ms", "error, %")]
    rows += [(one.choice.method, one.choice.label, number(1e3 * one.seconds), f"{100 * one.error:.3g}")
             for one in probes]
    return f"{title}\n{table(rows, right=frozenset((2, 3)))}"
