"""Figure 13: soft and crisp indirect shadows, from a wide and from a narrow spot."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.judging import errors_of
from benchmarks.papers.records import Figure, Picture, Table
from benchmarks.papers.val.lit import without_visibility
from benchmarks.papers.val.subjects import SMALL, clustered, frame_of, settings_of, shadowed
from refgi.cluster.val import val
from refgi.compare.maps import luminance

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

Array = npt.NDArray[Any]

TITLES = {"wide": "wide spot", "narrow": "narrow spot"}
SHADOW, DEEP = 0.9, 0.1  # of the light that would come without occlusion: less is a shadow, less than that its core


class Soft(NamedTuple):
    """How soft one scene's shadows are."""

    size: float  # mean size of area lights, cm
    here: float  # share of the shadow that is penumbra, %
    exact: float  # the same by a ray to each light
    rmse: float  # % of the mean


def figure13(bench: "Workbench") -> Figure:
    """Make Figure 13 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and frames.

    Returns
    -------
    Figure
        Pictures under a wide and a narrow spot, and how much of each shadow is penumbra.
    """
    shown: list[Picture] = []
    found = {}
    settings = settings_of(bench)
    for name, title in TITLES.items():
        found[name] = _measured(bench, name)
        frame = frame_of(bench, name)
        light = val(frame, settings)
        exposure = pictures.exposure_of(light, frame.gbuffer.covered)
        shown += [pictures.seen(f"{name}_seen", title, "with direct light", frame, light, settings),
                  pictures.indirect(f"{name}_indirect", f"{title}, indirect light",
                                    f"{found[name].here:.0f} % of the shadow is penumbra", light, exposure)]
        small = frame_of(bench, name, SMALL)
        shown.append(pictures.indirect(f"{name}_rays", f"{title}, a ray to each light",
                                       f"{found[name].exact:.0f} % of the shadow", _exact(bench, name), pictures
                                       .exposure_of(_exact(bench, name), small.gbuffer.covered)))
    return Figure(
        shows="A wide spot casts a soft indirect shadow; soft and crisp indirect shadows come from one method.",
        facts=("the four-legged body in the Cornell box", f"{settings.lights} lights", "spots of equal flux at the "
               "left wall", f"judged at {frame_of(bench, 'wide', SMALL).width}²"),
        pictures=tuple(shown), columns=3,
        tables=(Table("Shadows: pixels that get less than 90 % of what would come without occlusion, and how many of "
                      "them get more than 10 %", ("", "size of an area light, cm", "penumbra, %",
                                                  "penumbra by rays, %", "RMSE, % of the mean"),
                      tuple((TITLES[name], *one) for name, one in found.items())),),
        notes=_notes(found))


def _measured(bench: "Workbench", name: str) -> Soft:
    frame, settings = frame_of(bench, name, SMALL), settings_of(bench)
    free, light, exact = val(frame, without_visibility(settings)), val(frame, settings), _exact(bench, name)
    covered, areas = frame.gbuffer.covered, clustered(frame, settings).areas
    used = areas.members > 0
    size = 100 * float(areas.delta[used].mean()) if used.any() else 0.0
    return Soft(size, _penumbra(light, free, covered), _penumbra(exact, free, covered),
                errors_of(light, exact, covered).rmse)


def _exact(bench: "Workbench", name: str) -> Array:
    return shadowed(bench, frame_of(bench, name, SMALL), settings_of(bench), (name, SMALL))


def _penumbra(light: Array, free: Array, covered: Array) -> float:
    """Return how much of the shadow is penumbra, in per cent."""
    most = luminance(free)
    judged = covered & (most > 0)
    share = np.divide(luminance(light), most, out=np.ones_like(most), where=judged)[judged]
    shadow = share < SHADOW
    return 100 * int(np.count_nonzero(shadow & (share > DEEP))) / max(1, int(np.count_nonzero(shadow)))


def _notes(found: dict[str, Soft]) -> tuple[str, ...]:
    wide, narrow = found["wide"], found["narrow"]
    return (
        f"Of the shadow {wide.here:.0f} % is penumbra under the wide spot and {narrow.here:.0f} % under the narrow "
        f"one; by a ray to each light {wide.exact:.0f} and {narrow.exact:.0f} %. Area lights are {wide.size:.1f} cm "
        f"wide there and {narrow.size:.1f} cm here: their size alone decides, as in the paper.",
        f"The RMSE against those rays is {wide.rmse:.1f} % of the mean under the wide spot and {narrow.rmse:.1f} % "
        "under the narrow one, whose shadows lie on top of each other and hide nothing.")
