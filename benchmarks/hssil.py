"""Screen-space indirect light: times of the paper's table beside ours, and error against time.

Times of the paper are of a GeForce 8800 GTS and of a GTX 260 at 1280 x 720 with a radius of 20 texels; ours are of this
machine, for the whole indirect pass: from the G-buffer and direct light to irradiance at full resolution, and composed.
The game's levels are not published: a built-in hall stands in, or the atrium of REFGI_DATA where that names its folder.
"""

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.harness import Row, paper_scene, ratio, seconds
from refgi import Frame
from refgi.errors import RefgiWarning
from refgi.frame import compose
from refgi.settings import of, replaced
from refgi.sssil import HssilSettings
from refgi.sssil.hssil import hssil
from refgi.sssil.settings import PRESETS
from refgi.stages import observe

PAPER = {  # start, levels, samples: total ms on both cards, Fig. 6
    ("quarter", 4, 64): (13.9, 4.6), ("quarter", 4, 256): (33.6, 11.2), ("half", 4, 256): (110.6, 32.6),
    ("half", 4, 64): (34.8, 10.5), ("half", 5, 64): (35.1, 10.55)}
PARTS = {"levels": ("sssil.pyramid",), "samples": ("sssil.gather",), "upsampling": ("sssil.upsample",)}


def rows(quick: bool) -> Iterator[Row]:
    warnings.simplefilter("ignore", RefgiWarning)  # the paper's settings do not cover the screen
    width, height, repeats = (640, 360, 5) if quick else (1280, 720, 15)
    frame = _seen("sponza", width, height)
    for (start, levels, samples), (_, fast) in PAPER.items():
        settings = replaced(PRESETS["paper"], {"start": start, "levels": levels, "samples": samples})
        yield _time(frame, f"{start}, {levels} levels, {samples} samples", settings, repeats, fast)
    yield from _fifth_level(frame, repeats)
    for name in ("sponza", "cornell_horse"):
        yield from _errors(name, 96 if quick else 192)


def _seen(name: str, width: int, height: int) -> Frame:
    """Return a frame whose G-buffer and direct light are known: what deferred shading has done before."""
    frame = Frame(paper_scene(name), width=width, height=height)
    frame.gbuffer.resolve("position", "depth", "normal", "albedo")
    assert frame.direct.any()
    return frame


def _time(frame: Frame, name: str, settings: HssilSettings, repeats: int, fast: float) -> Row:
    def draw() -> None:
        compose(frame.direct, hssil(frame, settings), frame.gbuffer, frame.materials)

    taken = 1e3 * seconds(draw, repeats)
    return Row(name, taken, "ms", f"<= {fast}", _breakdown(draw, repeats))


def _breakdown(draw: Any, repeats: int) -> str:
    parts: dict[str, list[float]] = {part: [] for part in [*PARTS, "composing"]}
    for _ in range(repeats):
        with observe() as log:
            draw()
        for part, stages in PARTS.items():
            parts[part].append(1e3 * sum(log.seconds(stage) for stage in stages))
        parts["composing"].append(1e3 * log.seconds("frame.compose"))
    return ", ".join(f"{part} {np.median(times):.1f} ms" for part, times in parts.items())


def _fifth_level(frame: Frame, repeats: int) -> Iterator[Row]:
    """The fifth level's cost; the paper's text says about 1 %, its samples are 0.3 % of all."""
    four, five = (replaced(PRESETS["paper"], {"levels": levels}) for levels in (4, 5))
    found = ratio(lambda: hssil(frame, five), lambda: hssil(frame, four), repeats)
    yield Row("a fifth level: time beside four", found.median, "", "<= 1.01", f"{found.low:.3f} to {found.high:.3f}")


def _errors(name: str, size: int) -> Iterator[Row]:
    """Error against every texel of the crowns, and time, by samples."""
    frame = _seen(name, size, size)
    limit = hssil(frame, of(HssilSettings, pattern="all")).astype(np.float64)
    for pattern in ("interleaved", "row", "pixel"):
        for samples in (16, 64, 256):
            settings = of(HssilSettings, pattern=pattern, samples=samples)
            found = hssil(frame, settings)
            error = float(np.sqrt(np.mean((found - limit) ** 2)) / limit.mean())

            def draw(how: HssilSettings = settings) -> None:
                hssil(frame, replaced(how, {"seed": 1}))

            yield Row(f"{name}: {samples} samples by {pattern}, RMSE / mean", error, "", "",
                      f"{1e3 * seconds(draw, 5):.1f} ms at {size}^2")
