"""Scenes, references, counters and the reference length that the figures share.

The paper's I_low is "x % of I_0", an irradiance of an intensity: its unit of length is missing, and with it how far
splats reach. The reference length of a scene is chosen so that splats of 5 % have the overdraw of Figure 8, 125 of 768
lights a pixel, from a picture of one size so that all figures of a scene share it.

The paper names no clamp and its pictures show no dots beside walls: the default clamp bounds near pairs, but for the
narrow lobes of Figure 4 and the walk of Figure 6, whose lights stand for no area.
"""

from typing import Any

from benchmarks.papers.workbench import Workbench
from refgi.frame import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import with_clamp
from refgi.settings import of
from refgi.splat import Receivers, SiiSettings, sii
from refgi.splat.sii.fragments import Fragments, fragments
from refgi.splat.sii.settings import RelativeCut
from refgi.splat.sii.threshold import PAPER_CUT, PAPER_LIGHTS
from refgi.splat.sii.threshold import reference_length as reference_length_of
from refgi.types import Array

BOX = "cornell_sphere:faces=17000"  # as many faces as the scenes of a game in 2006
CAUSTIC = of(SiiSettings, lights=4096, warp="B", warp_levels=3, importance="peak", cut_share=PAPER_CUT,
             reference_length=1.0, clamp="none")  # Figure 4, Table 1
COARSE = 64  # pixels along a side of the picture that the reference length is chosen by


def full_sum(bench: Workbench, scene: str) -> Array:
    """Return the uncut sum over every texel of the shadow maps: what pixel lights converge to."""
    every = of(SiiSettings, pattern="all")
    return bench.once(("full sum", scene), lambda: sii(bench.frame(scene), every))


def splats(bench: Workbench, scene: str, share: float = PAPER_CUT, **changes: Any) -> SiiSettings:
    """Return settings of 768 lights, but for `changes`, cut at a share of I_0 under the scene's reference length.

    A share of 0 cuts nothing.
    """
    cut = RelativeCut(share, reference_length(bench, scene)) if share > 0 else None
    return of(SiiSettings, **{"cut": cut} | changes)


def reference_length(bench: Workbench, scene: str) -> float:
    """Return the reference length (m) under which 768 splats of 5 % have the overdraw of Figure 8."""
    def length() -> float:
        frame = bench.frame(scene, width=COARSE, height=COARSE)
        settings = of(SiiSettings, lights=PAPER_LIGHTS, clamp="none")
        receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
        return reference_length_of(receivers, choose_lights(frame, settings.lights), settings.pairs)

    return bench.once(("reference length", scene), length)


def counted(frame: Frame, settings: SiiSettings) -> Fragments:
    """Count the fragments of a frame's splats: the overdraw map and what it adds up to."""
    buffer = frame.gbuffer
    receivers = Receivers(buffer.position, buffer.normal, buffer.covered)
    settings = with_clamp(settings)
    footprint = footprints(frame, settings.lights, settings.pairs)
    return fragments(receivers, choose_lights(frame, settings.lights), settings, footprint, buffer.projection)
