"""Figure 13: the method beside every pixel, gathering, every texel and path tracing; clamp and equal solid angles."""

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.judging import Errors, errors_of
from benchmarks.papers.multires.subjects import every_texel, frame_of, full_sum, settings_of, unclamped
from benchmarks.papers.records import Figure, Picture, Table
from refgi.compare.maps import DIVERGING, Scale, luminance
from refgi.lights.solid_angle import with_equal_solid_angles
from refgi.splat.gathering.gather import GatherSettings, gather
from refgi.splat.multires import MultiresSettings, multires

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.frame import Frame

Array = npt.NDArray[Any]

SCENE = "cornell_sphere"
WHOLE_MAP = 1.4143  # map widths: a disc past every corner
EQUAL = frozenset({"equal_solid_angle"})


class Subject(NamedTuple):
    """One way to light the scene."""

    name: str
    title: str
    irradiance: Array


def figure13(bench: "Workbench") -> Figure:
    """Make Figure 13 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and samples.

    Returns
    -------
    Figure
        Pictures, their errors against path tracing with and without visibility, and the ratios of solid angles.
    """
    frame, settings = frame_of(bench, SCENE), settings_of(bench, SCENE)
    covered = frame.gbuffer.covered
    unshadowed, truth = (_traced(bench, frame, visible) for visible in (False, True))
    subjects = _subjects(frame, settings)
    exposure = pictures.exposure_of(unshadowed, covered)
    against = {s.name: (errors_of(s.irradiance, unshadowed, covered), errors_of(s.irradiance, truth, covered))
               for s in subjects}
    shown = [pictures.indirect(s.name, s.title, f"MAE {against[s.name][0].mae:.0f} % without, "
                               f"{against[s.name][1].mae:.0f} % with visibility", s.irradiance, exposure)
             for s in subjects]
    shown += [pictures.indirect("unshadowed", "path tracing, no visibility", "what all of these leave out", unshadowed,
                                exposure),
              pictures.indirect("truth", "path tracing", "one bounce", truth, exposure), _ratio(frame, subjects)]
    lights = {s.name: s.irradiance for s in subjects}
    near, clamp = (errors_of(lights[a], lights[b], covered) for a, b in (("multires", "naive"), ("texels_clamped",
                                                                                               "texels")))
    solid = solid_angle_ratios(frame)
    return Figure(
        shows="The method and reflective shadow mapping are near indistinguishable; every texel as a light, without a "
              "clamp, is brighter; path tracing differs by visibility, clamp and the solid angles of texels.",
        facts=(SCENE, f"{settings.lights} lights, clamped at {settings.clamp_value:.3g} m"), pictures=tuple(shown),
        columns=5,
        tables=(Table("Errors, in % of the mean irradiance",
                      ("", *(f"{what}, {which} visibility" for which in ("no", "with")
                             for what in ("RMSE", "MAE", "darker by"))),
                      tuple((s.title, *against[s.name][0], *against[s.name][1]) for s in subjects)),
                Table("Exact over equal solid angle of this spot's texels, and in closed form",
                      ("", "here", "closed form"), solid)),
        notes=_notes(near, clamp, solid, against, lights, covered))


def _subjects(frame: "Frame", settings: MultiresSettings) -> list[Subject]:
    equal = dataclasses.replace(settings, as_published=EQUAL)
    bare = unclamped(settings)
    whole = GatherSettings(samples=1024, grid=0, radius=WHOLE_MAP)
    return [
        Subject("multires", "multiresolution splatting", multires(frame, settings)),
        Subject("naive", "the same lights, every pixel", full_sum(frame, settings)),
        Subject("gather", "gathering, 1024 samples", gather(frame, whole)),
        Subject("multires_bare", "multiresolution, no clamp", multires(frame, bare)),
        Subject("texels_clamped", "every texel, clamped", every_texel(frame, settings)),
        Subject("texels", "every texel, no clamp", every_texel(frame, bare)),
        Subject("equal", "every texel, equal solid angles", every_texel(frame, unclamped(equal)))]


def _traced(bench: "Workbench", frame: "Frame", visibility: bool) -> Array:
    from refgi.truth import TruthSettings, trace_truth

    settings = TruthSettings(samples=bench.scale.truth_samples, visibility=visibility)
    return bench.once(("one bounce", SCENE, visibility), lambda: trace_truth(frame, settings).mean)


def _ratio(frame: "Frame", subjects: list[Subject]) -> Picture:
    """Show what equal solid angles make of the light."""
    exact, equal = (luminance(s.irradiance) for name in ("texels", "equal") for s in subjects if s.name == name)
    ratio = np.divide(equal, exact, out=np.ones_like(exact), where=exact > 0)
    return pictures.mapped("equal_ratio", "equal over exact solid angles", "blue: too dim, red: too bright, up to 25 %",
                           ratio.astype(np.float32), frame.gbuffer.covered, Scale(0.75, 1.25, DIVERGING, "ratio"))


def solid_angle_ratios(frame: "Frame") -> tuple[tuple[str, float, float], ...]:
    """Return how much more than an equal share the texels in the middle and at the rim of a spot's cone subtend.

    Parameters
    ----------
    frame : Frame
        Its first light is a spot.

    Returns
    -------
    tuple of (where, here, closed form)
        Within its cone a texel's density of solid angle is cos^3, its mean 2 (1 - cos) / tan^2 of the half angle.
    """
    rsm = frame.rsms[0]
    light: Any = rsm.light
    cosine, tangent = math.cos(light.outer_half_angle), math.tan(light.outer_half_angle)
    middle = tangent**2 / (2 * (1 - cosine))
    exact, equal = rsm.solid_angle, with_equal_solid_angles(rsm).solid_angle
    lit = np.asarray(exact != equal)
    share = np.divide(exact, equal, out=np.ones_like(exact), where=lit)[lit]
    return (("in the middle", float(share.max()), middle), ("at the rim", float(share.min()), middle * cosine**3))


def _notes(near: Errors, clamp: Errors, solid: Any, against: dict[str, tuple[Errors, Errors]],
           lights: dict[str, Array], covered: Array) -> tuple[str, ...]:
    blocked = against["texels"][1].lost
    changed = errors_of(lights["equal"], lights["texels"], covered)
    return (
        f"The method differs from the same lights at every pixel by an RMSE of {near.rmse:.1f} % and a MAE of "
        f"{near.mae:.1f} % of the mean; the paper calls the two near indistinguishable.",
        f"The clamp loses {clamp.lost:.0f} % of the energy of every texel. That no clamp is needed with every texel "
        f"holds for how bright a single dot is, not for the sum: its RMSE to path tracing without visibility is "
        f"{against['texels'][0].rmse:.0f} % with a MAE of {against['texels'][0].mae:.1f} %, from pixels beside edges "
        "that the light's own texels touch.",
        f"None of these knows what blocks indirect light: every texel is {-blocked:.0f} % too bright for path tracing. "
        f"Of the paper's three differences the clamp makes {clamp.mae:.1f} % of the mean (MAE), equal solid angles "
        f"{changed.mae:.1f} %, visibility {against['texels'][1].mae:.1f} %.",
        f"Equal solid angles give a texel in the middle of the cone 1 / {solid[0][1]:.2f} of its light and one at the "
        f"rim 1 / {solid[1][1]:.2f}; indirect light changes by {changed.mae:.1f} % of the mean, dimmer where the "
        "spot's middle shines and brighter where its rim does. Exact solid angles are the default.",
    )
