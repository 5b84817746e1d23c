"""Figure 4: the soft shadows of a small and of a larger area light."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.judging import errors_of
from benchmarks.papers.records import Figure, Picture, Table
from benchmarks.papers.timing import interleaved
from benchmarks.papers.val.lamps import Lamp, View, frame_of_lamp, one_cluster
from benchmarks.papers.val.lit import lit
from benchmarks.papers.val.subjects import JUDGED, rays_to, settings_of

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

Array = npt.NDArray[Any]

EYE, TARGET = (1.3, 2.4, 3.9), (0.05, 0.55, 0.0)
VIEWS = (View("small", "small area light", Lamp((0.5, 2.9, 0.5), (0.0, -1.0, 0.0), 0.15), "body", EYE, TARGET),
         View("large", "larger area light", Lamp((0.5, 2.9, 0.5), (0.0, -1.0, 0.0), 0.8), "body", EYE, TARGET))
PAPER_FPS = 200.0  # "more than"


def figure4(bench: "Workbench") -> Figure:
    """Make Figure 4 again.

    Parameters
    ----------
    bench : Workbench
        Sizes.

    Returns
    -------
    Figure
        Both shadows, beside a ray to each light of each lamp, their errors and times.
    """
    settings = settings_of(bench)
    frames = {view.name: frame_of_lamp(bench, view, JUDGED) for view in VIEWS}
    found = {view.name: one_cluster(view, settings, frames[view.name].scene.geometry.diagonal) for view in VIEWS}
    seconds = interleaved({name: partial(lit, frames[name], found[name], settings) for name in frames},
                          bench.scale.repeats)
    shown: list[Picture] = []
    rows = []
    for view in VIEWS:
        frame = frames[view.name]
        right, light = rays_to(frame, found[view.name].lights), lit(frame, found[view.name], settings)
        covered = frame.gbuffer.covered
        off, exposure = errors_of(light, right, covered), pictures.exposure_of(right, covered)
        shown += [pictures.indirect(view.name, view.title, f"RMSE {off.rmse:.1f} %", light, exposure, settings),
                  pictures.indirect(f"{view.name}_rays", f"{view.title}, by rays", "a ray to each of its lights",
                                    right.astype(np.float32), exposure)]
        rows.append((view.title, view.lamp.side, float(found[view.name].areas.delta[0]), *off, 1e3 * seconds[view.name],
                     1 / seconds[view.name], PAPER_FPS))
    return Figure(
        shows="Soft shadows by parabolic convolution soft shadow maps, of a small area light and of a larger one, with "
              "more than 200 frames per second.",
        facts=("the four-legged body on a floor", f"{frames['small'].scene.face_count} faces",
               f"{frames['small'].width}² pixels", f"map of {settings.map_resolution}² texels"),
        pictures=tuple(shown), columns=4,
        tables=(Table("Size of the lamp and of its area light; error against rays in % of the mean; map and light",
                      ("", "side, m", "area light, m", "RMSE", "MAE", "darker by", "ms", "fps", "fps, paper"),
                      tuple(rows), frozenset({8})),),
        notes=(f"The shadow of the larger light is wider and softer, as in the paper. Against rays the pictures are "
               f"{rows[0][3]:.1f} and {rows[1][3]:.1f} % of the mean off, most of it where feet touch the floor: the "
               "bias of four terms lets light through next to a blocker.",
               f"Map, filters and light of one lamp take {rows[0][6]:.0f} and {rows[1][6]:.0f} ms; the paper draws "
               "more than 200 a second on a graphics processor, at a size it does not give."))
