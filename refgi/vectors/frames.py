"""A frame of a sequence as a case: the stages of the last of some scenes, with the light that those before it left.

What the frame before left is given: its filtered light and the frames counted in it. Its depths and normals are a stage
of the case (`rsm.surface0`) unless its triangles were elsewhere; then they are given too.
"""

import collections
import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from refgi.diagnostics import diagnosing
from refgi.frame import Frame
from refgi.methods import KeepingEstimate, find_method, usual_shadows
from refgi.rsm.raster.projection import Projection
from refgi.scene import Scene
from refgi.settings import flat
from refgi.sssil import temporal
from refgi.sssil.settings import TemporalSettings
from refgi.sssil.temporal_filter import history_of, with_frames
from refgi.types import Array
from refgi.vectors.recorded import VIEW, plain, recorded_case
from refgi.vectors.spec import Bug, Case, Stage, reading

WARP = "HSS Sec. 3.3: depth and normal decide whether it is the same surface (E-HSS-11)"


def frame_case(
    id: str, scenes: Sequence[Scene], method: str, settings: Any = None, filtering: TemporalSettings | None = None, *,
    only: str = "", what: str = "", **options: Any,
) -> Case:
    """Return the last frame of a sequence as a case; without a filter no frame before it counts.

    `scenes` are those of all its frames, from the first on; the rest as in `recorded_case`.
    """
    number, settings = len(scenes) - 1, find_method(method).settings() if settings is None else settings
    if filtering is None or number == 0:
        return recorded_case(id, scenes[-1], method, temporal.seeded(settings, number), only=only, what=what, **options)
    light = KeepingEstimate(find_method(method))
    options = {**options, "dtype": np.float64, "shadows": options.get("shadows") or usual_shadows(settings)}
    sequence = temporal.Sequence((), settings, filtering, method=light, lobes=light.lobes, **options)
    before = scenes[-2]
    with diagnosing(False):
        last = collections.deque(sequence.over(scenes[:-1]), maxlen=1).pop()
        own, = sequence.over([before], number - 1)
    left = with_frames((own if filtering.form == "printed" else last).irradiance, last.frames)

    def made() -> Array:
        seen = Frame(before, **options) if before.geometry is scenes[-1].geometry else last.frame
        frame, = sequence.over(scenes[-1:], number, history_of(seen, before.geometry, left))
        return frame.irradiance

    case = recorded_case(id, scenes[-1], method, settings, only=only, what=what, call=made)
    now = Frame(scenes[-1], **options).gbuffer.projection
    stages = tuple(_with_wrong_histories(step, now, own.irradiance) if step.name == "sssil.reprojection" else step
                   for step in case.stages)
    return dataclasses.replace(case, stages=stages, facts={**case.facts, "temporal": plain(flat(filtering))})


def _with_wrong_histories(step: Stage, now: Projection, own: Array) -> Stage:
    """Return the look-up in the frame before with likely bugs: this frame's camera `now`; that frame's `own` light."""
    wrong = {"this frame's camera in place of that of the frame before": {
        name: getattr(now, name.rpartition(".")[2]) for name in step.reads
        if "projection" in name and name.endswith(VIEW)},
        "the earlier frame's own light, as printed, not its filtered one": {
            name: own for name in step.reads if name.endswith(".irradiance")}}
    bugs = (Bug(cause, reading(step.run, **{
        name.replace(".", "__"): lambda a, one=one: np.asarray(one, a.dtype) for name, one in taken.items()}), WARP)
        for cause, taken in wrong.items())
    return dataclasses.replace(step, bugs=(*bugs, *step.bugs))
