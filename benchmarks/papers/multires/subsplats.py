"""What subsplats are: their refinement pass by pass, how they become a picture, lists of each light's own."""

import time
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple, get_args

import numpy as np

from benchmarks.harness import interleaved
from benchmarks.papers.multires.subjects import (
    LARGE,
    count_of,
    frame_of,
    full_sum,
    levels_of,
    scene_of,
    settings_of,
    share_of_pixels,
    subsplats_of,
    unclamped,
)
from benchmarks.papers.records import Cell, Figure, Picture, Table
from benchmarks.papers.workbench import Errors, Gallery, Workbench, errors_of
from refgi.compare.pictures import Scale
from refgi.error_target.grid import Subsplats, level_picture
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.settings import replaced
from refgi.splat.multires import ByGeometry, ByIrradiance, Criteria, MultiresSettings, multires
from refgi.splat.multires.evaluate import evaluate, representative_points
from refgi.splat.multires.per_light import per_light_counts
from refgi.splat.multires.settings import Criterion, Upsampling
from refgi.splat.multires.upsample import upsample
from refgi.types import Array

PICTURE_LIGHTS = 256  # of Table 1's pictures
THRESHOLDS = (0.02, 0.05, 0.1, 0.2)  # T of Table 1


def passes(bench: Workbench, scene: str) -> Figure:
    """Figure 5: the subsplats that each refinement pass leaves as they are, and all of them together."""
    frame, settings = frame_of(bench, scene), settings_of(bench, scene)
    gallery, subsplats = Gallery(frame, full_sum(frame, settings)), subsplats_of(frame, settings)
    geometry = settings.subsplats
    assert isinstance(geometry, ByGeometry)
    points = representative_points(frame.gbuffer, subsplats, geometry.representative)
    values = evaluate(*points, choose_lights(frame, settings.lights), settings.effective_pairs)
    blocks = np.asarray(upsample(values, subsplats, gallery.covered, "nearest"))
    for level in range(subsplats.top, -1, -1):
        _add_level(gallery, subsplats, level, blocks)
    gallery.mapped("levels", "all levels", "dark: coarse; light: single pixels", level_picture(subsplats),
                   Scale(0.0, 1.0, "viridis", "level"))
    gallery.indirect("blocks", "their sum", "one value a subsplat", blocks)
    gallery.indirect("upsampled", "interpolated", "what the method shows", multires(frame, settings), settings)
    rows, share = _passes(subsplats), share_of_pixels(subsplats, gallery.covered)
    growth = [row[3] for row in rows if isinstance(row[3], float)]
    said = f"{min(growth):.2f} to {max(growth):.2f}" if growth else "no"
    return Figure(
        facts=(scene, f"{settings.lights.count} lights", f"depth threshold {_threshold(geometry.criteria.depth)}",
               f"normal threshold {_threshold(geometry.criteria.normal)}", f"{len(subsplats.pixel)} subsplats",
               f"{share:.1%} of the pixels"),
        pictures=gallery.pictures,
        tables=[Table("Subsplats a pass", ("resolution", "in the list", "of the whole grid", "times as many as before",
                                           "left as they are", "split further"), rows)],
        notes=(
            f"Each pass multiplies the list by {said}, towards the 2 of discontinuities that are lines (paper: 1.83 to "
            f"2.02 in Table 1; refining everything gives 4). In the end {share:.1%} of the pixels with a surface are "
            "lit.",
            "As in the paper outlines and creases are refined to single pixels, walls and floor hardly at all; the "
            "lines across the picture are where these meet."))


def _threshold(criterion: Criterion | None) -> str:
    return "none" if criterion is None else f"{criterion.threshold:g}"


def _add_level(gallery: Gallery, subsplats: Subsplats, level: int, blocks: Array) -> None:
    """Show the irradiance of one level's subsplats, black elsewhere."""
    count, side = int(subsplats.counts[level]), 1 << level
    height, width = subsplats.shape
    here = subsplats.leaf[level].repeat(side, axis=0).repeat(side, axis=1)[:height, :width]
    grey = np.where(here, blocks.mean(axis=0), 0)
    said = "single pixels" if side == 1 else f"{side} by {side} pixels each"
    gallery.indirect(f"level{level}", f"{count} subsplats", said, np.repeat(grey[None], 3, axis=0))


