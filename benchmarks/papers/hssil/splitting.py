"""Beyond the paper: which of its approximations costs how much, from path tracing to the published picture."""

import dataclasses
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.hssil.references import doubt, expected_light, mean_of, traced
from benchmarks.papers.hssil.subjects import (
    BOX,
    HALL,
    HORSE,
    JUDGED,
    TITLES,
    every_pixel,
    every_texel,
    frame_of,
    lit,
    smaller,
)
from benchmarks.papers.judging import errors_of
from benchmarks.papers.records import Cell, Figure, Picture, Table
from refgi.sssil import HssilSettings

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.frame import Frame

Array = npt.NDArray[Any]

SCENES = (BOX, HORSE, HALL)
# each step from the picture before it; the first is path tracing of all light
STEPS = {"truth": "path tracing", "seen": "only what the camera sees shines", "open": "nothing blocks (v = 1)",
         "pixels": "a pixel is a point (Eq. 3)", "discs": "a pixel is a disc (Eq. 4)",
         "levels": "levels, averaged", "closest": "the closest of four for their average",
         "reach": "the paper's reach", "start": "from half resolution on",
         "samples": "64 samples a level"}
SHOWN = ("seen", "open", "discs", "levels", "closest", "reach", "samples")
FRAMES = "the mean of 19 frames"  # the temporal filter with a = 0.9 takes away as much noise


class Variant(NamedTuple):
    """The published picture but for one thing."""

    title: str
    changes: dict[str, Any]


VARIANTS = (
    Variant("as published", {}), Variant("from full resolution on, as far", {"start": "full", "further": 1}),
    Variant("from quarter resolution on, as far", {"start": "quarter", "further": -1}),
    Variant("a level more", {"further": 1}), Variant("16 samples", {"samples": 16}),
    Variant("256 samples", {"samples": 256}), Variant("every texel", {"pattern": "all"}), Variant(FRAMES, {}),
    Variant("every pixel its own samples", {"pattern": "pixel"}),
    Variant("levels averaged", {"downsample": "average"}),
    Variant("closest, average radiance", {"downsample": "closest_average"}),
    Variant("bilinear upsampling", {"upsampling": "bilinear"}),
    Variant("nearest upsampling", {"upsampling": "nearest"}),
    Variant("Eq. 3", {"form_factor": "point"}), Variant("bitmask", {"visibility": "bitmask"}),
    Variant("rays", {"visibility": "rays"}))


class Split(NamedTuple):
    """One scene from step to step."""

    made: dict[str, Array]  # by the keys of STEPS
    variants: dict[str, Array]
    covered: Array
    noise: float  # standard error of path tracing of all light, % of the mean


def splitting(bench: "Workbench") -> Figure:
    """Split the error of each scene.

    Parameters
    ----------
    bench : Workbench
        Sizes and samples.

    Returns
    -------
    Figure
        What each approximation changes, and the published picture with one thing changed at a time.
    """
    found = {name: _split(bench, name) for name in SCENES}
    frame = frame_of(bench, HORSE, JUDGED)
    return Figure(
        shows="The paper says that its picture may be heavily biased, by what is not seen and by v = 1, and gives no "
              "figures.",
        facts=(f"{frame.width}² pixels", f"path tracing with {bench.scale.truth_samples} samples a pixel",
               f"{smaller(frame).levels} levels of half resolution, a radius of {smaller(frame).radius:.3g}: texels as "
               "small beside their distance, and as much of the picture, as by the paper's settings at 1280 x 720"),
        pictures=_pictures(found[HORSE]), columns=4,
        tables=(Table("What each approximation changes in the picture before it, in % of the mean of path tracing: "
                      "root mean square, and change of the mean",
                      ("", *(f"{TITLES[name]}, RMS" for name in SCENES), *(f"{TITLES[name]}, mean" for name in SCENES)),
                      tuple(_changes(found))),
                Table("The published picture with one thing changed: RMSE in % of the mean, against path tracing in "
                      "which only what the camera sees shines, without and with what blocks",
                      ("", *(f"{TITLES[name]}, {what}" for name in SCENES for what in ("v = 1", "with v"))),
                      tuple(_variants(found)))),
        notes=_notes(found))


