"""Which lights are splatted: caustics, lights of a walk and of the map, lights moved by importance."""

import math
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.harness import interleaved
from benchmarks.papers.records import Case, Figure, Picture, Table, relative
from benchmarks.papers.sii.subjects import full_sum
from benchmarks.papers.workbench import Gallery, Workbench, errors_of, whole_frame
from refgi.lights import PixelLights, importance_pyramid
from refgi.lights.selection import choose_lights, importance_maps
from refgi.lights.settings import LightSettings
from refgi.lights.warp import warp_samples
from refgi.sampling import halton
from refgi.settings import of, replaced
from refgi.splat import SiiSettings, sii
from refgi.truth.vpl import VplSettings, vpl
from refgi.types import Array

BLOCK = 8  # pixels along a side, by whose means caustics are judged
WARPS: list[tuple[Any, int]] = [("none", 0), *((method, n) for method in "AB" for n in range(1, 5))]
DOT = np.array((255, 176, 32), np.uint8)


def caustics(bench: Workbench, cases: tuple[Case, ...]) -> Figure:
    """Figure 4: caustics of a metal ring and of glass, 4096 importance-sampled lights beside path tracing."""
    fine = {"rsm_resolution": 2 * bench.scale.rsm_resolution}  # texels enough for 4096 lights on a small body
    frames = {c.scene: bench.frame(c.scene, shadows="exact", **fine) for c in cases}
    seconds = interleaved({c.name: partial(whole_frame, bench, sii, frames[c.scene].scene, c.settings, **fine)
                           for c in cases}, bench.few)
    shown: list[Picture] = []
    rows, off, peak = [], {}, {}
    for scene, frame in frames.items():
        gallery = Gallery(frame, shown=shown)
        truth = bench.traced(frame, caustics=True, photons=bench.scale.photons).mean
        for case in (c for c in cases if c.scene == scene):
            taken, made = seconds[case.name], sii(frame, case.settings)
            coarse, right = _blocks(made), _blocks(truth)
            off[case.name] = errors_of(coarse, right, np.ones(right.shape[1:], bool))
            bright = np.unravel_index(right.sum(axis=0).argmax(), right.shape[1:])
            peak[case.name] = 100 * float(coarse[:, *bright].sum() / right[:, *bright].sum())
            gallery.camera(case.name, f"SII, {case.title}", f"{1 / taken:.1f} frames per second", made, case.settings)
            rows.append((case.title, 1e3 * taken, 1 / taken, case.printed, *off[case.name]))
        gallery.camera(f"{scene}_truth", f"Path tracing, {scene.replace('_', ' ')}", "photons from the light", truth)
    ring, wide, glass, both, even = (c.name for c in cases)
    lit = {c.name: choose_lights(frames[c.scene], c.settings.lights) for c in cases}
    lobes = {name: int(_has_lobe(lights).sum()) for name, lights in lit.items()}
    brightest = {name: 100 * float(lights.flux.sum(axis=0).max() / lights.flux.sum()) for name, lights in lit.items()}
    return Figure(
        facts=("ring, glass_ball", "4096 lights, 3 levels, method B", "reference length 1 m"), pictures=shown,
        ratios=[relative(f"frames per second, relative to the {cases[0].title}",
                         {c.title: 1 / seconds[c.name] for c in cases}, {c.title: c.printed for c in cases})],
        tables=[Table("A frame with shadow map, deferred buffers, warp and splats; errors of blocks of 8 by 8 pixels "
                      "in % of the mean irradiance",
                      ("", "ms", "fps", "fps, paper", "RMSE to path tracing", "MAE", "darker by"), rows)],
        notes=(
            f"The caustic comes out, its smoothness does not: {lobes[ring]} of the 4096 lights have lobes of the ring, "
            "and away from the cusp each draws a highlight of its own. The paper states neither exponent nor widening; "
            f"this ring's exponent is 2000. With exponents that fall within 0.4 m of a light (Sec. 3.3) streaks and "
            f"stars melt, the RMSE falls from {off[ring].rmse:.0f} to {off[wide].rmse:.0f} % and the cusp blurs; blunt "
            f"lobes reach further and take {seconds[wide] / seconds[ring]:.0f} times as long. The 0.4 m were taken as "
            "the best of six lengths.",
            "Refraction at the back faces alone, as published, focuses R / (n - 1) = 0.24 m behind the ball instead of "
            "R (2 - n) / (2 (n - 1)) = 0.06 m, and beyond two thirds of its radius total reflection lets no light out; "
            f"the floor is 0.12 m away. So its spot is an even disc without a halo, {peak[glass]:.0f} % as bright in "
            f"the middle as it should be, at both faces {peak[both]:.0f} %; the RMSE falls from "
            f"{off[glass].rmse:.0f} to {off[both].rmse:.0f} %.",
            "The glow at the wall's foot is no refraction: importance by peaks leaves diffuse surfaces "
            f"{4096 - lobes[glass]} of 4096 lights, and one beside the wall holds {brightest[glass]:.0f} % of their "
            f"flux. With a tenth of the lights spread evenly the largest holds {brightest[even]:.1f} % and the glow is "
            "gone; I_low, a share of the brightest lobe's intensity, then cuts the wall's faint diffuse light: the "
            f"picture is {off[even].lost:.0f} % too dark.",
            f"The glass ball runs {seconds[ring] / seconds[glass]:.2f} times as fast as the ring, the paper's glass "
            f"figure 1.58 times: {lobes[glass]} lights of the ball have lobes, so it has more to draw than the ring. "
            "How many of its 4096 lights fell on the glass the paper does not say."))


