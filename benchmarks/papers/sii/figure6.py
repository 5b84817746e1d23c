"""Figure 6: a thousand lights, splatted without visibility and ray-traced with it."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.judging import Errors, errors_of
from benchmarks.papers.records import Figure, Table
from refgi.lights.selection import choose_lights
from refgi.splat import SiiSettings, sii

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.frame import Frame

Array = npt.NDArray[Any]

SCENE = "cornell_box"
LIGHTS = 1000
TITLES = {"walk": "quasi-random walk", "rsm": "shadow map"}


def figure6(bench: "Workbench") -> Figure:
    """Make Figure 6 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and frames.

    Returns
    -------
    Figure
        Lights of a walk and of the shadow map, splatted and with shadow rays, and path tracing.
    """
    from refgi.truth import TruthSettings, trace_truth

    half = bench.scale.size // 2  # a shadow ray for each of 1000 lights at each pixel
    frame = bench.frame(SCENE, width=half, height=half)
    covered = frame.gbuffer.covered
    truth = trace_truth(frame, TruthSettings(samples=bench.scale.truth_samples)).mean
    shown, rows, blocked, noise = [], [], {}, {}
    for source, title in TITLES.items():
        settings = SiiSettings(lights=LIGHTS, source=source, i_low=0.0)  # type: ignore[arg-type]
        splatted, shadowed = sii(frame, settings), _instant_radiosity(frame, settings)
        blocked[source] = errors_of(splatted, shadowed, covered)
        noise[source] = errors_of(shadowed, truth, covered)
        shown += [
            pictures.seen(f"{source}_sii", f"SII, lights of the {title}",
                          f"RMSE to instant radiosity {blocked[source].rmse:.0f} %", frame, splatted, settings),
            pictures.seen(f"{source}_vpl", f"Instant radiosity, {title}", "a shadow ray for each light and pixel",
                          frame, shadowed, settings)]
        rows += [(f"SII, {title}", *blocked[source], *errors_of(splatted, truth, covered)),
                 (f"instant radiosity, {title}", None, None, None, *noise[source])]
    shown.append(pictures.seen("truth", "Path tracing", "one bounce", frame, truth))
    columns = ("", "RMSE to instant radiosity", "MAE", "darker by", "RMSE to path tracing", "MAE", "darker by")
    return Figure(
        shows="Splatting beside instant radiosity in a ray tracer, both with 1000 lights of a quasi-random walk: the "
              "latter has soft shadows of indirect light, yet the results are comparable.",
        facts=(SCENE, f"{half} by {half} pixels", f"{LIGHTS} lights, one bounce, no cut"), pictures=tuple(shown),
        columns=5, tables=(Table("Errors, in % of the mean irradiance", columns, tuple(rows)),),
        notes=_notes(blocked["walk"], noise))


def _notes(blocked: Errors, noise: dict[str, Errors]) -> tuple[str, ...]:
    return (
        f"Comparable, as the paper says: splatting does not know what blocks indirect light and is {-blocked.lost:.0f} "
        f"% too bright for it (MAE {blocked.mae:.0f} %), most of all behind and between the blocks.",
        f"A thousand lights have noise of their own: with shadow rays their MAE to path tracing is "
        f"{noise['walk'].mae:.0f} % for those of the walk and {noise['rsm'].mae:.0f} % for those of the shadow map. "
        "Where an RMSE is many times its MAE, a light lies next to an edge and outshines a few pixels beside it.",
    )


def _instant_radiosity(frame: "Frame", settings: SiiSettings) -> Array:
    from refgi.shadowed import receivers, shadowed_sum

    buffer, light = frame.gbuffer, np.zeros((3, frame.height, frame.width), frame.dtype)
    to = receivers(frame.scene.geometry, buffer.position, buffer.normal, buffer.triangle_id, frame.tracer.grain)
    light.reshape(3, -1)[:, to.pixel] = shadowed_sum(frame.tracer, to, choose_lights(frame, settings))
    return light
