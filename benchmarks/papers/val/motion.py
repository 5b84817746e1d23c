"""How far lights and area lights move from one frame to the next, and how far pictures change."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from benchmarks.papers.val.subjects import Clustered
    from refgi.rsm import PixelLights

Array = npt.NDArray[Any]


class Motion(NamedTuple):
    """Displacements between two frames, in per cent of the scene's diagonal."""

    lights: float  # mean of the pixel lights
    typical: float  # mean of the area lights' centres
    nearly_all: float  # 95th percentile of theirs
    largest: float


def motion(before: "Clustered", after: "Clustered", diagonal: float) -> Motion:
    """Measure how far lights and the centres of their clusters move.

    Parameters
    ----------
    before, after : Clustered
        Two frames; cluster k of one is cluster k of the other.
    diagonal : float
        Of the scene, m.

    Returns
    -------
    Motion
        Only clusters that have lights in both frames count, and lights of the same texel of the shadow map.
    """
    held = (before.clusters.members > 0) & (after.clusters.members > 0)
    centers = np.linalg.norm(after.clusters.center[:, held] - before.clusters.center[:, held], axis=0)
    lights = _paired(before.lights, after.lights)
    share = 100 / diagonal
    return Motion(share * _mean(lights), share * _mean(centers), share * _percentile(centers, 95),
                  share * _percentile(centers, 100))


def mean_motion(steps: Sequence[Motion]) -> Motion:
    """Join the motions of a sequence.

    Parameters
    ----------
    steps : sequence of Motion
        One between each two frames.

    Returns
    -------
    Motion
        Means over the frames, and the largest of all.
    """
    lights, typical, nearly_all, largest = (np.array([getattr(step, key) for step in steps]) for key in Motion._fields)
    return Motion(_mean(lights), _mean(typical), _mean(nearly_all), _percentile(largest, 100))


def changes(pictures: Sequence[Array], covered: Sequence[Array], mean: float) -> float:
    """Return how far pictures change from frame to frame.

    Parameters
    ----------
    pictures : sequence of (3, h, w) ndarray
        One a frame.
    covered : sequence of (h, w) ndarray of bool
        Pixels with a surface.
    mean : float
        What counts as 100 %.

    Returns
    -------
    float
        Mean magnitude over pixels with a surface in both frames and over frames, % of `mean`.
    """
    jumps = [np.abs(after - before)[:, here & there].mean(dtype=np.float64)
             for before, after, here, there in zip(pictures, pictures[1:], covered, covered[1:], strict=False)]
    return 100 * float(np.mean(jumps)) / mean if jumps and mean > 0 else 0.0


def _paired(before: "PixelLights", after: "PixelLights") -> Array:
    if before.texel is None or after.texel is None:
        return np.zeros(0)
    _, here, there = np.intersect1d(before.texel, after.texel, return_indices=True)
    moved: Array = np.linalg.norm(after.position[:, there] - before.position[:, here], axis=0)
    return moved


def _mean(values: Array) -> float:
    return float(np.mean(values)) if np.size(values) else 0.0


def _percentile(values: Array, percentage: float) -> float:
    return float(np.percentile(values, percentage)) if np.size(values) else 0.0
