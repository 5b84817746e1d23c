"""Scenes, references and the reference length that the figures share."""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from refgi.splat import SiiSettings, sii

if TYPE_CHECKING:
    from refgi.papers.workbench import Workbench

Array = npt.NDArray[Any]

BOX = "cornell_sphere:faces=17000"  # as many faces as the scenes of a game in 2006
UNCUT = SiiSettings(i_low=0.0)


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