def _passes(subsplats: Subsplats) -> list[tuple[Cell, ...]]:
    """Return one row a resolution: what the published list holds when it has come to it."""
    counts, before = subsplats.counts, None
    rows: list[tuple[Cell, ...]] = []
    for level in range(subsplats.top, -1, -1):
        left = int(counts[level])
        here = _filled(subsplats, level)
        listed = int(counts[level + 1:].sum()) + here
        cells = subsplats.leaf[level].size
        rows.append((f"{max(subsplats.leaf[level].shape)}²", listed, listed / cells,
                     None if before is None else listed / before, left, here - left))
        before = listed
    return rows


def _filled(subsplats: Subsplats, level: int) -> int:
    """Return how many subsplats a level holds before those that are too coarse are split."""
    below = subsplats.level <= level
    shift = level - subsplats.level[below].astype(np.int64)
    rows, columns = (axis[below].astype(np.int64) >> shift for axis in (subsplats.row, subsplats.column))
    return len(np.unique(rows * subsplats.leaf[level].shape[1] + columns))


def upsampling(bench: Workbench, scene: str, ways: dict[str, str]) -> Figure:
    """Figure 7: a picture from subsplats by nearest neighbour and by naive bilinear interpolation, against the tent."""
    frame, base = frame_of(bench, scene), settings_of(bench, scene)
    settings = {way: replaced(base, {"upsampling": way}) for way in get_args(Upsampling)}
    settings["filter_all"] = replaced(base, {"as_published": "ams_filter_all"})
    full, bare = full_sum(frame, settings["tent"]), full_sum(frame, unclamped(settings["tent"]))
    gallery, seconds = Gallery(frame, full), _upsampling_seconds(bench, scene)
    made = {way: multires(frame, one) for way, one in settings.items()}
    off = {way: errors_of(light, full, gallery.covered) for way, light in made.items()}
    rows = []
    for way, title in ways.items():
        gallery.indirect(way, title, f"RMSE {off[way].rmse:.1f} % of the mean", made[way], settings[way])
        without = errors_of(multires(frame, unclamped(settings[way])), bare, gallery.covered)
        rows.append((title, 1e3 * seconds[way], *off[way], without.rmse, without.mae))
    gallery.errors({way: (title, made[way]) for way, title in ways.items()}, full)
    best = min(off, key=lambda way: off[way].rmse)
    return Figure(
        facts=(scene, f"{settings['tent'].lights.count} lights", "errors against the same lights at every pixel"),
        pictures=gallery.pictures,
        tables=[Table("Time at twice the size, and errors in % of the mean irradiance", (
            "upsampling", "ms", "RMSE", "MAE", "energy lost", "RMSE, no clamp", "MAE, no clamp"), rows)],
        notes=(
            f"Against the same lights at every pixel nearest neighbour has an RMSE of {off['nearest'].rmse:.1f} % of "
            f"the mean, naive bilinear interpolation {off['naive_bilinear'].rmse:.1f} %, the tent "
            f"{off['tent'].rmse:.1f} %; least has {ways[best]} with {off[best].rmse:.1f} %. Naive interpolation of a "
            "level spreads its light over cells of other levels and takes darkness from them: the halos and rings of "
            "the paper.",
            "Taken literally the published rule filters texels that were lit at that very resolution too, so even "
            f"single pixels blur; keeping them brings the RMSE from {off['filter_all'].rmse:.1f} to "
            f"{off['tent'].rmse:.1f} %."))


def upsampling_passes(bench: Workbench, scene: str, sides: tuple[int, ...]) -> Figure:
    """Figure 8: what each pass of upsampling takes in, one value a subsplat, and gives to the next one."""
    frame, base = frame_of(bench, scene), settings_of(bench, scene)
    full = full_sum(frame, base)
    gallery, rows = Gallery(frame, full), list[tuple[Cell, ...]]()
    for side, level in levels_of(frame, sides).items():
        settings = replaced(base, {"finest": level})
        blocks, smooth = (multires(frame, replaced(settings, {"upsampling": way})) for way in ("nearest", "tent"))
        off = [errors_of(light, full, gallery.covered).rmse for light in (blocks, smooth)]
        rows.append((f"{side}²", count_of(frame, settings), *off))
        gallery.indirect(f"blocks{side}", f"up to {side}², not interpolated", f"RMSE {off[0]:.1f} %", blocks)
        gallery.indirect(f"smooth{side}", f"up to {side}², interpolated", f"RMSE {off[1]:.1f} %", smooth, settings)
    return Figure(
        facts=(scene, f"{frame.width}² pixels", f"{base.lights.count} lights"), pictures=gallery.pictures,
        tables=[Table("Subsplats as far as each pass, and RMSE against the same lights at every pixel, % of the mean",
                      ("resolution", "subsplats", "not interpolated", "interpolated"), rows)],
        notes=("Pass by pass the interpolated picture takes in the next level's subsplats and leaves those as they "
               f"are: its RMSE goes from {rows[0][3]:.1f} to {rows[-1][3]:.1f} %, that of blocks from {rows[0][2]:.1f} "
               f"to {rows[-1][2]:.1f} %.",))


