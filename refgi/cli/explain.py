"""`refgi explain`: what a method does for a scene, what it leaves out and why, and what an animation reuses.

The method runs at a small size and is watched; nothing here knows what any method does.
"""

import dataclasses
import statistics
import time
import warnings
from typing import TYPE_CHECKING, Any

from refgi.cli.options import MACHINE, SEEN, Asked, verb
from refgi.cli.session import DONE, FAILED, Session, progress, table

if TYPE_CHECKING:
    from refgi.bench.skips import SkipReport
    from refgi.scene import Light, Scene
    from refgi.stages import Memory, Run

CLOCKS = {"wall": time.perf_counter, "processor": time.process_time}


def measured_text(report: "SkipReport | None") -> str:
    """Return the tables of a report after an empty line: skips, trades and what has no switch; nothing without one."""
    if report is None:
        return ""
    head = f"What {report.scene} does not need at {report.width} x {report.height}"
    if report.times:
        head += f": a frame takes {_ms(statistics.median(report.times))} ms, median of {len(report.times)}"
    parts = [f"{head}\n\n{_skips(report)}", _lights(report), _trades(report), _unmeasured(report)]
    return "".join(f"\n\n{part}" for part in parts if part)


def _skips(report: "SkipReport") -> str:
    if not report.skips:
        return "No skip has anything to leave out here."
    rows = [("skip", "leaves out", "", "ms with", "without", "saves", "least", "most", "same bits", "")]
    for skip in report.skips:
        rows.append((skip.name, f"{skip.left_out:,} of {skip.of:,}", skip.unit, _ms(statistics.median(skip.times)),
                     _ms(statistics.median(skip.times_without)), _ms(skip.saves), _ms(min(skip.saved)),
                     _ms(max(skip.saved)), "yes" if skip.same_bits else "NO", skip.meaning))
    wrong = [f"{skip.name} changes bits of the picture: it leaves out more than {skip.meaning}"
             for skip in report.skips if not skip.same_bits]
    return "\n".join([table(rows, right=frozenset({1, 3, 4, 5, 6, 7})), *wrong])


def _lights(report: "SkipReport") -> str:
    lights = report.dim_lights
    if lights is None:
        return ""
    return (f"{lights.carrying:,} of {lights.lights:,} pixel lights carry {lights.share:.1%} of the light without "
            f"visibility. The sum over all takes {_ms(statistics.median(lights.times))} ms,\nover those alone "
            f"{_ms(statistics.median(lights.times_carrying))} ms, with an error of {lights.error:.2%} of the mean.")


def _trades(report: "SkipReport") -> str:
    if not report.trades:
        return ""
    rows = [("At the cost of a difference", "ms now", "then", "RMSE", "type")]
    rows += [(trade.meaning, _ms(statistics.median(trade.times)), _ms(statistics.median(trade.times_changed)),
              "-" if trade.difference is None else f"{trade.difference:.2%}",
              " ".join(f"--set {change}" for change in trade.changes)) for trade in report.trades]
    return table(rows, right=frozenset({1, 2, 3}))


def _unmeasured(report: "SkipReport") -> str:
    if not report.unmeasured:
        return ""
    rows = [("Skipped without a switch, so not measured", "why"), *((one.meaning, one.reason) for one in
                                                                    report.unmeasured)]
    return table(rows)


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g}" if abs(seconds) < 1 else f"{1e3 * seconds:.0f}"


SMALL = 48  # pixels along the longer side
STEP = 0.01  # of the scene's diagonal: how far camera and lights move from one frame to the next
ROWS = {  # SII Table 1
    "light and camera still": (False, False), "camera moves": (False, True), "light moves": (True, False),
    "light and camera move": (True, True),
}


@verb("explain", "SCENE", *SEEN, "method", "preset", "set", *MACHINE, "shadows", "measure", "rounds", "clock",
      rounds="How often each skip is timed by --measure.")
def _explain(session: Session, asked: Asked) -> int:
    """Show what a method runs, skips and reuses, and where light goes.

    The method runs at a small size. The four rows are those of SII Table 1: light and camera still or moving. With
    --measure each skip is switched off at the picture's own size; the exit code is 1 where that changes a bit.
    """
    from refgi import stages
    from refgi.bench.skips import measure_skips
    from refgi.cli.view import on_threads, require_memory, scene_of, settings_for, warm_up
    from refgi.compare.report import ledger_json
    from refgi.errors import RefgiWarning

    method = asked.method
    settings = settings_for(method, asked.pairs, asked.seed, asked.preset)
    with stages.observe() as loading:
        whole = scene_of(asked)
    scene = _small(whole)
    require_memory(whole if asked.measure else scene, asked.dtype, asked.rsm_resolution, traced=method == "truth",
                   settings={method: settings})
    frame_options = {key: getattr(asked, key) for key in ("dtype", "rsm_resolution", "shadows")}
    with on_threads(asked.threads), progress() as tell:
        warm_up([method], asked.dtype, tell)
        first = [dataclasses.replace(run, depth=0) for run in loading.runs if run.status == "skipped"]
        first += _watch(scene, method, settings, frame_options, None)
        tell(method, 0.2)
        animation = {}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RefgiWarning)  # of views and lights that nobody asked for
            for row, (light, camera) in ROWS.items():
                animation[row] = _second_frame(scene, method, settings, frame_options, light, camera)
                tell(method, 0.2 + 0.2 * len(animation))
        ledger = _ledger(scene, method, settings, frame_options)
        report = None if not asked.measure else measure_skips(
            whole, method, settings, rounds=asked.rounds, clock=CLOCKS[asked.clock], tell=tell, **frame_options)
    content = {"scene": scene.name, "method": method, "settings": settings,
               "stages": summed(first),
               "animation": {row: {line["name"]: _what(line) for line in summed(runs)}
                             for row, runs in animation.items()},
               "ledger": None if ledger is None else ledger_json(ledger)}
    if report is not None:
        content["measured"] = report.model_dump(mode="json")
    session.result(_text(content) + _ledger_text(ledger) + measured_text(report), content)
    return DONE if report is None or report.same_bits else FAILED


