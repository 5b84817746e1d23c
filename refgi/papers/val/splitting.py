"""Beyond the paper: what each of its approximations costs, scene by scene."""

from typing import TYPE_CHECKING

from refgi.cluster.reference.split import ErrorSplit, Step, split_error
from refgi.papers import pictures
from refgi.papers.records import Cell, Figure, Picture, Table
from refgi.papers.val.subjects import ATRIUM, BLOB, BOX, HORSE, MOVING, clamped, frame_of, scene_of
from refgi.truth import TruthSettings, trace_truth

if TYPE_CHECKING:
    from refgi.papers.workbench import Workbench

TITLES = {BOX: "Cornell Box", HORSE: "Cornell Horse", ATRIUM: "Sponza", BLOB: "Metaballs"}
STEPS = {"lights": "pixel lights for all light, near ones clamped", "rays_vpls": "clusters: the share of lights seen",
         "rays_rectangle": "their bounding rectangle", "back_projection": "one map from its centre, projected back",
         "pcss": "one mean blocker, one disc", "csm": "series of 4 terms",
         "mip": "mip levels for discs", "interleaved": "interleaving and blur"}
SIZE = MOVING / 2  # pixels a side in units of the run's: references are slow
METHOD = tuple(STEPS)[1:-1]  # what stands between exact shadows and the full sum
SHOWN = ("lights", "rays_vpls", "pcss", "mip")


def splitting(bench: "Workbench") -> Figure:
    """Split the error of each scene of Table 1.

    Parameters
    ----------
    bench : Workbench
        Sizes and samples.

    Returns
    -------
    Figure
        What each approximation changes, in what sense, and what they come to together.
    """
    found = {name: _split(bench, name) for name in TITLES}
    changed: list[tuple[Cell, ...]] = [
        (title, *(100 * _step(one, step).rmse for one in found.values()),
         *(100 * _step(one, step).shift for one in found.values())) for step, title in STEPS.items()]
    ends: list[tuple[Cell, ...]] = [
        ("all together", *(100 * one.whole for one in found.values()),
         *(100 * sum(step.shift for step in one.steps) for one in found.values())),
        ("if they were independent", *(100 * one.root_of_squares for one in found.values()), *(None for _ in found))]
    scene = scene_of(bench, HORSE)
    size = frame_of(bench, HORSE, SIZE).width
    return Figure(
        shows="The paper has no such table: it shows the difference to a hard shadow for every light, in one picture.",
        facts=(f"{size}² pixels", f"path tracing with {bench.scale.truth_samples} samples a pixel",
               f"{clamped(bench, scene).lights} lights", f"{clamped(bench, scene).area_lights} area lights"),
        pictures=_pictures(bench, found[HORSE]), columns=4,
        tables=(Table("What each approximation changes in the picture before it, in % of the mean: root mean square, "
                      "and change of the mean", ("", *(f"{title}, RMS" for title in TITLES.values()),
                                                 *(f"{title}, mean" for title in TITLES.values())),
                      (*changed, *ends)),),
        notes=_notes(found))


def _split(bench: "Workbench", name: str) -> ErrorSplit:
    frame = frame_of(bench, name, SIZE)
    traced = trace_truth(frame, TruthSettings(samples=bench.scale.truth_samples)).mean
    return split_error(frame, clamped(bench, scene_of(bench, name)), traced)


def _step(found: ErrorSplit, name: str) -> Step:
    return next(step for step in found.steps if step.name == name)


def _pictures(bench: "Workbench", found: ErrorSplit) -> tuple[Picture, ...]:
    covered = frame_of(bench, HORSE, SIZE).gbuffer.covered
    made = {name: (STEPS[name], found.pictures[name]) for name in SHOWN[1:]}
    exposure = pictures.exposure_of(found.pictures["lights"], covered)
    shown = [pictures.indirect("lights", "a ray to each light", "Cornell Horse", found.pictures["lights"], exposure)]
    return (*shown, *pictures.errors(made, found.pictures["lights"], covered))


def _notes(found: dict[str, ErrorSplit]) -> tuple[str, ...]:
    def largest(name: str) -> str:
        step = max(METHOD, key=lambda key: _step(found[name], key).rmse)
        return f"{TITLES[name]} {STEPS[step]} ({100 * _step(found[name], step).rmse:.1f} %)"

    parts = [(one.whole, one.root_of_squares) for one in found.values()]
    sampled = ", ".join(f"{100 * _step(one, 'lights').rmse:.1f}" for one in found.values())
    return (
        f"Of the steps between exact shadows and the full sum the largest is: {'; '.join(map(largest, found))}.",
        f"Against path tracing the pixel lights themselves are {sampled} % off, interleaving and its blur change "
        f"{', '.join(f'{100 * one.steps[-1].rmse:.1f}' for one in found.values())} %: visibility by area lights is not "
        "what limits such a picture, as the paper claims.",
        "Errors of the steps partly cancel: together they come to "
        f"{', '.join(f'{100 * whole:.1f}' for whole, _ in parts)} %, and would to "
        f"{', '.join(f'{100 * apart:.1f}' for _, apart in parts)} % if they were independent.")
