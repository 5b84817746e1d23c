"""Scenes, frames, settings, clusters and references that the figures share.

The scenes are stand-ins of the paper's face counts: a four-legged body in the Cornell box and in the atrium, a blob,
plain boxes. The body is cut from a field of balls along a skeleton, as the built-in metaballs are, so that it has legs
and a neck that throw thin shadows beside a trunk that throws a broad one.

Settings are the paper's: 1024 lights, 30 area lights, maps of 256 x 256 texels in a full run, weights 0.7 and 0.3.
Errors are those of the sum of all lights, against a ray to each of the same lights; what interleaving adds is told
apart. Such rays are many, so figures that judge do so on smaller pictures than those that time.

A light next to a surface is very bright there. The paper's pictures show no such dots, and it does not say how: the
default clamp, by the disc that a light stands for, bounds them here, in pictures and in what they are judged against.
Interleaved such a light is 64 times as bright at one pixel in 64, and pictures have a least distance of `CLAMP`.
"""

import dataclasses
import math
from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from benchmarks.papers.workbench import Subjects, Workbench, whole_frame
from refgi.cluster.clustered import clustered_irradiance
from refgi.cluster.kmeans import Clustering, cluster
from refgi.cluster.maps import ShadowMaps, shadow_maps
from refgi.cluster.occluders import ends_of
from refgi.cluster.rectangle import AreaLights, area_lights
from refgi.cluster.reference import reference_visibility
from refgi.cluster.settings import Clusters, RaysVpls, ValSettings
from refgi.cluster.val import val
from refgi.frame import Frame
from refgi.lights import PixelLights
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import with_clamp
from refgi.pairs.irradiance import Receivers
from refgi.scene import Camera, Material, Mesh, Scene, SpotLight, load_scene
from refgi.scene.builtin.cornell import CAMERA, cornell_box, shell
from refgi.scene.builtin.surfaces import HALF_SIZE, MIDDLE, Balls, blob, metaballs
from refgi.scene.model import merge
from refgi.settings import of, replaced
from refgi.types import Array

HORSE, CORNER, BOX, ATRIUM, BLOB, MARCH = "horse", "corner", "plain box", "atrium", "blob", "march"
TITLES = {BOX: "Cornell Box", HORSE: "Cornell Horse", ATRIUM: "Sponza", BLOB: "Metaballs"}  # of Table 1
MOST_LIGHTS, AREA_LIGHTS, BLOCK = 1024, 30, 8  # the paper's
FEWEST_LIGHTS = 128  # however small a run is
CLAMP = 0.04  # least distance between light and receiver, share of the diagonal
PAPER_SIZE = 800  # pixels along a side, of what is timed
JUDGED, SMALL, MOVING = 1 / 2, 1 / 4, 1 / 8  # where each pixel has a ray to each light: one picture, several, many
HIDE = Material("hide", (0.6, 0.55, 0.48))
FIELD_CUBE = 2.2  # units of the skeleton along a side of the grid
# joints of the skeleton, x ahead, y up, z aside, and radii there; each row is a limb from joint to joint
TRUNK = ((-0.42, 0.86, 0.0, 0.2), (0.36, 0.9, 0.0, 0.2))
NECK = ((0.42, 1.0, 0.0, 0.14), (0.72, 1.42, 0.0, 0.085))
HEAD = ((0.72, 1.45, 0.0, 0.09), (0.95, 1.28, 0.0, 0.06))
TAIL = ((-0.58, 0.92, 0.0, 0.06), (-0.78, 0.45, 0.0, 0.04))
LEGS = ((-0.42, 0.16), (-0.4, -0.16), (0.38, 0.15), (0.36, -0.15))  # where they leave the trunk: x, z
BALLS_A_LIMB = 9
BODY_CELLS = 55  # along the grid of its field: 17 thousand faces with the box
ATRIUM_FACES = 98_000
MOVING_CELLS, MOVING_ATRIUM_FACES = 28, 90_500  # 100 thousand faces in all
BLOB_CELLS = 22  # 5.1 thousand faces

WIDE, NARROW = math.radians(62), math.radians(12)  # half-angles of Figure 13's spots


@cache
def body(cells: int = BODY_CELLS, stride: float = 0.0) -> Mesh:
    """Build the body, 1.6 units high, on y = 0 above the origin and looking along x; `stride` swings its legs, rad."""
    limbs = [TRUNK, NECK, HEAD, TAIL, *(_leg(x, z, stride * side) for (x, z), side in zip(LEGS, (1, -1, -1, 1),
                                                                                          strict=True))]
    balls = np.concatenate([np.linspace(*limb, BALLS_A_LIMB) for limb in limbs])
    scale = 2 * HALF_SIZE / FIELD_CUBE
    foot = MIDDLE - np.array([0.0, 0.8 * scale, 0.0])
    cut = blob(Balls(foot + scale * balls[:, :3], 0.8 * scale * balls[:, 3]), cells)
    vertices = (np.asarray(cut.vertices) - foot) / scale
    vertices[:, 1] -= vertices[:, 1].min()
    return dataclasses.replace(cut, vertices=vertices, material=HIDE, name="body")


