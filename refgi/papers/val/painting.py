"""Clustering drawn on the surfaces that their lights stand on."""

import colorsys
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from refgi.compare.maps import luminance
from refgi.image import tone_map
from refgi.papers.records import Picture

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.papers.val.subjects import Clustered

Array = npt.NDArray[Any]

GOLDEN = 0.6180339887498949  # turns between neighbouring colours
NORMAL_WEIGHT = 0.3  # diagonals for a unit of normals: a pixel's light lies on its own side of an edge
GREY, INK = 0.55, 0.8  # how bright surfaces without lights are, how strong clusters' colours


def painted(name: str, title: str, said: str, frame: "Frame", found: "Clustered", settings: Any = None) -> Picture:
    """Colour every directly lit pixel by the cluster of the pixel light next to it.

    Parameters
    ----------
    name, title, said : str
        File name, heading, line below.
    frame : Frame
        The scene, seen and lit.
    found : Clustered
        Its lights and their clusters.
    settings : object, optional
        What it was made with.

    Returns
    -------
    Picture
        Its one plane, Y, holds the cluster's number, -1 where there is none.
    """
    number = cluster_of_pixel(frame, found)
    colours = np.concatenate([palette(len(found.clusters.members)), np.ones((1, 3))])
    shade = np.asarray(tone_map(np.moveaxis(_shading(frame), 0, -1), 1.0), np.float64) / 255
    coloured = number >= 0
    mixed = np.where(coloured[..., None], INK * colours[number] * (0.35 + 0.65 * shade), GREY * shade)
    return Picture(name, title, said, (255 * mixed + 0.5).astype(np.uint8), {"Y": number.astype(np.float32)}, settings)


def palette(count: int) -> Array:
    """Return colours that neighbours in number do not share.

    Parameters
    ----------
    count : int
        How many.

    Returns
    -------
    (count, 3) ndarray
        Display colours, 0 to 1.
    """
    return np.array([colorsys.hsv_to_rgb(k * GOLDEN % 1, (0.9, 0.6)[k % 2], (1.0, 0.8)[k // 2 % 2])
                     for k in range(count)]).reshape(-1, 3)


def cluster_of_pixel(frame: "Frame", found: "Clustered") -> Array:
    """Return which cluster the nearest light of each directly lit pixel belongs to.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    found : Clustered
        Its lights and their clusters.

    Returns
    -------
    (h, w) ndarray of int64
        -1 where no light shines directly.
    """
    position, normal, covered = frame.gbuffer.resolve("position", "normal", "covered")
    lit = covered & (luminance(frame.direct) > 0)
    number = np.full(lit.shape, -1, np.int64)
    if lit.any() and found.lights.position.shape[1]:
        reach = NORMAL_WEIGHT * frame.scene.geometry.diagonal
        tree = cKDTree(np.concatenate([found.lights.position, reach * found.lights.normal]).T)
        nearest = tree.query(np.concatenate([position[:, lit], reach * normal[:, lit]]).T)[1]
        number[lit] = found.clusters.of[nearest]
    return number


def _shading(frame: "Frame") -> Array:
    """Return grey surfaces, lit from the camera."""
    position, normal, covered = frame.gbuffer.resolve("position", "normal", "covered")
    view = np.asarray(frame.scene.camera.eye, np.float64)[:, None, None] - position
    length = np.sqrt((view**2).sum(axis=0))
    cosine = np.abs((view * normal).sum(axis=0)) / np.where(length > 0, length, 1)
    grey: Array = np.where(covered, 0.15 + 0.75 * cosine, 0.0)
    return np.broadcast_to(grey, (3, *grey.shape))
