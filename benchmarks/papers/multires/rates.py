"""Frame rates: by normal threshold (Figure 10), by number of lights (Figure 14), by scene (Table 2)."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from benchmarks.harness import interleaved, moved
from benchmarks.papers.multires.subjects import (
    LARGE,
    count_of,
    drawing,
    every_texel,
    frame_of,
    full_sum,
    levels_of,
    scene_of,
    settings_of,
    unclamped,
    without_indirect,
)
from benchmarks.papers.records import Bar, Figure, Picture, Plot, Ratios, Table
from benchmarks.papers.workbench import Gallery, Workbench, errors_of, seen_by
from refgi.compare.pages import Axes, Curve, curves_plot
from refgi.scene import Scene
from refgi.settings import replaced
from refgi.splat.multires import MultiresSettings, multires

STEP, MOVES = 0.01, 5  # m that the light moves between two frames; how often


def by_threshold(bench: Workbench, scene: str, thresholds: tuple[float, ...], resolutions: tuple[int, ...],
                 flat: int) -> Figure:
    """Figure 10: frame rate over the normal threshold, by indirect resolution; to `flat` the paper sees no effect."""
    frame, base = frame_of(bench, scene, LARGE), settings_of(bench, scene)
    covered, full = frame.gbuffer.covered, full_sum(frame, base)
    settings = {(side, t): replaced(base, {"finest": level, "normal_threshold": t})
                for side, level in levels_of(frame, resolutions).items() for t in thresholds}
    work: dict[Any, Any] = {key: partial(multires, frame, one) for key, one in settings.items()}
    seconds = interleaved(work | {"rest": without_indirect(bench, scene_of(bench, scene))}, bench.scale.repeats)
    rest = seconds["rest"]
    counts = {key: count_of(frame, one) for key, one in settings.items()}
    rmse = {key: errors_of(multires(frame, one), full, covered).rmse for key, one in settings.items()}
    sides = sorted({side for side, _ in settings})
    fine, bare_full = sides[-1], full_sum(frame, unclamped(base))
    bare = [errors_of(multires(frame, unclamped(settings[fine, t])), bare_full, covered).rmse for t in thresholds]

    def plot(axes: Axes, caption: str, value: Callable[[Any], float]) -> Plot:
        curves = [Curve(f"{side}²", thresholds, [value((side, t)) for t in thresholds]) for side in sides]
        return Plot(curves_plot(curves, axes), caption)

    def gain(side: int, rest: float = 0.0) -> float:
        return (rest + seconds[side, thresholds[0]]) / (rest + seconds[side, thresholds[-1]])

    columns = ("", *(f"{t:g}" for t in thresholds))
    coarse = ", ".join(f"{gain(n, rest):.2f} at {n}²" for n in sides if n <= flat)
    return Figure(
        facts=(scene, f"{2 * bench.scale.size}² pixels", "256 lights",
               f"all but the indirect part takes {1e3 * rest:.0f} ms"),
        tables=(Table("Subsplats, by indirect resolution and normal threshold", columns,
                      [(f"{side}²", *(counts[side, t] for t in thresholds)) for side in sides]),
                Table(f"RMSE against the same lights at every pixel, in % of the mean, at {fine}²", columns,
                      (("clamped", *(rmse[fine, t] for t in thresholds)), ("without clamp", *bare)))),
        plots=(plot(Axes("normal threshold", "frames per second"), "Frames per second, by indirect resolution.",
                    lambda key: 1 / (rest + seconds[key])),
               plot(Axes("normal threshold", "times per second", log_y=True),
                    "How often the indirect part alone could be drawn in a second.", lambda key: 1 / seconds[key]),
               plot(Axes("normal threshold", "RMSE, % of the mean"),
                    "Error against the same lights at every pixel: what the frame rate is paid with.",
                    rmse.__getitem__)),
        notes=(
            f"From threshold 0 to 2 the frame rate rises by a factor of {coarse} and of {gain(fine, rest):.2f} at "
            f"{fine}². The paper's is flat up to {flat}², where there is hardly a subsplat to save. At {fine}² their "
            f"number falls by a factor of {counts[fine, 0.0] / counts[fine, 2.0]:.1f}, and the indirect part alone "
            f"becomes {gain(fine):.1f} times as fast; shadow map, buffers and direct light stay.",
            f"What the paper's figure leaves out is the error: at {fine}² it rises from {rmse[fine, 0.25]:.2f} % of "
            f"the mean with a threshold of 0.25 to {rmse[fine, 1.4]:.2f} % with 1.4. A threshold of 0 still leaves "
            f"{rmse[fine, 0.0]:.2f} % where surfaces are plane."))


def by_lights(bench: Workbench, scene: str, counts: tuple[int, ...], resolutions: tuple[int, ...]) -> Figure:
    """Figure 14 and Section 5.1: frame rate over the number of lights (n x n), and flicker when they move."""
    frame, base = frame_of(bench, scene, LARGE), settings_of(bench, scene)
    settings = {(side, n): replaced(base, {"lights": n * n, "finest": level})
                for side, level in levels_of(frame, resolutions).items() for n in counts}
    work: dict[Any, Any] = {key: partial(multires, frame, one) for key, one in settings.items()}
    seconds = interleaved(work | {"rest": without_indirect(bench, scene_of(bench, scene))}, bench.scale.repeats)
    sides = sorted({side for side, _ in settings})
    subsplats = {side: count_of(frame, settings[side, counts[0]]) for side in sides}
    lights = [n * n for n in counts]
    curves = [Curve(f"{side}²", lights, [1 / (seconds["rest"] + seconds[side, n]) for n in counts]) for side in sides]
    flicker = _flicker(bench, scene_of(bench, scene), [replaced(base, {"lights": n}) for n in lights])
    pairs = [float(subsplats[side] * n) for side in sides for n in lights]
    taken = [1e3 * seconds[side, n] for side in sides for n in counts]
    slope, fixed = np.polyfit(pairs, taken, 1)
    at = dict(zip(counts, flicker, strict=True))
    logs = np.log([(n * n, value) for n, value in at.items() if value > 0])
    order = float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0]) if len(logs) > 1 else 0.0
    return Figure(
        facts=(scene, f"{2 * bench.scale.size}² pixels",
               f"all but the indirect part takes {1e3 * seconds['rest']:.0f} ms"),
        tables=(Table("Milliseconds of the indirect part, by indirect resolution and number of lights",
                      ("", "subsplats", *(f"{n}²" for n in counts)),
                      [(f"{side}²", subsplats[side], *(1e3 * seconds[side, n] for n in counts)) for side in sides]),
                Table("Flicker when the light moves by 1 cm a frame: change from frame to frame that the sum over "
                      "every texel does not show, mean magnitude in % of the mean",
                      ("", *(f"{n}²" for n in counts)), [("lights", *flicker)])),
        plots=(Plot(curves_plot(curves, Axes("lights", "frames per second", log_x=True)),
                    "Frames per second, by indirect resolution."),
               Plot(curves_plot([Curve("flicker", lights, flicker)], Axes("lights", "flicker, %", log_x=True,
                                                                          log_y=True)),
                    "Flicker over the number of lights.")),
        notes=(
            f"The time of the indirect part follows the number of pairs of subsplat and light: {fixed:.1f} ms and "
            f"{1e6 * slope:.2f} ms for each million pairs, with a correlation of "
            f"{float(np.corrcoef(pairs, taken)[0, 1]):.3f} over all {len(pairs)} runs. Curves are flat while the rest "
            "of a frame leads, and fall as one over the number of lights where pairs do.",
            f"Flicker falls with the number of lights N as N to the {order:.2f}: {at[16]:.1f} % of the mean at 16² "
            f"lights, {at[32]:.1f} % at 32², {at[64]:.1f} % at 64². The paper's judgement that 16² to 32² show little "
            "of it was by eye, with clamped lights as here."))


def _flicker(bench: Workbench, scene: Scene, settings: list[MultiresSettings]) -> list[float]:
    """Return how much more a picture changes from frame to frame than light does, for each number of lights.

    The change of the picture less that of the sum over every texel, mean magnitude in % of the mean irradiance.
    """
    side = bench.scale.size // 2
    frames = [seen_by(bench, moved(scene, STEP * k, camera=False), width=side, height=side) for k in range(MOVES + 1)]
    smooth = [every_texel(frame, settings[0]) for frame in frames]
    mean = float(np.mean([s[:, f.gbuffer.covered].mean() for s, f in zip(smooth, frames, strict=True)]))
    found = []
    for one in settings:
        excess = [multires(frame, one) - right for frame, right in zip(frames, smooth, strict=True)]
        jumps = np.diff(np.stack(excess), axis=0)[..., frames[0].gbuffer.covered]
        found.append(100 * float(np.abs(jumps).mean(dtype=np.float64)) / mean)
    return found


def by_scene(bench: Workbench, titles: dict[str, str], parts: tuple[int, ...],
             fps: dict[int, tuple[int, ...]]) -> Figure:
    """Table 2: frame rates of several scenes at parts of the picture's side; in the paper by cells along a side."""
    frames, side = {name: frame_of(bench, name, LARGE) for name in titles}, LARGE * bench.scale.size
    settings = {(name, side // n): settings_of(bench, name, finest=level)
                for name, frame in frames.items()
                for n, level in levels_of(frame, tuple(side // part for part in parts)).items()}
    seconds = interleaved({key: drawing(bench, scene_of(bench, key[0]), one) for key, one in settings.items()},
                          bench.scale.repeats)
    counts = {(name, part): count_of(frames[name], one) for (name, part), one in settings.items()}
    off = {key: _errors_with_and_without_clamp(bench, key[0], one) for key, one in settings.items()}
    parts = tuple(part for part in parts if any(key[1] == part for key in settings))
    finest = max(fps)  # where the paper's picture has as many pixels
    paper = {(name, part): float(rate) for part in parts if finest // part in fps
             for name, rate in zip(titles, fps[finest // part], strict=True)}
    shown: list[Picture] = []
    for name, title in titles.items():
        gallery, usual = Gallery(frame_of(bench, name), shown=shown), settings_of(bench, name)
        gallery.camera(name, title, f"{scene_of(bench, name).face_count} faces stand in",
                       multires(gallery.frame, usual), usual)
    faces = {name: scene_of(bench, name).face_count for name in titles}
    first, fine = parts[0], parts[-1]
    spread = {part: max(seconds[name, part] for name in titles) / min(seconds[name, part] for name in titles)
              for part in (first, fine)}
    rates, lit = [1 / seconds[name, fine] for name in titles], [counts[name, fine] for name in titles]
    order = [(name, part) for name in titles for part in parts]
    fit = float(np.corrcoef([counts[key] for key in order], [1e3 * seconds[key] for key in order])[0, 1])
    return Figure(
        facts=(f"{side}² pixels", "256 lights", "whole frames", "stand-ins of the paper's face counts"),
        pictures=shown,
        ratios=[Ratios("frames per second, relative to an eighth of the picture's side", [
            Bar(f"{titles[name]}, 1/{part}" if part > 1 else f"{titles[name]}, full",
                seconds[name, first] / seconds[name, part],
                paper[name, part] / paper[name, first] if (name, part) in paper and (name, first) in paper else None)
            for name, part in order])],
        tables=(Table("Frames per second",
                      ("indirect resolution", *titles.values(), *(f"{title}, paper" for title in titles.values())),
                      [(f"{side // part}²", *(1 / seconds[name, part] for name in titles),
                        *(paper.get((name, part)) for name in titles)) for part in parts]),
                Table("What each takes; errors against the same lights at every pixel, in % of the mean irradiance",
                      ("", "subsplats", "ms", "RMSE", "RMSE, no clamp"),
                      [(f"{titles[name]}, {faces[name]} faces, {side // part}²", counts[name, part],
                        1e3 * seconds[name, part], *off[name, part]) for name, part in order])),
        notes=(
            f"At the finest resolution frames of {min(faces.values())} to {max(faces.values())} triangles differ in "
            f"time by a factor of {spread[fine]:.2f}, at the coarsest by {spread[first]:.2f} (paper: "
            f"{max(fps[finest]) / min(fps[finest]):.2f} and {max(fps[min(fps)]) / min(fps[min(fps)]):.2f}). Triangles "
            "cost time to rasterize on this machine's cores, whatever is lit; subsplats, "
            f"{min(lit)} to {max(lit)} of them, cost the rest.",
            f"Frames per second here are {min(rates):.0f} to {max(rates):.0f} at {side}², the paper's "
            f"{min(fps[finest])} to {max(fps[finest])} at {finest}² on a graphics processor of 2008.",
            f"Over all {len(order)} entries time and number of subsplats have a correlation of {fit:.2f}: where it is "
            "low, what does not depend on subsplats leads."))


def _errors_with_and_without_clamp(bench: Workbench, name: str, settings: MultiresSettings) -> list[float]:
    frame, off = frame_of(bench, name, LARGE), []
    for one in (settings, unclamped(settings)):
        full = bench.once(("full sum", name, one.pairs.clamp), partial(full_sum, frame, one))
        off.append(errors_of(multires(frame, one), full, frame.gbuffer.covered).rmse)
    return off