def placed(mesh: Mesh, at: tuple[float, float, float], size: float, turn: float) -> Mesh:
    """Scale a mesh (metres a unit), turn it about y (rad) and move its origin."""
    rotation = np.array([[math.cos(turn), 0, math.sin(turn)], [0, 1, 0], [-math.sin(turn), 0, math.cos(turn)]])
    normals = None if mesh.normals is None else np.asarray(mesh.normals) @ rotation.T
    return dataclasses.replace(mesh, vertices=size * np.asarray(mesh.vertices) @ rotation.T + np.asarray(at),
                               normals=normals)


def horse() -> Scene:
    """Build the stand-in for the Cornell box with a horse: about 17 thousand faces, 4 materials."""
    return _boxed("horse", SpotLight((0.1, 0.5, 0.03), (0.62, -0.38, 0.68), math.radians(24), math.radians(34),
                                     (0.9, 0.85, 0.76)), "A four-legged body in the Cornell box.")


def corner() -> Scene:
    """Build Figure 9's scene: the body in the box and a spot at one of the box's corners."""
    light = SpotLight((0.3, 0.3, 0.02), (0.42, 0.28, 0.86), math.radians(15), math.radians(21), (1.6, 1.5, 1.35))
    return _boxed("corner", light, "A spot at a corner of the box: most of the light is indirect.")


def spot(half_angle: float) -> Scene:
    """Build Figure 13's scene: the body and a spot at the left wall, whose flux is the same for all half-angles."""
    strength = 0.35 / (1 - math.cos(half_angle))
    colour = (strength * 0.33, strength * 0.31, strength * 0.28)
    light = SpotLight((0.3, 0.34, 0.06), (0.95, 0.02, 0.3), 0.9 * half_angle, half_angle, colour)
    return _boxed("spot", light, f"A spot of {math.degrees(2 * half_angle):.0f} degrees at the left wall.")


def atrium() -> Scene:
    """Build the stand-in for Sponza: about 98 thousand faces."""
    return load_scene(f"atrium:faces={ATRIUM_FACES}")


def blob_at(t: float) -> Scene:
    """Build the scene of Figure 12 at a time; the motion repeats after 1, and topology and face count change."""
    return metaballs(t, BLOB_CELLS)


def march(t: float) -> Scene:
    """Build Figure 11's scene at a time, 0 to 1: two bodies that walk two metres through the atrium."""
    hall = load_scene(f"atrium:faces={MOVING_ATRIUM_FACES}")
    pieces = [placed(body(MOVING_CELLS, 0.35 * math.sin(2 * math.pi * t + n)), (x + along * t, 0.0, z), 1.15, turn)
              for n, (x, z, along, turn) in enumerate(((-5.2, -0.2, 2.0, 0.0), (1.5, -1.1, -2.0, math.pi - 0.5)))]
    geometry, materials = merge([_whole(hall), *pieces])
    of = np.concatenate([hall.geometry.material_of_face,
                         np.full(sum(len(p.faces) for p in pieces), len(hall.materials), np.int32)])
    geometry = dataclasses.replace(geometry, material_of_face=of)
    return dataclasses.replace(hall, name="march", geometry=geometry, materials=(*hall.materials, materials[-1]),
                               camera=Camera((-9.2, 2.3, 1.3), (2.0, 1.6, -0.4), vfov=math.radians(52)))


