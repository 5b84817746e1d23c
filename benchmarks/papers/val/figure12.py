"""Figure 12: a blob whose pieces join and part, cut anew from its field in every frame."""

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from benchmarks.papers import pictures
from benchmarks.papers.records import Figure, Table
from benchmarks.papers.subjects import seen_by
from benchmarks.papers.timing import interleaved
from benchmarks.papers.val.scenes import blob_at
from benchmarks.papers.val.sequence import frame_count, note, sequence, table
from benchmarks.papers.val.subjects import drawing, published, rounds
from refgi.cluster.val import val

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.scene import Scene

TIMES = (0.0, 0.15, 0.3)
STEP = 0.01  # of the motion's period, from frame to frame
WALLS = 4  # pieces of the scene that are not the blob's
PAPER_FPS, PAPER_FACES = 20.7, 5.1e3


def figure12(bench: "Workbench") -> Figure:
    """Make Figure 12 again.

    Parameters
    ----------
    bench : Workbench
        Sizes.

    Returns
    -------
    Figure
        Pictures at several times, pieces and faces, time of a frame, and how steady the picture is.
    """
    settings = published(bench, blob_at(0.0))
    views = [seen_by(bench, blob_at(t)) for t in TIMES]
    counts = [pieces(frame.scene) for frame in views]
    shown = tuple(pictures.seen(f"at{100 * t:.0f}", f"t = {t:g}", f"{count} pieces, {frame.scene.face_count} faces",
                                frame, val(frame, settings), settings)
                  for t, frame, count in zip(TIMES, views, counts, strict=True))
    seconds = interleaved({str(t): drawing(bench, blob_at(t), settings) for t in TIMES}, max(1, rounds(bench) - 1))
    moving = sequence(bench, blob_at, STEP * (frame_count(bench) - 1))
    rates = [1 / seconds[str(t)] for t in TIMES]
    rows = tuple((f"t = {t:g}", count, frame.scene.face_count, 1e3 * seconds[str(t)], 1 / seconds[str(t)], PAPER_FPS)
                 for t, frame, count in zip(TIMES, views, counts, strict=True))
    return Figure(
        shows="Global illumination of an iso-surface of 5.1 thousand faces that changes its topology, at 20.7 frames "
              "per second.",
        facts=(views[0].scene.description, f"{len(moving.frames)} frames, a hundredth of a period apart",
               f"steadiness at {moving.frames[0].width}²"),
        pictures=shown, columns=3,
        tables=(Table("Pieces, faces and whole frames", ("", "pieces", "faces", "ms", "fps", "fps, paper"), rows,
                      frozenset({5})), table(moving)),
        notes=(f"The blob falls into {min(counts)} to {max(counts)} pieces and has {min(row[2] for row in rows)} to "
               f"{max(row[2] for row in rows)} faces with the stage's; frames come at {min(rates):.1f} to "
               f"{max(rates):.1f} a second, whatever hangs together: nothing is prepared for a shape. Cutting the "
               "surface from its field is not in the time, nor in the paper's.",
               note(moving)))


def pieces(scene: "Scene") -> int:
    """Return how many pieces the blob has.

    Parameters
    ----------
    scene : Scene
        The blob over its stage.

    Returns
    -------
    int
        Parts of its surface that hang together.
    """
    faces: Any = scene.geometry.faces
    count = len(scene.geometry.vertices)
    first, second = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    joined = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(count, count))
    label = connected_components(joined, directed=False)[1]
    return len(np.unique(label[faces[:, 0]])) - WALLS
