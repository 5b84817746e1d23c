"""`refgi check`: judge a finished picture of a port against a method of refgi, or against the truth."""

import math
from pathlib import Path
from typing import Any

import click

from refgi.cli.options import machine, seen, shadows, speech
from refgi.cli.session import DONE, FAILED, Session, progress
from refgi.cli.settings import preset

INDIRECT = "irradiance."  # channels that hold it begin with that


@click.command("check")
@click.argument("picture")
@click.option("--against", "against", required=True, metavar="SCENE", help="The scene that the picture shows.")
@click.option("--layer", metavar="NAME", help="What its channels' names begin with, such as ViewLayer.Combined.")
@click.option("--part", metavar="NAME", help="Name or number of its part in a file of several.")
@seen
@click.option("--method", default="truth", show_default=True, help="What it is judged by; `refgi info` lists methods.")
@preset
@click.option("--set", "pairs", multiple=True, metavar="KEY=VALUE", help="A setting of the method; repeatable.")
@click.option("--tolerance", type=click.FloatRange(0, 10), default=0.01, show_default=True,
              help="Largest RMSE above the noise, as a share of the mean.")
@machine
@shadows("auto")
@speech
@click.pass_obj
def _check(
    session: Session, /, picture: str, against: str, layer: str | None, part: str | None, method: str, preset: str,
    pairs: tuple[str, ...], tolerance: float, dtype: str, rsm_resolution: int, shadows: str | None,
    threads: int | None, seed: int | None, **options: Any,
) -> int:
    """Judge a port's PICTURE by a method on SCENE.

    PICTURE is an EXR of linear values.

    Channels irradiance.R, .G, .B are compared with indirect irradiance (W/m^2), else R, G, B with radiance. The scene
    is rendered at the size of the picture's display window; of a crop its own pixels are compared, overscan is cut.

    Exit codes: 0 within the tolerance or the noise, 1 not, or by a truth whose error is not to be trusted.
    """
    from refgi import stages
    from refgi.cli.options import on_threads
    from refgi.cli.settings import settings_for
    from refgi.cli.view import View, require_memory
    from refgi.cli.warm import warm_up
    from refgi.errors import expect
    from refgi.image.picture import read_colour
    from refgi.methods import render
    from refgi.truth.result import doubt_of_both
    from refgi.vectors.judge import judge_picture

    found = read_colour(Path(picture), (INDIRECT, ""), layer, part)
    kind = "indirect irradiance" if INDIRECT in found.names[0] else "radiance"
    settings = settings_for(method, pairs, seed, preset)
    size = found.size
    expect(options["size"] in (None, size), "--size", f"{size[0]}x{size[1]} as the picture", options["size"])
    scene = View(scene=against, **{**options, "size": size}).load()
    require_memory(scene, dtype, rsm_resolution, traced=method == "truth", settings={method: settings})
    with progress() as tell:
        warm_up([method], dtype, tell)
    with on_threads(threads), progress() as tell, stages.observe(progress=tell):
        made = render(scene, method, settings, dtype=dtype, rsm_resolution=rsm_resolution, shadows=shadows)
    variance = None if made.estimate is None else made.estimate.variance_of_mean
    if kind == "radiance" and variance is not None:
        variance = variance * (made.frame.gbuffer.albedo / math.pi) ** 2  # L = albedo / pi E
    pixels = (slice(None), found.rows, found.columns)
    right = made.radiance if kind == "radiance" else made.irradiance
    verdict = judge_picture(found.planes, right[pixels], None if variance is None else variance[pixels],
                            tolerance=tolerance)
    lobes = made.lobe_estimate if kind == "radiance" else None
    doubt = "" if made.estimate is None else doubt_of_both(made.estimate, lobes)
    what = "is not" if not verdict.close else "is not known to be" if doubt else "is"
    lines = [f"{picture}: {kind} {what} that of {scene.name} by {method}", f"{verdict.said}{found.part_said}",
             *([f"{method}: {doubt}"] if doubt else []), *(f"likely: {one}" for one in verdict.causes)]
    session.result("\n".join(lines), {"picture": picture, "scene": scene.name, "method": method, "compared": kind,
                                      **verdict._asdict(), "trusted": not doubt})
    return DONE if verdict.close and not doubt else FAILED


command = _check