def _leg(x: float, z: float, swing: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    reach = 0.72
    foot = (x + reach * math.sin(swing), 0.8 - reach * math.cos(swing), z, 0.055)
    return (x, 0.78, z, 0.095), foot


def _boxed(name: str, light: SpotLight, said: str) -> Scene:
    geometry, materials = merge([*shell(), placed(body(), (0.27, 0.0, 0.3), 0.21, math.radians(-35))], smooth=True)
    return Scene(name, geometry, materials, CAMERA, (light,), said, exposure=1.3)


def _whole(scene: Scene) -> Mesh:
    return Mesh(scene.geometry.vertices, scene.geometry.faces, None, scene.materials[0], scene.name)


BUILDERS: dict[str, Callable[[], Scene]] = {
    "horse": horse, "corner": corner, "plain box": cornell_box, "atrium": atrium, "blob": lambda: blob_at(0.0),
    "march": lambda: march(0.0), "wide": lambda: spot(WIDE), "narrow": lambda: spot(NARROW)}
_SUBJECTS = Subjects(BUILDERS)
scene_of, frame_of = _SUBJECTS.scene_of, _SUBJECTS.frame_of


class Clustered(NamedTuple):
    """Pixel lights and what stands for their visibility."""

    lights: PixelLights
    clusters: Clustering
    areas: AreaLights


def settings_of(bench: Workbench, **changes: Any) -> ValSettings:
    """Return the paper's settings for the sum of all lights at every pixel; a small run has fewer lights."""
    lights = min(MOST_LIGHTS, max(FEWEST_LIGHTS, 2 * bench.scale.size))
    usual: dict[str, Any] = {"lights": lights, "clusters.count": AREA_LIGHTS, "interleaving": 1,
                             "maps.resolution": bench.scale.rsm_resolution}
    return of(ValSettings, **(usual | changes))


def clamped(bench: Workbench, scene: Scene, **changes: Any) -> ValSettings:
    """Return the paper's settings with a least distance that keeps near lights dim, for the sum of all lights."""
    clamp: dict[str, Any] = {"clamp": "distance", "clamp_value": CLAMP * scene.geometry.diagonal}
    return settings_of(bench, **(clamp | changes))


def published(bench: Workbench, scene: Scene, **changes: Any) -> ValSettings:
    """Return the paper's settings with its interleaving and blur."""
    return clamped(bench, scene, interleaving=BLOCK, **changes)


def drawing(bench: Workbench, scene: Scene, settings: ValSettings) -> Callable[[], Array]:
    """Return what draws a whole frame at the size of the paper's tables."""
    return partial(whole_frame, bench, val, scene, settings, timed_size(bench) / bench.scale.size)


def timed_size(bench: Workbench) -> int:
    """Return how many pixels along a side timed pictures have: the paper's in a full run."""
    return PAPER_SIZE if bench.scale.size >= PAPER_SIZE / 2 else bench.scale.size


def clustered(frame: Frame, settings: ValSettings, start: Clustering | None = None) -> Clustered:
    """Choose lights and group them; `start` has clusters of another frame to start from."""
    return grouped(frame, choose_lights(frame, settings.lights), settings, start)


def grouped(frame: Frame, lights: PixelLights, settings: ValSettings, start: Clustering | None = None) -> Clustered:
    kind = settings.clusters
    assert isinstance(kind, Clusters)
    found = cluster(lights.position, lights.normal, kind.count, distance=kind.distance,
                    weights=(kind.position_weight, kind.normal_weight), diagonal=frame.illuminated_extent.diagonal,
                    rounds=kind.rounds, start=start)
    return Clustered(lights, found, area_lights(lights, found, settings.area))


def clustered_along(frames: list[Frame], settings: ValSettings, *, warm: bool) -> list[Clustered]:
    """Cluster the lights of one frame after another; a warm start is from the clusters of the frame before."""
    found: list[Clustered] = []
    for frame in frames:
        found.append(clustered(frame, settings, found[-1].clusters if warm and found else None))
    return found


def maps_of(frame: Frame, found: Clustered, settings: ValSettings) -> ShadowMaps:
    """Draw what each area light sees: one map for each that may be occluded."""
    tracer = frame.tracer if settings.maps.renderer == "rays" else None
    ends = ends_of(frame, found.lights)
    return shadow_maps(frame.scene.geometry, found.areas, settings.drawn_maps, frame.dtype, tracer, ends)


def lit_by(frame: Frame, found: Clustered, settings: ValSettings, maps: ShadowMaps | None = None) -> Array:
    """Return irradiance (3, h, w) of all of the given lights at every pixel, by given clusters and maps.

    Lights of a map are clamped as the settings say, others not.
    """
    of_map = found.lights.texel is not None
    settings = with_clamp(settings) if of_map else replaced(settings, {"clamp": "none"})
    by_rays = isinstance(settings.visibility, RaysVpls)
    maps = None if by_rays else maps_of(frame, found, settings) if maps is None else maps
    to = Receivers(*frame.gbuffer.resolve("position", "normal", "covered"))
    return clustered_irradiance(to, frame.gbuffer.facing, found.lights, found.areas, maps, settings,
                                footprints(frame, settings.lights, settings.pairs) if of_map else None,
                                reference_visibility(frame, found.lights, found.areas, maps, settings),
                                rays=frame.tracer if settings.maps.behind == "raytrace" else None)


def shadowed(bench: Workbench, frame: Frame, settings: ValSettings) -> Array:
    """Return the same lights with a shadow ray each: what more and more area lights converge to."""
    key = settings.lights, settings.pairs
    return bench.once(("shadowed", frame, key), lambda: rays_to(frame, choose_lights(frame, key[0]), settings))


def rays_to(frame: Frame, lights: PixelLights, settings: ValSettings) -> Array:
    """Return irradiance (3, h, w) of given lights, clamped as by `lit_by`, with a shadow ray each."""
    each = replaced(settings, {"visibility": "rays_vpls", "clusters.count": lights.position.shape[1]})
    return lit_by(frame, grouped(frame, lights, each), each)
