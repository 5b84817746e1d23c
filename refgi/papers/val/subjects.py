"""Scenes, frames, settings, clusters and references that the figures share.

Settings are the paper's: 1024 lights, 30 area lights, maps of 256 x 256 texels in a full run, weights 0.7 and 0.3.
Errors are those of the sum of all lights, against a ray to each of the same lights; what interleaving adds is told
apart. Such rays are many, so figures that judge do so on smaller pictures than those that time.

A light next to a surface is very bright there, and interleaved it is 64 times as bright at one pixel in 64. The paper's
pictures show no such dots, and it does not say how; interleaved pictures have a least distance of `CLAMP` here.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.clustering.kmeans import Clustering, cluster
from refgi.cluster.clustering.rectangle import AreaLights, area_lights
from refgi.cluster.settings import ValSettings
from refgi.cluster.val import val
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.pairs.shadow_rays import receivers, shadowed_sum
from refgi.papers.subjects import Subjects, seen_by
from refgi.papers.val.scenes import BUILDERS
from refgi.settings import of
from refgi.truth.vpl import VplSettings, vpl

if TYPE_CHECKING:
    from refgi.lights import PixelLights
    from refgi.papers.workbench import Workbench
    from refgi.scene import Scene

Array = npt.NDArray[Any]

HORSE, CORNER, BOX, ATRIUM, BLOB, MARCH = "horse", "corner", "plain box", "atrium", "blob", "march"
MOST_LIGHTS, AREA_LIGHTS, BLOCK = 1024, 30, 8  # the paper's
FEWEST_LIGHTS = 128  # however small a run is
CLAMP = 0.04  # least distance between light and receiver, share of the diagonal
PAPER_SIZE = 800  # pixels along a side, of what is timed
JUDGED, SMALL, MOVING = 1 / 2, 1 / 4, 1 / 8  # where each pixel has a ray to each light: one picture, several, many

_SUBJECTS = Subjects(BUILDERS)
scene_of, frame_of = _SUBJECTS.scene_of, _SUBJECTS.frame_of


class Clustered(NamedTuple):
    """Pixel lights and what stands for their visibility."""

    lights: "PixelLights"
    clusters: Clustering
    areas: AreaLights


def settings_of(bench: "Workbench", **changes: Any) -> ValSettings:
    """Return the paper's settings, for the sum of all lights at every pixel.

    Parameters
    ----------
    bench : Workbench
        Says how large the maps are; a small run has fewer lights.
    **changes : object
        What differs.

    Returns
    -------
    ValSettings
        The settings.
    """
    lights = min(MOST_LIGHTS, max(FEWEST_LIGHTS, 2 * bench.scale.size))
    usual: dict[str, Any] = {"lights": lights, "area_lights": AREA_LIGHTS, "map_resolution": bench.scale.rsm_resolution,
                             "interleaving": 1}
    return of(ValSettings, **(usual | changes))


def clamped(bench: "Workbench", scene: "Scene", **changes: Any) -> ValSettings:
    """Return the paper's settings with a least distance that keeps near lights dim, for the sum of all lights.

    Parameters
    ----------
    bench : Workbench
        As for `settings_of`.
    scene : Scene
        Says how large it is.
    **changes : object
        What differs.

    Returns
    -------
    ValSettings
        What `published` comes to without its interleaving.
    """
    clamp: dict[str, Any] = {"clamp": "distance", "clamp_value": CLAMP * scene.geometry.diagonal}
    return settings_of(bench, **(clamp | changes))


def published(bench: "Workbench", scene: "Scene", **changes: Any) -> ValSettings:
    """Return the paper's settings with its interleaving and blur.

    Parameters
    ----------
    bench : Workbench
        As for `settings_of`.
    scene : Scene
        Says how large it is.
    **changes : object
        What differs.

    Returns
    -------
    ValSettings
        The settings.
    """
    return clamped(bench, scene, **({"interleaving": BLOCK} | changes))


def clustered(frame: Frame, settings: ValSettings, start: Clustering | None = None) -> Clustered:
    """Choose lights and group them.

    Parameters
    ----------
    frame : Frame
        The scene, lit.
    settings : ValSettings
        How.
    start : Clustering, optional
        Clustering of another frame to start from.

    Returns
    -------
    Clustered
        Lights, clusters and area lights.
    """
    lights = choose_lights(frame, settings)
    found = cluster(lights.position, lights.normal, settings.area_lights, distance=settings.distance,
                    weights=(settings.position_weight, settings.normal_weight),
                    diagonal=frame.lit_extent.diagonal, rounds=settings.rounds, start=start)
    return Clustered(lights, found, area_lights(lights, found, settings))


def shadowed(bench: "Workbench", frame: Frame, settings: ValSettings, key: Any) -> Array:
    """Return the same lights with a shadow ray each.

    Parameters
    ----------
    bench : Workbench
        Keeps it.
    frame : Frame
        The scene, seen and lit.
    settings : ValSettings
        Which lights.
    key : object
        What tells this frame from others.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2: what more and more area lights converge to.
    """
    return bench.once(("shadowed", key, settings.lights), lambda: vpl(frame, VplSettings(lights=settings.lights)))


def drawing(bench: "Workbench", scene: "Scene", settings: ValSettings) -> Callable[[], Array]:
    """Return what draws a whole frame at the size of the paper's tables.

    Parameters
    ----------
    bench : Workbench
        Sizes.
    scene : Scene
        What is drawn.
    settings : ValSettings
        How.

    Returns
    -------
    callable
        Gives radiance; nothing is kept from one call to the next.
    """
    factor = timed_size(bench) / bench.scale.size

    def draw() -> Array:
        frame = seen_by(bench, scene, factor)
        return frame.radiance(val(frame, settings))

    return draw


def timed_size(bench: "Workbench") -> int:
    """Return how large the pictures are that are timed.

    Parameters
    ----------
    bench : Workbench
        Says how large a run is.

    Returns
    -------
    int
        Pixels along a side: the paper's in a full run, those of the run in a smaller one.
    """
    return PAPER_SIZE if bench.scale.size >= PAPER_SIZE / 2 else bench.scale.size


def rounds(bench: "Workbench") -> int:
    """Return how often a whole frame is timed.

    Parameters
    ----------
    bench : Workbench
        Says how often shorter work is.

    Returns
    -------
    int
        1 or more.
    """
    return max(1, bench.scale.repeats // 2)


def rays_to(frame: Frame, lights: "PixelLights") -> Array:
    """Light every pixel by given lights with a shadow ray each.

    Parameters
    ----------
    frame : Frame
        The scene, seen.
    lights : PixelLights
        Lights; dark ones cost nothing.

    Returns
    -------
    (3, h, w) ndarray of float64
        Irradiance, W/m^2.
    """
    shines = lights.flux.any(axis=0)
    chosen = lights._replace(position=lights.position[:, shines], normal=lights.normal[:, shines],
                             flux=lights.flux[:, shines], lobe_flux=None, texel=None, map_index=None)
    buffer = frame.gbuffer
    to = receivers(frame.scene.geometry, buffer.position, buffer.normal, buffer.triangle_id, frame.tracer.grain)
    total = np.zeros((3, frame.height, frame.width))
    total.reshape(3, -1)[:, to.pixel] = shadowed_sum(frame.tracer, to, chosen)
    return total