def _upsampling_seconds(bench: Workbench, scene: str) -> dict[str, float]:
    frame, settings = frame_of(bench, scene, LARGE), settings_of(bench, scene)
    subsplats, covered = subsplats_of(frame, settings), frame.gbuffer.covered
    points = representative_points(frame.gbuffer, subsplats)
    values = evaluate(*points, choose_lights(frame, settings.lights), settings.effective_pairs)
    work: dict[str, Any] = {way: partial(upsample, values, subsplats, covered, way) for way in get_args(Upsampling)}
    work["filter_all"] = partial(upsample, values, subsplats, covered, "tent", filter_all=True)
    return interleaved(work, bench.scale.repeats)


class Entry(NamedTuple):
    """One cell of Table 1."""

    subsplats: int
    lights: int  # those that shine: texels without light are dropped
    seconds: float


def of_each_light(bench: Workbench, scene: str, threshold: float, printed: dict[int, tuple[float | None, ...]],
                  sides: tuple[int, ...]) -> Figure:
    """Table 1 and Figure 6: subsplats that each light of a glossy body refines for itself, by its own light.

    The paper's thousands of subsplats are by indirect resolution, and by lights along a side of the map (None: "N/A").
    """
    found = _counted(bench, scene, threshold, tuple(printed), sides)
    pictures, off = _pictures(bench, scene, threshold)
    shown = [n for n in sides if any(key[1] == n for key in found)]
    resolutions = sorted({key[0] for key in found})
    rows = [(f"{side}²", *(found[side, n].subsplats / 1e3 for n in shown),
             *(1e3 * found[side, n].seconds for n in shown),
             *("N/A" if cell is None else cell for n, cell in zip(sides, printed[side], strict=True) if n in shown))
            for side in resolutions]
    few = sides[0]
    growth = ", ".join(f"{found[b, few].subsplats / found[a, few].subsplats:.2f}" for a, b in pairwise(resolutions))
    growth_paper = ", ".join(f"{(b[0] or 0) / (a[0] or 1):.2f}" for a, b in pairwise(printed.values()))
    grown = _growth_by_threshold(bench, scene, few, resolutions)
    last = max(found, key=lambda key: found[key].subsplats)
    shared, light, then = off.values()
    nanoseconds = np.median([1e9 * one.seconds / one.subsplats for one in found.values()])
    return Figure(
        facts=(scene_of(bench, scene).description, f"{LARGE * bench.scale.size}² pixels",
               f"light threshold {threshold:g}, relative to each light's own"),
        pictures=pictures,
        tables=(Table("Subsplats of all lights, in thousands",
                      ("indirect resolution", *(f"{n}² lights" for n in shown), *(f"{n}², ms" for n in shown),
                       *(f"{n}², paper" for n in shown)), rows),
                Table(f"Errors of the pictures, {PICTURE_LIGHTS} lights, against the same lights at every pixel in % "
                      "of the mean irradiance", ("", "subsplats", "RMSE", "MAE"),
                      [(title, count, one.rmse, one.mae) for title, (count, one) in off.items()]),
                Table(f"Growth from each resolution to the next by threshold, {few}² lights: {threshold:g} is fitted",
                      ("T", *(f"{a}² to {b}²" for a, b in pairwise(resolutions)), "in all"), grown)),
        notes=(
            f"With 16² lights the lists grow by {growth or 'nothing'} from one resolution to the next (paper: "
            f"{growth_paper}). The coarsest row is lights times filled cells there and here; "
            f"{found[resolutions[0], few].lights} of {few * few} lights shine, the others' texels are dark and have no "
            "list.",
            f"The most counted are {found[last].subsplats / 1e6:.1f} million at {last[0]}² with {last[1]}² lights, "
            "where the paper ran out of memory: lights are refined in batches here, and memory does not grow with "
            f"their number. A subsplat takes {nanoseconds:.0f} ns with all of its light, in the paper about 60 (30 to "
            f"refine, as many to draw). The paper does not give its threshold T; {threshold:g} was fitted so that "
            "lists grow about as far as its own in all, so how far is no finding. What follows freely is that growth "
            "rises from doubling to doubling, the paper's hardly does, and errors and times; the last table has other "
            "thresholds.",
            f"Lists of each light's own come to an RMSE of {light[1].rmse:.1f} % with {light[0] / 1e6:.2f} million "
            f"subsplats, the shared list to {shared[1].rmse:.1f} % with {shared[0] / 1e6:.2f} million; refining from "
            f"the shared list on, the paper's future work, to {then[1].rmse:.1f} % with {then[0] / 1e6:.2f} million."))


