"""`refgi render`: one scene by one method."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from refgi.cli.options import machine, shadows, speech, view
from refgi.cli.session import FAILED, Session, say

if TYPE_CHECKING:
    from refgi.cli.destination import Pictures
    from refgi.methods import Picture


@click.command("render")
@view
@click.option("--method", default="sii", show_default=True, help="Short name of a method; `refgi info` lists them.")
@click.option("--set", "pairs", multiple=True, metavar="KEY=VALUE", help="A setting of the method; repeatable.")
@machine
@shadows("auto")
@click.option("--exposure", type=float, help="Factor before the sRGB curve of a PNG; the scene's where absent.")
@click.option("--out", required=True, help="out.exr (linear), out.png (tone-mapped), or a folder for both.")
@speech
@click.pass_obj
def _render(session: Session, /, method: str, pairs: tuple[str, ...], dtype: str, rsm_resolution: int,
            shadows: str | None, threads: int | None, seed: int | None, exposure: float | None, out: str,
            **options: Any) -> int:
    """Render SCENE by one method.

    An EXR holds the radiance that the camera receives (R, G, B; W/m^2/sr) and the indirect irradiance
    (irradiance.R, .G, .B; W/m^2) with the settings and versions; a PNG the radiance, tone-mapped.
    """
    from refgi import stages
    from refgi.cli.destination import picture_files
    from refgi.cli.memory import require_memory
    from refgi.cli.progress import progress
    from refgi.cli.settings import read_settings
    from refgi.cli.threads import on_threads
    from refgi.cli.view import View
    from refgi.errors import expect
    from refgi.methods import find_method, render

    expect(exposure is None or 0 < exposure < float("inf"), "--exposure", "a finite number > 0", exposure)
    settings = read_settings(find_method(method).load()[1], pairs, seed, method)
    files = picture_files(out, f"{_stem(options['scene'])}_{method}")
    scene = View(**options).load()
    require_memory(scene, dtype, rsm_resolution, traced=method == "truth", settings={method: settings})
    started = time.perf_counter()
    with on_threads(threads), progress() as tell, stages.observe(progress=tell) as log:
        picture = render(scene, method, settings, dtype=dtype, rsm_resolution=rsm_resolution, shadows=shadows)
    seconds = time.perf_counter() - started
    content = _content(picture, method, settings, seconds) | {"stages": [_run(run) for run in log.runs]}
    _write(picture, files, content, scene.exposure if exposure is None else exposure)
    _say_aloud(content)
    content["files"] = [str(file) for file in files if file]
    size = "x".join(map(str, content["size"]))
    session.result(f"{scene.name} by {method}: {size} in {seconds:.2f} s -> {', '.join(content['files'])}", content)
    return FAILED if content["non_finite_pixels"] else 0


command = _render


def _content(picture: "Picture", method: str, settings: Any, seconds: float) -> dict[str, Any]:
    import numpy as np

    from refgi.compare.environment import versions
    from refgi.compare.metrics import count_non_finite

    frame, covered = picture.frame, picture.frame.gbuffer.covered
    with np.errstate(invalid="ignore"):
        mean = picture.irradiance[:, covered].mean(dtype=np.float64) if covered.any() else 0.0
        return {
            "scene": frame.scene.name, "method": method, "settings": settings, "size": [frame.width, frame.height],
            "dtype": frame.dtype.name, "seconds": seconds, "covered_pixels": int(covered.sum()),
            "mean_indirect_irradiance": float(mean), "brightest_radiance": float(picture.radiance.max()),
            "non_finite_pixels": count_non_finite(picture.radiance), "versions": versions(),
        }


def _write(picture: "Picture", files: "Pictures", content: dict[str, Any], exposure: float) -> None:
    import numpy as np

    from refgi.cli.destination import write_light
    from refgi.compare.results import CONTENT, UNITS, plain
    from refgi.image import write_png

    if files.exr is not None:
        said = {key: content[key] for key in ("scene", "method", "settings", "dtype", "versions")}
        write_light(files.exr, picture.radiance, picture.irradiance,
                    plain({**said, "units": UNITS, "content": CONTENT}))
    if files.png is not None:
        write_png(files.png, np.moveaxis(picture.radiance, 0, -1), exposure)


def _say_aloud(content: dict[str, Any]) -> None:
    if bad := content["non_finite_pixels"]:
        say(f"{bad} pixels of the picture are NaN or infinite")
    elif content["brightest_radiance"] <= 0:
        seen = "nothing but surfaces without light" if content["covered_pixels"] else "no surface at all"
        say(f"the picture is wholly black: the camera sees {seen}")
    elif content["mean_indirect_irradiance"] == 0:
        say("there is no indirect light in the picture")


def _run(run: Any) -> dict[str, Any]:
    return {"name": run.name, "status": run.status, "seconds": run.seconds, "depth": run.depth, "reason": run.reason}


def _stem(scene: str) -> str:
    from refgi.scene import builtin_scenes
    from refgi.scene.files import text_of

    base = scene.partition(":")[0]
    return base if base in builtin_scenes() else text_of(Path(scene).stem)
