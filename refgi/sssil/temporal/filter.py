"""The temporal filter: F_i = a W(F_{i-1}) + (1 - a) I_i (Sec. 3.3).

What the temporal filter can be set to.
"""

import dataclasses
import math
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

import numpy as np
import numpy.typing as npt

from refgi.elementary import exp2
from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.scene.model import Geometry
from refgi.scene.values import is_number
from refgi.sssil.reprojection import Fetch, Seen, look_up
from refgi.sssil.temporal.motion import points_before
from refgi.stages import skip, stage

if TYPE_CHECKING:
    from refgi.frame import Frame

Form = Literal["recursive", "printed"]

CHOICES = {"form": Form, "fetch": Fetch}
# least and most of each number, and what it is
NUMBERS = {
    "weight": (0.0, 0.9999, "a share"), "depth_tolerance": (0.0, 1.0, "a share of the depth"),
    "normal_cosine": (-1.0, 1.0, "a cosine"), "speed": (1e-3, 1e6, "pixels a frame")}
Array = npt.NDArray[Any]


@dataclasses.dataclass(frozen=True)
class TemporalSettings:
    """How much of the light of earlier frames stays (Sec. 3.3, which gives no numbers).

    Of a pixel's light the share `weight`, a, comes from the frame before where that frame shows the same surface: a
    depth within `depth_tolerance` (share of the depth) and a normal within `normal_cosine`. A pixel that it does not
    show takes its new light alone. `form` "recursive" blends with the frame before as filtered, "printed" as computed.
    Where a surface moved of itself by v pixels since, a falls to a exp(-v / `speed`); a moving camera alone leaves a as
    it is. `fetch` takes the earlier light from the four texels around a point ("bilinear") or from the one it is in
    ("nearest").
    """

    weight: float = 0.9
    form: Form = "recursive"
    depth_tolerance: float = 0.02
    normal_cosine: float = 0.95
    speed: float = 16.0
    fetch: Fetch = "bilinear"

    def __post_init__(self) -> None:
        for key, names in CHOICES.items():
            expect(getattr(self, key) in get_args(names), key, " or ".join(map(repr, get_args(names))),
                   getattr(self, key))
        for key, (low, high, what) in NUMBERS.items():
            value = getattr(self, key)
            expect(is_number(value) and low <= value <= high, key, f"{what}, {low:g} to {high:g}", value)

    @property
    def variance(self) -> float:
        """Share of the variance of independent frames that stays where nothing moves, after many frames."""
        if self.form == "printed":
            return self.weight**2 + (1 - self.weight) ** 2
        return (1 - self.weight) / (1 + self.weight)


class History(NamedTuple):
    """What a frame leaves to the next."""

    irradiance: Array  # (3, h, w) F, or I for the printed form, W/m^2
    seen: Seen  # what its camera saw
    geometry: Geometry  # the scene's triangles, where the scene has them


class Filtered(NamedTuple):
    """Light blended with that of earlier frames."""

    irradiance: Array  # (3, h, w) W/m^2
    reused: float  # share of the pixels with a surface that the frame before shows as well


def remember(frame: "Frame", geometry: Geometry, irradiance: Array) -> History:
    """Return what the next frame needs of this one.

    Parameters
    ----------
    frame : Frame
        The frame.
    geometry : Geometry
        Its scene's triangles as the scene was given: the very object of the next scene if nothing moves.
    irradiance : (3, h, w) ndarray
        Its light as the form of the filter wants it, W/m^2.

    Returns
    -------
    History
        Depths, normals and light: seven numbers a pixel.
    """
    buffer = frame.gbuffer
    depth, normal = buffer.resolve("depth", "normal")
    return History(irradiance, Seen(buffer.projection, depth, normal, frame.origin), geometry)


@stage("sssil.temporal", kept=False)
def temporal_filter(
    irradiance: Array, frame: "Frame", geometry: Geometry, history: History, settings: TemporalSettings
) -> Filtered:
    """Blend the light of a frame with that of the frame before.

    Parameters
    ----------
    irradiance : (3, h, w) ndarray
        I_i, light as computed, W/m^2.
    frame : Frame
        The frame.
    geometry : Geometry
        Its scene's triangles as the scene was given.
    history : History
        What the frame before left.
    settings : TemporalSettings
        How much of it stays, and where.

    Returns
    -------
    Filtered
        F_i and how much of the picture was found again.

    Raises
    ------
    InputError
        If the frame before has other triangles.

    Notes
    -----
    The paper prints W(I_{i-1}), which averages two frames; what it says of a, "the larger, the farther in time", needs
    W(F_{i-1}). A pixel whose point fails the tests has a = 0. The light of what moves is as old as that of what rests:
    an object that leaves its place takes the light of its old place along, which is why its a falls with its speed.
    """
    buffer = frame.gbuffer
    position, normal = buffer.resolve("position", "normal")
    speed = None
    if geometry is history.geometry:
        skip("sssil.motion", "the same geometry")
    else:
        expect_same_triangles(geometry, history.geometry)
        position, normal, speed = points_before(buffer, frame.scene.geometry, _at(history.geometry, frame.origin))
    found, weight = look_up(history.irradiance, history.seen, position, normal, buffer.covered, origin=frame.origin,
                            depth_tolerance=settings.depth_tolerance, normal_cosine=settings.normal_cosine,
                            fetch=settings.fetch)
    real = irradiance.dtype.type
    reused = np.empty(len(weight), np.int64)  # pixels of each row
    _blend(irradiance, speed, real(settings.weight), real(-math.log2(math.e) / settings.speed), weight, found, reused)
    return Filtered(found, int(reused.sum()) / max(1, int(np.count_nonzero(buffer.covered))))


def expect_same_triangles(geometry: Geometry, before: Geometry) -> None:
    """Raise `InputError` unless two geometries are one at two times: the same triangles of the same vertices.

    Parameters
    ----------
    geometry, before : Geometry
        Today's and the one of the frame before.
    """
    expect(geometry.vertices.shape == before.vertices.shape, "scenes", f"the {len(before.vertices):,} vertices of the "
           "frame before in each", f"{len(geometry.vertices):,}")
    expect(geometry.faces is before.faces or np.array_equal(geometry.faces, before.faces), "scenes",
           "the triangles of the frame before in each, as objects move by their vertices", "other triangles")
    expect((geometry.vertex_normals is None) == (before.vertex_normals is None), "scenes",
           "vertex normals in all or in none", "some with and some without")


def _at(geometry: Geometry, origin: tuple[float, float, float]) -> Geometry:
    """Return the geometry relative to a frame's origin."""
    if not any(origin):
        return geometry
    return dataclasses.replace(geometry, vertices=np.asarray(geometry.vertices, np.float64) - origin)


@kernel(parallel=True)
def _blend(
    irradiance: Array, speed: Array | None, a: float, falloff: float, weight: Array, blended: Array, reused: Array
) -> None:
    """Turn W(F_{i-1}) into F_i and its weight into a; differences, so that equal light stays as it is, to the bit."""
    none = weight.dtype.type(0)
    for row in prange(weight.shape[0]):
        count = 0
        for column in range(weight.shape[1]):
            count += weight[row, column] > none
        reused[row] = count
        for column in range(weight.shape[1]):
            share = a if weight[row, column] > none else none
            if speed is not None:
                share = share * exp2(speed[row, column] * falloff)
            weight[row, column] = share
        for channel in range(3):
            for column in range(weight.shape[1]):
                new = irradiance[channel, row, column]
                blended[channel, row, column] = new + weight[row, column] * (blended[channel, row, column] - new)