def _has_lobe(lights: PixelLights) -> Array:
    """Return which of the lights (n,) have lobes."""
    return np.zeros(lights.position.shape[1], bool) if lights.lobe_flux is None else np.any(lights.lobe_flux, axis=0)


def _blocks(image: Array) -> Array:
    """Return means of blocks of pixels, by which caustics are judged: photons are noisy pixel by pixel."""
    height, width = image.shape[1:]
    size = math.gcd(BLOCK, math.gcd(height, width))
    means: Array = image.reshape(3, height // size, size, width // size, size).mean(axis=(2, 4))
    return means


def instant_radiosity(bench: Workbench, scene: str, lights: int, sources: dict[Any, str]) -> Figure:
    """Figure 6: a thousand lights, splatted without visibility and ray-traced with it."""
    half = bench.scale.size // 2  # a shadow ray for each of 1000 lights at each pixel
    gallery = Gallery(frame := bench.frame(scene, width=half, height=half))
    covered, truth = gallery.covered, bench.traced(frame).mean
    rows, blocked, noise = [], {}, {}
    for source, title in sources.items():
        settings = of(SiiSettings, lights=lights, source=source, clamp="none")
        splatted, shadowed = sii(frame, settings), vpl(frame, VplSettings(settings.lights))
        blocked[source] = errors_of(splatted, shadowed, covered)
        noise[source] = errors_of(shadowed, truth, covered)
        gallery.camera(f"{source}_sii", f"SII, lights of the {title}",
                       f"RMSE to instant radiosity {blocked[source].rmse:.0f} %", splatted, settings)
        gallery.camera(f"{source}_vpl", f"Instant radiosity, {title}", "a shadow ray for each light and pixel",
                       shadowed, settings)
        rows += [(f"SII, {title}", *blocked[source], *errors_of(splatted, truth, covered)),
                 (f"instant radiosity, {title}", None, None, None, *noise[source])]
    gallery.camera("truth", "Path tracing", "one bounce", truth)
    columns = ("", "RMSE to instant radiosity", "MAE", "darker by", "RMSE to path tracing", "MAE", "darker by")
    walk = blocked["walk"]
    return Figure(
        facts=(scene, f"{half} by {half} pixels", f"{lights} lights, one bounce, no cut"), pictures=gallery.pictures,
        tables=[Table("Errors, in % of the mean irradiance", columns, rows)],
        notes=(
            "Comparable, as the paper says: splatting does not know what blocks indirect light and is "
            f"{-walk.lost:.0f} % too bright for it (MAE {walk.mae:.0f} %), most of all behind and between the blocks.",
            f"A thousand lights have noise of their own: with shadow rays their MAE to path tracing is "
            f"{noise['walk'].mae:.0f} % for those of the walk and {noise['rsm'].mae:.0f} % for those of the shadow map."
            " Where an RMSE is many times its MAE, a light lies next to an edge and outshines a few pixels beside it."))


def warped(bench: Workbench, scene: str, lights: int, seeds: tuple[int, ...]) -> Figure:
    """Figure 7: where the hierarchical warp puts lights, by level and method, and what that does to the picture."""
    frame, full = bench.frame(scene), full_sum(bench, scene)
    base = of(SiiSettings, lights=lights)
    maps = importance_maps(frame, frame.rsms, of(LightSettings, warp="A", importance="openness"))
    assert maps is not None  # the pattern is warped
    importance = maps[0]
    points, pyramid = halton(lights), importance_pyramid(importance)

    def errors(method: Any, levels: int) -> tuple[float, float]:
        warp = {} if method == "none" else {"warp": method, "warp_levels": levels, "importance": "openness"}
        off = [errors_of(sii(frame, replaced(base, warp | {"seed": seed})), full, frame.gbuffer.covered)[:2]
               for seed in seeds]
        rmse, mae = np.mean(off, axis=0)
        return float(rmse), float(mae)

    shown, rows, off = [], [], {}
    for method, levels in WARPS:
        moved, weight = (points, np.ones(lights)) if method == "none" else warp_samples(points, pyramid, levels, method)
        title = "not warped" if method == "none" else f"method {method}, {levels} level{'s' * (levels > 1)}"
        found = 100 * float((importance[_texels(moved, importance.shape)] > 0).mean())
        off[method, levels] = errors(method, levels)
        shown.append(Picture(f"{method}{levels}", title, f"{found:.0f} % of the samples find light",
                             _dotted(importance, moved)))
        rows.append((title, found, float(weight.max()), *off[method, levels]))
    shown.insert(5, Picture("importance", "the importance map", "flux times lobe peak times (1 - openness)",
                            _dotted(importance, np.zeros((0, 2)))))
    plain, a, b = (off[case] for case in (("none", 0), ("A", 3), ("B", 3)))
    best = min(off, key=lambda case: off[case][0])
    return Figure(
        facts=(scene, f"{lights} lights", f"errors: means over {len(seeds)} shifts of the points"), pictures=shown,
        tables=[Table("Samples, and errors against every texel in % of the mean irradiance",
                      ("", "find light, %", "largest weight", "RMSE", "MAE"), rows)],
        notes=(
            f"Three levels bring the RMSE from {plain[0]:.0f} % to {a[0]:.0f} % by method A and {b[0]:.0f} % by method "
            f"B, the MAE from {plain[1]:.1f} % to {a[1]:.1f} % and {b[1]:.1f} %. The least RMSE is that of method "
            f"{best[0]} with {best[1]} levels ({off[best][0]:.0f} %).",
            "The importance is that of light near other surfaces, not of flux alone, so lights gather along edges. It "
            "shows in the RMSE, which a few pixels next to such edges lead, more than in the MAE. A sample in a dark "
            "part of a cell keeps a large weight, which is why the errors do not fall with every single level."))


def _texels(points: Array, shape: tuple[int, ...]) -> tuple[Array, Array]:
    height, width = shape
    return (points[:, 1] * height).astype(np.int64), (points[:, 0] * width).astype(np.int64)


def _dotted(importance: Array, points: Array) -> npt.NDArray[np.uint8]:
    """Return the map in greys with a dot at each point."""
    factor = max(1, 512 // len(importance))
    bright = np.percentile(importance[importance > 0], 99) if importance.any() else 1.0
    grey = np.sqrt(np.clip(importance / bright, 0, 1))
    large = np.repeat(np.repeat((grey * 190 + 0.5).astype(np.uint8), factor, axis=0), factor, axis=1)
    pixels = np.repeat(large[..., None], 3, axis=2)
    for row, column in zip(*_texels(points, large.shape), strict=True):
        pixels[max(0, row - 1) : row + 2, max(0, column - 1) : column + 2] = DOT
    return pixels