def summed(runs: "list[Run]") -> list[dict[str, Any]]:
    """Add up the calls of each stage, in the order of first appearance."""
    lines: dict[str, dict[str, Any]] = {}
    for run in runs:
        line = lines.setdefault(run.name, {"name": run.name, "depth": run.depth, "ran": 0, "reused": 0, "skipped": 0,
                                           "reason": ""})
        line[run.status] += 1
        if run.status == "skipped":
            line["reason"] = run.reason
    return list(lines.values())


def _what(line: dict[str, Any]) -> str:
    """Return what became of all calls of a stage, in a word or two."""
    counts = {"runs": line["ran"], "reused": line["reused"], "skipped": line["skipped"]}
    return ", ".join(f"{word} x{n}" if n > 1 else word for word, n in counts.items() if n)


def _small(scene: "Scene") -> "Scene":
    width, height = scene.camera.width, scene.camera.height
    factor = min(1.0, SMALL / max(width, height))
    return scene.with_camera(width=max(1, round(width * factor)), height=max(1, round(height * factor)))


def _watch(scene: "Scene", method: str, settings: Any, options: dict[str, Any], memory: "Memory | None") -> "list[Run]":
    from refgi import stages
    from refgi.methods import render

    with stages.observe(memory=memory) as log:
        render(scene, method, settings, **options)
    return log.runs


def _second_frame(scene: "Scene", method: str, settings: Any, options: dict[str, Any], light: bool,
                  camera: bool) -> "list[Run]":
    from refgi.frame import Frame
    from refgi.stages import Memory

    memory, step = Memory(), STEP * Frame(scene, **options).visible_extent.diagonal
    _watch(scene, method, settings, options, memory)
    if light:
        scene = scene.with_lights(*(_moved(one, step) for one in scene.lights))
    if camera:
        x, y, z = scene.camera.eye
        scene = scene.with_camera(eye=(x + step, y, z))
    return _watch(scene, method, settings, options, memory)


def _moved(light: "Light", step: float) -> "Light":
    from refgi.scene import DirectionalLight

    if isinstance(light, DirectionalLight):
        x, y, z = light.direction
        return dataclasses.replace(light, direction=(x + STEP, y, z + STEP))
    x, y, z = light.position
    return dataclasses.replace(light, position=(x + step, y, z))


def _ledger(scene: "Scene", method: str, settings: Any, options: dict[str, Any]) -> Any:
    """Return the method's account of the lights' power, or None where it keeps none."""
    from refgi.frame import Frame
    from refgi.methods import find_method

    account = find_method(method).ledger
    return account(Frame(scene, **options), settings) if account else None


def _ledger_text(ledger: Any) -> str:
    from refgi.compare.report import ledger_cells

    if ledger is None:
        return ""
    parts = [row.is_part for row in ledger.rows]
    rows = [("  " * is_part + name, *cells)
            for (name, *cells), is_part in zip(ledger_cells(ledger), [*parts, False], strict=True)]
    head = ("", "R, W", "G, W", "B, W", "of emitted", "")
    text = table([head, *rows], right=frozenset(range(1, 5)))
    return f"\n\nWhere the power of the lights goes (indented lines sum to the first)\n\n{text}"


def _text(content: dict[str, Any]) -> str:
    from refgi.provenance import plain

    settings = ", ".join(f"{key}={value}" for key, value in plain(content["settings"]).items())
    head = f"{content['method']} on {content['scene']}\n{settings}"
    lines = [("stage", "", "why")]
    lines += [("  " * line["depth"] + line["name"], _what(line), line["reason"]) for line in content["stages"]]
    names = list(dict.fromkeys(name for row in content["animation"].values() for name in row))
    rows = [("next frame", *content["animation"])]
    rows += [(name, *(row.get(name, "-") for row in content["animation"].values())) for name in names]
    return f"{head}\n\n{table(lines)}\n\nWhat the next frame of an animation costs (SII Table 1)\n\n{table(rows)}"