def chain(frame: "Frame") -> dict[str, HssilSettings]:
    """Return settings from every pixel lighting every pixel to the published ones.

    Parameters
    ----------
    frame : Frame
        Says how large the picture is.

    Returns
    -------
    dict of str to HssilSettings
        By the keys of `STEPS`, each with one thing changed from the one before.
    """
    published = smaller(frame)
    discs = every_pixel(published)
    levels = dataclasses.replace(discs, levels=published.levels + 2, downsample="average")
    closest = dataclasses.replace(levels, downsample="closest")
    reach = every_texel(published, start="full", levels=published.levels + 1)
    return {"pixels": dataclasses.replace(discs, form_factor="point"), "discs": discs, "levels": levels,
            "closest": closest, "reach": reach, "start": every_texel(published), "samples": published}


def _split(bench: "Workbench", name: str) -> Split:
    frame = frame_of(bench, name, JUDGED)
    made = {"truth": traced(bench, frame, (name, JUDGED)),
            "seen": traced(bench, frame, (name, JUDGED), emitters="seen"),
            "open": traced(bench, frame, (name, JUDGED), emitters="seen", visibility=False)}
    made |= {key: lit(frame, settings) for key, settings in chain(frame).items()}
    variants = {one.title: lit(frame, smaller(frame, **one.changes)) for one in VARIANTS if one.title != FRAMES}
    variants[FRAMES] = expected_light(frame, smaller(frame), 19)
    return Split(made, variants, frame.gbuffer.covered, doubt(bench, frame, (name, JUDGED)))


def _changes(found: dict[str, Split]) -> list[tuple[Cell, ...]]:
    rows: list[tuple[Cell, ...]] = []
    for before, after in pairwise(STEPS):
        off = [_step(one, before, after) for one in found.values()]
        rows.append((STEPS[after], *(rms for rms, _ in off), *(mean for _, mean in off)))
    ends = [_step(one, "truth", "samples") for one in found.values()]
    return [*rows, ("all together", *(rms for rms, _ in ends), *(mean for _, mean in ends))]


def _step(one: Split, before: str, after: str) -> tuple[float, float]:
    """Return the root mean square and the mean of what a step changes, in % of the mean of path tracing."""
    covered = one.covered
    off = errors_of(one.made[after], one.made[before], covered)
    share = mean_of(one.made[before], covered) / max(mean_of(one.made["truth"], covered), 1e-30)
    return off.rmse * share, -off.lost * share


def _variants(found: dict[str, Split]) -> list[tuple[Cell, ...]]:
    return [(one.title, *(errors_of(split.variants[one.title], split.made[key], split.covered).rmse
                          for split in found.values() for key in ("open", "seen"))) for one in VARIANTS]


def _pictures(one: Split) -> tuple[Picture, ...]:
    exposure = pictures.exposure_of(one.made["truth"], one.covered)
    shown = [pictures.indirect("truth", STEPS["truth"], TITLES[HORSE], one.made["truth"], exposure)]
    shown += [pictures.indirect(key, STEPS[key], f"changes {_step(one, _before(key), key)[0]:.1f} %", one.made[key],
                                exposure) for key in SHOWN]
    return tuple(shown)


def _before(key: str) -> str:
    keys = list(STEPS)
    return keys[keys.index(key) - 1]


def _notes(found: dict[str, Split]) -> tuple[str, ...]:
    def each(key: str) -> str:
        return ", ".join(f"{_step(one, _before(key), key)[0]:.1f}" for one in found.values())

    def largest(name: str) -> str:
        key = max(list(STEPS)[1:], key=lambda step: _step(found[name], _before(step), step)[0])
        return f"{TITLES[name]}: {STEPS[key]} ({_step(found[name], _before(key), key)[0]:.0f} %)"

    whole = ", ".join(f"{_step(one, 'truth', 'samples')[0]:.0f}" for one in found.values())
    return (
        f"The largest step is: {'; '.join(map(largest, found))}. What the camera does not see is worth {each('seen')} "
        f"%, v = 1 {each('open')} %: the two that the paper names. They have opposite signs.",
        f"Pixels for surfaces cost {each('pixels')} %, discs for points {each('discs')} %, levels {each('levels')} %, "
        f"the closest of four instead of their average {each('closest')} %, the radius {each('reach')} %, half "
        f"resolution {each('start')} %, and 64 samples {each('samples')} %. The mean of "
        "19 frames, which has as little noise as the temporal filter leaves, shows what remains of the last.",
        f"Together they come to {whole} % of the mean. Path tracing's own standard error, "
        f"{', '.join(f'{one.noise:.1f}' for one in found.values())} %, is part of the first three.")
