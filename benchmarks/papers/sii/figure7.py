"""Figure 7: where the hierarchical warp puts lights, by level and method, and what that does to the picture."""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from benchmarks.papers.judging import errors_of
from benchmarks.papers.records import Figure, Picture, Table
from benchmarks.papers.sii.subjects import full_sum
from refgi.lights.selection import importance_maps
from refgi.rsm.pyramid import importance_pyramid
from refgi.rsm.warp import warp_samples
from refgi.sampling import halton
from refgi.splat import SiiSettings, sii

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

Array = npt.NDArray[Any]

SCENE = "stage"
LIGHTS = 1024
SEEDS = (1, 2, 3, 4)
CASES: list[tuple[Any, int]] = [("none", 0), *((method, n) for method in "AB" for n in range(1, 5))]
DOT = np.array((255, 176, 32), np.uint8)
BASE = SiiSettings(lights=LIGHTS, i_low=0.0, importance="openness")


def figure7(bench: "Workbench") -> Figure:
    """Make Figure 7 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and frames.

    Returns
    -------
    Figure
        Samples over the importance map, and the error of the picture by level and method.
    """
    frame = bench.frame(SCENE)
    maps = importance_maps(frame, frame.rsms, dataclasses.replace(BASE, warp="A"))
    assert maps is not None  # the pattern is warped
    worth = maps[0]
    points, pyramid = halton(LIGHTS), importance_pyramid(worth)
    shown, rows, off = [], [], {}
    for method, levels in CASES:
        warped, weight = (points, np.ones(LIGHTS)) if method == "none" else warp_samples(
            points, pyramid, levels, method)
        title = "not warped" if method == "none" else f"method {method}, {levels} level{'s' * (levels > 1)}"
        found = 100 * float((worth[_texels(warped, worth.shape)] > 0).mean())
        off[method, levels] = _errors(bench, method, levels)
        shown.append(Picture(f"{method}{levels}", title, f"{found:.0f} % of the samples find light",
                             _dotted(worth, warped)))
        rows.append((title, found, float(weight.max()), *off[method, levels]))
    shown.insert(5, Picture("importance", "the importance map", "flux times lobe peak times (1 - openness)",
                            _dotted(worth, np.zeros((0, 2)))))
    return Figure(
        shows="Importance sampling by flux times (1 - openness) times lobe peak: three or more levels give good "
              "samplings, and both methods comparable ones.",
        facts=(SCENE, f"{LIGHTS} lights", f"errors: means over {len(SEEDS)} shifts of the points"),
        pictures=tuple(shown), columns=5,
        tables=(Table("Samples, and errors against every texel in % of the mean irradiance",
                      ("", "find light, %", "largest weight", "RMSE", "MAE"), tuple(rows)),),
        notes=_notes(off))


def _notes(off: dict[tuple[str, int], tuple[float, float]]) -> tuple[str, ...]:
    plain, a, b = (off[case] for case in (("none", 0), ("A", 3), ("B", 3)))
    best = min(off, key=lambda case: off[case][0])
    return (
        f"Three levels bring the RMSE from {plain[0]:.0f} % to {a[0]:.0f} % by method A and {b[0]:.0f} % by method B, "
        f"the MAE from {plain[1]:.1f} % to {a[1]:.1f} % and {b[1]:.1f} %. The least RMSE is that of method {best[0]} "
        f"with {best[1]} levels ({off[best][0]:.0f} %).",
        "The importance is that of light near other surfaces, not of flux alone, so lights gather along edges. It "
        "shows in the RMSE, which a few pixels next to such edges lead, more than in the MAE. A sample in a dark part "
        "of a cell keeps a large weight, which is why the errors do not fall with every single level.",
    )


def _errors(bench: "Workbench", method: Any, levels: int) -> tuple[float, float]:
    frame, full = bench.frame(SCENE), full_sum(bench, SCENE)
    off = []
    for seed in SEEDS:
        settings = dataclasses.replace(BASE, warp=method, warp_levels=levels, seed=seed)
        off.append(errors_of(sii(frame, settings), full, frame.gbuffer.covered)[:2])
    rmse, mae = np.mean(off, axis=0)
    return float(rmse), float(mae)


def _texels(points: Array, shape: tuple[int, int]) -> tuple[Array, Array]:
    height, width = shape
    return (points[:, 1] * height).astype(np.int64), (points[:, 0] * width).astype(np.int64)


def _dotted(worth: Array, points: Array) -> npt.NDArray[np.uint8]:
    """Return the map in greys with a dot at each point."""
    factor = max(1, 512 // len(worth))
    grey = np.sqrt(np.clip(worth / (np.percentile(worth[worth > 0], 99) if worth.any() else 1.0), 0, 1))
    large = np.repeat(np.repeat((grey * 190 + 0.5).astype(np.uint8), factor, axis=0), factor, axis=1)
    pixels = np.repeat(large[..., None], 3, axis=2)
    height, width = large.shape
    for row, column in zip(*_texels(points, (height, width)), strict=True):
        pixels[max(0, row - 1) : row + 2, max(0, column - 1) : column + 2] = DOT
    return pixels
