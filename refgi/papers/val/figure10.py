"""Figure 10: more and more area lights, up to one for every light; beside it a ray to each light and path tracing."""

import time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.settings import ValSettings
from refgi.cluster.val import val
from refgi.papers import pictures
from refgi.papers.curves import Axes, Curve, drawn
from refgi.papers.judging import errors_of
from refgi.papers.records import Cell, Figure, Picture, Plot, Table
from refgi.papers.val.subjects import AREA_LIGHTS, HORSE, JUDGED, clamped, frame_of, published, settings_of, shadowed
from refgi.truth import TruthSettings, trace_truth

if TYPE_CHECKING:
    from refgi.frame import Frame
    from refgi.papers.workbench import Workbench

Array = npt.NDArray[Any]

SHOWN = (2, 4, 8, 16, AREA_LIGHTS)
FURTHER = (128, 512, 1024)
KINDS = {"csm": "CSM, 4 terms", "pcss": "PCSS", "hard": "one hard shadow"}
STEPS_TO = AREA_LIGHTS  # up to which PCSS, which reads every texel, is drawn


class Sweep(NamedTuple):
    """What each number of area lights came to, by kind of visibility."""

    rmse: dict[tuple[str, int], float]  # % of the mean, against a ray to each light
    truth: dict[int, float]  # MAE of the series against path tracing
    seconds: dict[int, float]  # of the series
    shown: dict[int, Array]


def figure10(bench: "Workbench") -> Figure:
    """Make Figure 10 again.

    Parameters
    ----------
    bench : Workbench
        Sizes, samples and frames.

    Returns
    -------
    Figure
        Pictures by number of area lights, the difference to exact shadows, and curves of the error.
    """
    frame, settings = frame_of(bench, HORSE, JUDGED), settings_of(bench)
    right = shadowed(bench, frame, settings, (HORSE, JUDGED))
    traced = trace_truth(frame, TruthSettings(samples=bench.scale.truth_samples)).mean
    covered = frame.gbuffer.covered
    vpl_off = errors_of(right, traced, covered).mae
    sweep = swept(bench, frame, right, traced)
    interleaved = val(frame, published(bench, frame.scene))
    off = errors_of(interleaved, val(frame, clamped(bench, frame.scene)), covered).mae
    counts = sorted(sweep.seconds)
    rows = tuple((str(m), *(sweep.rmse.get((kind, m)) for kind in KINDS), sweep.truth[m], 1e3 * sweep.seconds[m])
                 for m in counts)
    end: tuple[Cell, ...] = ("a ray to each light", 0.0, 0.0, 0.0, vpl_off, None)
    curves = [Curve(title, [m for m in counts if (kind, m) in sweep.rmse],
                    [sweep.rmse[kind, m] for m in counts if (kind, m) in sweep.rmse], kind == "hard")
              for kind, title in KINDS.items()]
    curves.append(Curve("series, MAE against path tracing", counts, [sweep.truth[m] for m in counts], True))
    return Figure(
        shows="With 2 to 30 area lights indirect light comes ever nearer to the picture with a hard shadow for every "
              "light and to path tracing; few already convince.",
        facts=(frame.scene.description, f"{frame.width}² pixels", f"{settings.lights} lights",
               f"path tracing with {bench.scale.truth_samples} samples a pixel"),
        pictures=_pictures(frame, settings, sweep, right, traced, interleaved), columns=5,
        tables=(Table("RMSE in % of the mean, by number of area lights",
                      ("area lights", *KINDS.values(), "series, MAE against path tracing", "ms, series"),
                      (*rows, end)),),
        plots=(Plot(drawn(curves, Axes("area lights", "RMSE, % of the mean", log_x=True, log_y=True)),
                    "Error against a ray to each light over the number of area lights."),),
        notes=_notes(sweep, counts, vpl_off, off))


