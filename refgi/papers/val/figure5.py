"""Figure 5: what soft shadows from one filtered map do wrong, and which part of the method does it."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.papers import pictures
from refgi.papers.judging import errors_of
from refgi.papers.records import Figure, Picture, Table
from refgi.papers.val.lamps import Lamp, View, frame_of_lamp, one_cluster
from refgi.papers.val.lit import lit
from refgi.papers.val.subjects import SMALL, rays_to, settings_of

if TYPE_CHECKING:
    from refgi.papers.workbench import Workbench

Array = npt.NDArray[Any]

VIEWS = (View("huge", "very large light", Lamp((0.3, 2.7, 0.3), (0.0, -1.0, 0.0), 3.0), "body", (1.3, 2.4, 3.9),
              (0.05, 0.55, 0.0)),
         View("grazing", "large light at a grazing angle", Lamp((0.0, 1.1, 1.8), (0.0, 0.0, -1.0), 1.6), "board",
              (1.6, 2.2, 1.6), (0.0, 0.1, -0.6)),
         View("contact", "contact, from near", Lamp((0.5, 2.9, 0.5), (0.0, -1.0, 0.0), 0.8), "body", (0.9, 0.5, 1.3),
              (0.25, 0.12, 0.0)))
WAYS: dict[str, dict[str, Any]] = {
    "as published: 4 terms, mip": {}, "4 terms, every texel": {"prefilter": "brute"},
    "16 terms, every texel": {"prefilter": "brute", "terms": 16},
    "PCSS": {"visibility": "pcss"}, "one hard shadow": {"visibility": "hard"}}
PUBLISHED, STEP = "as published: 4 terms, mip", "PCSS"


def figure5(bench: "Workbench") -> Figure:
    """Make Figure 5 again.

    Parameters
    ----------
    bench : Workbench
        Sizes.

    Returns
    -------
    Figure
        Failing shadows beside true ones, and their errors with parts of the method replaced.
    """
    shown: list[Picture] = []
    rmse: dict[str, list[float]] = {way: [] for way in WAYS}
    for view in VIEWS:
        frame = frame_of_lamp(bench, view, SMALL)
        covered, made = frame.gbuffer.covered, {}
        for way, changes in WAYS.items():
            settings = settings_of(bench, **changes)
            found = one_cluster(view, settings, frame.scene.geometry.diagonal)
            made[way] = lit(frame, found, settings)
        right = rays_to(frame, found.lights).astype(np.float32)
        for way, light in made.items():
            rmse[way].append(errors_of(light, right, covered).rmse)
        exposure = pictures.exposure_of(right, covered)
        shown += [pictures.indirect(f"{view.name}_published", view.title, f"RMSE {rmse[PUBLISHED][-1]:.1f} %",
                                    made[PUBLISHED], exposure),
                  pictures.indirect(f"{view.name}_rays", f"{view.title}, by rays", "what is right", right, exposure),
                  *pictures.errors({f"{view.name}_published": (view.title, made[PUBLISHED])}, right, covered),
                  pictures.indirect(f"{view.name}_step", f"{view.title}, PCSS", f"RMSE {rmse[STEP][-1]:.1f} %",
                                    made[STEP], exposure)]
    return Figure(
        shows="Limitations: ringing for very large senders, curved penumbras at a grazing angle of a large sender, "
              "light that leaks where bodies touch, steps of the mip levels.",
        facts=("one lamp, one map", f"{frame.width}² pixels", f"map of {settings.map_resolution}² texels"),
        pictures=tuple(shown), columns=4,
        tables=(Table("RMSE against rays in % of the mean, with parts of the method replaced",
                      ("", *(view.title for view in VIEWS)), tuple((way, *off) for way, off in rmse.items())),),
        notes=_notes(rmse))


def _notes(rmse: dict[str, list[float]]) -> tuple[str, ...]:
    def said(way: str) -> str:
        return ", ".join(f"{value:.1f}" for value in rmse[way]) + " %"

    return (
        f"The three pictures are {said(PUBLISHED)} off as published. Every texel of the disc, which knows no steps "
        f"between mip levels, comes to {said('4 terms, every texel')}.",
        f"Sixteen terms, whose bias is a quarter, come to {said('16 terms, every texel')}; PCSS, with the "
        f"receiver's plane and the cone towards the light, to {said(STEP)}. One hard shadow comes to "
        f"{said('one hard shadow')}.",
        "What is left with PCSS is the method's one mean depth of blockers and its round filter for a square "
        "light; next to contacts the published series lets light through where PCSS does not, as the paper says "
        "of its own.")