def _counted(bench: Workbench, scene: str, threshold: float, resolutions: tuple[int, ...],
             sides: tuple[int, ...]) -> dict[tuple[int, int], Entry]:
    """Count each entry of the table once."""
    frame = frame_of(bench, scene, LARGE)
    found: dict[tuple[int, int], Entry] = {}
    for n in (n for n in sides if n <= frame.rsm_resolution):
        settings = settings_of(bench, scene, lights=n * n)
        lights, pairs = choose_lights(frame, settings.lights), settings.effective_pairs
        for side, level in levels_of(frame, resolutions).items():
            one = ByIrradiance(finest=level, threshold=threshold)
            if not found:
                per_light_counts(frame.gbuffer, lights, one, pairs)  # compiles
            started = time.perf_counter()
            subsplats = int(per_light_counts(frame.gbuffer, lights, one, pairs).sum())
            found[side, n] = Entry(subsplats, lights.position.shape[1], time.perf_counter() - started)
    return found


def _growth_by_threshold(bench: Workbench, scene: str, side: int, resolutions: list[int]) -> list[tuple[Cell, ...]]:
    """Return a row a threshold: how the lists of side^2 lights grow, as nothing is fitted."""
    frame, settings = frame_of(bench, scene, LARGE), settings_of(bench, scene, lights=side * side)
    lights, rows = choose_lights(frame, settings.lights), list[tuple[Cell, ...]]()
    for threshold in THRESHOLDS:
        counts = [int(per_light_counts(frame.gbuffer, lights, ByIrradiance(finest=level, threshold=threshold),
                                       settings.effective_pairs).sum())
                  for level in levels_of(frame, tuple(resolutions)).values()]
        rows.append((f"{threshold:g}", *(b / a for a, b in pairwise(counts)), counts[-1] / counts[0]))
    return rows


def _pictures(bench: Workbench, scene: str, threshold: float) -> tuple[list[Picture], dict[str, tuple[int, Errors]]]:
    frame = frame_of(bench, scene)
    finest = max(0, (bench.scale.size // 256).bit_length() - 1)
    ways = {"shared": ("one list for all", ByGeometry(finest=finest)),
            "light": ("a list for each light", ByIrradiance(finest=finest, threshold=threshold)),
            "then_light": ("shared list, then each light",
                           ByIrradiance(finest=finest, threshold=threshold, criteria=Criteria()))}
    full = full_sum(frame, settings_of(bench, scene, lights=PICTURE_LIGHTS))
    gallery, off = Gallery(frame, full), {}
    for name, (title, subsplats) in ways.items():
        settings = settings_of(bench, scene, lights=PICTURE_LIGHTS, subsplats=subsplats)
        light = multires(frame, settings)
        off[title] = count, error = _pairs(frame, settings), errors_of(light, full, gallery.covered)
        gallery.indirect(name, title, f"{count} subsplats, RMSE {error.rmse:.1f} %", light, settings)
    gallery.indirect("full", "every pixel", "the same lights", full)
    gallery.camera("seen", "with direct light", "as the paper's Figure 6", full)
    return gallery.pictures, off


def _pairs(frame: Frame, settings: MultiresSettings) -> int:
    """Return how many subsplats the lists of all lights hold."""
    lights, subsplats = choose_lights(frame, settings.lights), settings.subsplats
    if not isinstance(subsplats, ByIrradiance):
        return count_of(frame, settings) * int(lights.position.shape[1])
    start = None if subsplats.start is None else subsplats_of(frame, settings)
    return int(per_light_counts(frame.gbuffer, lights, subsplats, settings.effective_pairs, None, start).sum())
