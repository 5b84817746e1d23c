"""Square lights over a floor with the four-legged body or plain plates on it, for single soft shadows.

A lamp is one cluster of pixel lights on a square grid, so that the method sees it as it sees any cluster, and a ray to
each of its lights is the truth for it.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.papers.val.scenes import body, placed
from benchmarks.papers.val.subjects import Clustered
from refgi.cluster.clustering.kmeans import cluster
from refgi.cluster.clustering.rectangle import area_lights
from refgi.cluster.settings import ValSettings
from refgi.frame import Frame
from refgi.rsm import PixelLights
from refgi.scene import Camera, Material, Mesh, Scene, SpotLight
from refgi.scene.builtin.surfaces import rectangle
from refgi.scene.model import merge

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

Array = npt.NDArray[Any]
Vector = tuple[float, float, float]

FLOOR, BOARD = Material("floor", (0.7, 0.7, 0.7)), Material("board", (0.6, 0.45, 0.3))
HALF = 1.8  # m, half a side of the floor: what is far sets the bias of the series
GRID = 12  # lights along a side of a lamp
FLUX = 40.0  # W, of a lamp


class Lamp(NamedTuple):
    """A square of lights."""

    center: Vector  # m
    normal: Vector  # along an axis
    side: float  # m


class View(NamedTuple):
    """A lamp, what it shines on and who looks."""

    name: str
    title: str
    lamp: Lamp
    stands: str  # what throws the shadow: "body" or "board"
    eye: Vector
    target: Vector


def frame_of_lamp(bench: "Workbench", view: View, factor: float) -> Frame:
    """Return the frame of a view.

    Parameters
    ----------
    bench : Workbench
        Sizes; keeps the frame.
    view : View
        What is seen.
    factor : float
        Pixels a side, in units of the run's.

    Returns
    -------
    Frame
        With a light of no use, since frames must have one.
    """
    def make() -> Frame:
        geometry, materials = merge([_floor(), *_standing(view.stands)], smooth=True)
        camera = Camera(view.eye, view.target)
        light = SpotLight((0.0, 6.0, 0.0), (0.0, -1.0, 0.001), 0.1, 0.2, (1.0, 1.0, 1.0))
        size = max(8, round(factor * bench.scale.size))
        return Frame(Scene(view.name, geometry, materials, camera, (light,)), width=size, height=size,
                     rsm_resolution=8)

    return bench.once(("lamp", view.name, factor), make)


def one_cluster(view: View, settings: ValSettings, diagonal: float) -> Clustered:
    """Return a lamp's lights as one cluster.

    Parameters
    ----------
    view : View
        Says which lamp.
    settings : ValSettings
        How large an area light is.
    diagonal : float
        Of the scene, m.

    Returns
    -------
    Clustered
        `GRID` x `GRID` lights and one area light.
    """
    lights = lights_of(view.lamp)
    found = cluster(lights.position, lights.normal, 1, diagonal=diagonal)
    return Clustered(lights, found, area_lights(lights, found, settings))


def lights_of(lamp: Lamp) -> PixelLights:
    """Return the lights of a lamp, in the middles of equal squares.

    Parameters
    ----------
    lamp : Lamp
        The square.

    Returns
    -------
    PixelLights
        Of equal flux, in float32.
    """
    normal = np.asarray(lamp.normal, np.float64)
    first, second = np.eye(3)[np.flatnonzero(normal == 0)]
    along = lamp.side * ((np.arange(GRID) + 0.5) / GRID - 0.5)
    u, v = (part.ravel() for part in np.meshgrid(along, along))
    position = np.asarray(lamp.center)[:, None] + first[:, None] * u + second[:, None] * v
    count = position.shape[1]
    return PixelLights(position.astype(np.float32), np.repeat(normal[:, None], count, 1).astype(np.float32),
                       np.full((3, count), FLUX / count, np.float32), None, None, None, count)


def _floor() -> Mesh:
    return rectangle((-HALF, 0.0, HALF), (2 * HALF, 0.0, 0.0), (0.0, 0.0, -2 * HALF), FLOOR, "floor")


def _standing(stands: str) -> list[Mesh]:
    if stands == "body":
        return [placed(body(), (0.0, 0.0, 0.0), 1.0, -0.6)]
    return [rectangle((-0.4, 0.0, 0.0), (0.8, 0.0, 0.0), (0.0, 1.0, 0.0), BOARD, "board"),
            rectangle((-HALF, 0.0, -HALF), (2 * HALF, 0.0, 0.0), (0.0, 2.0, 0.0), FLOOR, "back")]