def swept(bench: "Workbench", frame: "Frame", right: Array, traced: Array) -> Sweep:
    """Light the frame by more and more area lights.

    Parameters
    ----------
    bench : Workbench
        Sizes.
    frame : Frame
        The scene, seen and lit.
    right, traced : (3, h, w) ndarray
        Irradiance by a ray to each light, and by path tracing.

    Returns
    -------
    Sweep
        Errors, times and the pictures that are shown.
    """
    covered, most = frame.gbuffer.covered, settings_of(bench).lights
    found = Sweep({}, {}, {}, {})
    for m in (*SHOWN, *(n for n in FURTHER if SHOWN[-1] < n < most), most):
        for kind in KINDS if m <= STEPS_TO else ("csm", "hard") if m == most else ("csm",):
            started = time.perf_counter()
            light = val(frame, settings_of(bench, area_lights=m, visibility=kind))
            taken = time.perf_counter() - started
            found.rmse[kind, m] = errors_of(light, right, covered).rmse
            if kind == "csm":
                found.seconds[m] = taken
                found.truth[m] = errors_of(light, traced, covered).mae
                if m in SHOWN:
                    found.shown[m] = light
    return found


def _pictures(frame: "Frame", settings: ValSettings, sweep: Sweep, right: Array, traced: Array,
              interleaved: Array) -> tuple[Picture, ...]:
    covered = frame.gbuffer.covered
    exposure = pictures.exposure_of(right, covered)
    shown = [pictures.indirect(f"areas{m}", f"{m} area lights", f"RMSE {sweep.rmse['series', m]:.1f} %", light,
                               exposure) for m, light in sweep.shown.items()]
    shown += [pictures.indirect("rays", "a ray to each light", f"{settings.lights} lights", right, exposure),
              pictures.indirect("traced", "path tracing", "without pixel lights", traced, exposure),
              pictures.indirect("interleaved", f"{AREA_LIGHTS} area lights, interleaved", "8 x 8 and blurred",
                                interleaved, exposure),
              pictures.seen("seen", f"{AREA_LIGHTS} area lights", "with direct light", frame,
                            sweep.shown[AREA_LIGHTS])]
    made = {f"areas{AREA_LIGHTS}": (f"{AREA_LIGHTS} area lights", sweep.shown[AREA_LIGHTS])}
    return (*shown, *pictures.errors(made, right, covered))


def _notes(sweep: Sweep, counts: list[int], vpl_off: float, off: float) -> tuple[str, ...]:
    most = counts[-1]
    slope = float(np.polyfit(np.log(SHOWN), np.log([sweep.rmse["csm", m] for m in SHOWN]), 1)[0])
    return (
        f"From 2 to {AREA_LIGHTS} area lights the RMSE against a ray to each light falls from "
        f"{sweep.rmse['series', 2]:.1f} to {sweep.rmse['series', AREA_LIGHTS]:.1f} % of the mean, about as their "
        f"number to the {slope:.2f}. One hard shadow for each area light comes to "
        f"{sweep.rmse['hard', 2]:.1f} and {sweep.rmse['hard', AREA_LIGHTS]:.1f} %, and PCSS to "
        f"{sweep.rmse['pcss', 2]:.1f} and {sweep.rmse['pcss', AREA_LIGHTS]:.1f} %: what soft shadows gain in RMSE, the "
        "bias of four terms takes back the more, the smaller the area lights; what is left of their worth is that "
        "bands turn into gradients.",
        f"With {most} area lights it is {sweep.rmse['series', most]:.1f} %: each light is then its own area light "
        "without a size, one texel of a depth map is compared, and only the map's texels are left of the error. "
        "Between, clusters of two or three lights still have the series' bias, which does not shrink with them.",
        f"Against path tracing the MAE of the same lights with rays is {vpl_off:.1f} %, of {AREA_LIGHTS} area lights "
        f"{sweep.truth[AREA_LIGHTS]:.1f} %: the number of lights decides, not that of area lights. Bright dots where "
        "walls meet are lights next to a receiver; no distance is clamped here but for the interleaved picture.",
        f"Interleaved over 8 x 8 pixels and blurred, as the paper's pictures, {AREA_LIGHTS} area lights are another "
        f"{off:.1f} % (MAE) off what they come to without.")
