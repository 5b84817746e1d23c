"""Scenes, references, counters and the reference length that the figures share.

The paper's I_low is "x % of I_0", an irradiance of an intensity: its unit of length is missing, and with it how far
splats reach. The reference length of a scene is chosen so that splats of 5 % have the overdraw of Figure 8, 125 of 768
lights a pixel, from a picture of one size so that all figures of a scene share it.
"""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from refgi.lights.selection import choose_lights
from refgi.splat import Receivers, SiiSettings, sii
from refgi.splat.reach.fragments import Fragments, fragments
from refgi.splat.reach.reference_length import PAPER_CUT, PAPER_LIGHTS
from refgi.splat.reach.reference_length import reference_length as reference_length_of

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.frame import Frame

Array = npt.NDArray[Any]

BOX = "cornell_sphere:faces=17000"  # as many faces as the scenes of a game in 2006
CAUSTIC = SiiSettings(lights=4096, warp="B", warp_levels=3, importance="peak", i_low=PAPER_CUT,
                      reference_length=1.0)  # Figure 4, Table 1
UNCUT = SiiSettings(i_low=0.0)
COARSE = 64  # pixels along a side of the picture that the reference length is chosen by


def full_sum(bench: "Workbench", scene: str) -> Array:
    """Return the sum over every texel of the shadow maps, uncut: what pixel lights converge to.

    Parameters
    ----------
    bench : Workbench
        Holds the frame.
    scene : str
        Name of the scene.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2, without visibility.
    """
    every = dataclasses.replace(UNCUT, pattern="all")
    return bench.once(("full sum", scene), lambda: sii(bench.frame(scene), every))


def unshadowed_truth(bench: "Workbench", scene: str) -> Array:
    """Return one bounce by path tracing, without visibility between lights and receivers.

    Parameters
    ----------
    bench : Workbench
        Holds the frame.
    scene : str
        Name of the scene.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2.
    """
    from refgi.truth import TruthSettings, trace_truth

    settings = TruthSettings(samples=bench.scale.truth_samples, visibility=False)
    return bench.once(("unshadowed", scene), lambda: trace_truth(bench.frame(scene), settings).mean)


def splats(bench: "Workbench", scene: str, **changes: Any) -> SiiSettings:
    """Return settings under the scene's reference length.

    Parameters
    ----------
    bench : Workbench
        Holds the frame.
    scene : str
        Name of the scene.
    **changes : object
        What differs from 768 lights and 5 %.

    Returns
    -------
    SiiSettings
        The settings.
    """
    return SiiSettings(**{"i_low": PAPER_CUT, "reference_length": reference_length(bench, scene)} | changes)


def reference_length(bench: "Workbench", scene: str) -> float:
    """Return the reference length under which 768 splats of 5 % have the overdraw of Figure 8.

    Parameters
    ----------
    bench : Workbench
        Holds the frame.
    scene : str
        Name of the scene.

    Returns
    -------
    float
        Length, m.
    """
    return bench.once(("reference length", scene), lambda: _length(bench.frame(scene, width=COARSE, height=COARSE)))


def _length(frame: "Frame") -> float:
    receivers = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    settings = SiiSettings(lights=PAPER_LIGHTS)
    return reference_length_of(receivers, choose_lights(frame, settings), settings)


def counted(bench: "Workbench", scene: str, settings: SiiSettings) -> Fragments:
    """Count the fragments of a scene's splats.

    Parameters
    ----------
    bench : Workbench
        Holds the frame.
    scene : str
        Name of the scene.
    settings : SiiSettings
        Lights and bounds.

    Returns
    -------
    Fragments
        The overdraw map and what it adds up to.
    """
    return fragments_of(bench.frame(scene), settings)


def fragments_of(frame: "Frame", settings: SiiSettings) -> Fragments:
    """Count the fragments of a frame's splats.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    settings : SiiSettings
        Lights and bounds.

    Returns
    -------
    Fragments
        The overdraw map and what it adds up to.
    """
    buffer = frame.gbuffer
    receivers = Receivers(buffer.position, buffer.normal, buffer.covered)
    return fragments(receivers, choose_lights(frame, settings), settings, None, buffer.projection)


def low_irradiance_of(bench: "Workbench", scene: str, settings: SiiSettings) -> float:
    """Return the I_low that a share of I_0 comes to.

    Parameters
    ----------
    bench : Workbench
        Holds the frame.
    scene : str
        Name of the scene.
    settings : SiiSettings
        Lights, share and reference length.

    Returns
    -------
    float
        Irradiance, W/m^2.
    """
    from refgi.splat.reach.threshold import low_irradiance

    return low_irradiance(choose_lights(bench.frame(scene), settings), settings)
