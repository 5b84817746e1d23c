"""Figure 11: bodies that walk through an atrium of 100 thousand faces in all."""

from typing import TYPE_CHECKING

from benchmarks.papers import pictures
from benchmarks.papers.records import Bar, Figure, Ratios
from benchmarks.papers.subjects import seen_by
from benchmarks.papers.timing import interleaved
from benchmarks.papers.val.scenes import march
from benchmarks.papers.val.sequence import RESTARTED, frame_count, note, sequence, table
from benchmarks.papers.val.subjects import AREA_LIGHTS, ATRIUM, MARCH, drawing, published, rounds, scene_of
from refgi.cluster.val import val

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

TIMES = (0.0, 1.0)
STEP = 0.04  # of the way, from frame to frame: 8 cm
PAPER_FPS = {"moving bodies": 14.0, "still": 13.4}  # Sponza alone: Table 1


def figure11(bench: "Workbench") -> Figure:
    """Make Figure 11 again.

    Parameters
    ----------
    bench : Workbench
        Sizes.

    Returns
    -------
    Figure
        Pictures along the way, time of a frame, and how steady the picture is.
    """
    settings = published(bench, scene_of(bench, MARCH))
    views = [(t, seen_by(bench, march(t))) for t in TIMES]
    shown = [pictures.seen(f"at{100 * t:.0f}", f"at {t:g} of the way", f"{frame.scene.face_count} faces", frame,
                           val(frame, settings), settings) for t, frame in views]
    _, last = views[-1]
    light = val(last, settings)
    shown.append(pictures.indirect("indirect", "indirect light at the end", "8 x 8 pixels interleaved, blurred", light,
                                   pictures.exposure_of(light, last.gbuffer.covered)))
    seconds = interleaved({"moving bodies": drawing(bench, scene_of(bench, MARCH), settings),
                           "still": drawing(bench, scene_of(bench, ATRIUM), settings)}, rounds(bench))
    moving = sequence(bench, march, STEP * (frame_count(bench) - 1))
    return Figure(
        shows="Several animated dragons in Sponza, 100 thousand faces in all, at 14 frames per second; light that "
              "bounces off the back wall dominates.",
        facts=(scene_of(bench, MARCH).description, f"{last.scene.face_count} faces", f"{len(moving.frames)} frames, "
               "8 cm of the way apart", f"steadiness at {moving.frames[0].width}²"),
        pictures=tuple(shown), columns=3,
        ratios=(Ratios("frames per second, relative to the atrium of Table 1", tuple(
            Bar(name, seconds["still"] / seconds[name], fps / PAPER_FPS["still"])
            for name, fps in PAPER_FPS.items())),),
        tables=(table(moving),),
        notes=(f"Whole frames take {1e3 * seconds['moving bodies']:.0f} ms, {1 / seconds['moving bodies']:.1f} a "
               "second, the paper's 14: nothing is kept from frame to frame, so bodies that move cost what bodies "
               "that rest do, there and here.",
               note(moving),
               f"The MAE against rays is {moving.ways[RESTARTED].mae:.0f} % of the mean here: with {AREA_LIGHTS} area "
               "lights in a hall of 30 m each is metres wide, and its rectangle reaches where it has no lights.",
               "Two four-legged bodies stand in for the dragons and the built-in atrium for Sponza, so only ratios "
               "and the look can be compared, not the pictures themselves."))
