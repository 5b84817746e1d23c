"""`refgi render`: one scene by one method, or a picture made again from what its file says."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from refgi.cli.options import Exposure, machine, seen, shadows, speech, still, writing
from refgi.cli.session import DONE, FAILED, Session, say
from refgi.cli.settings import preset

DARKEST, BRIGHTEST = 1e-3, 1e3  # radiance times exposure that a picture's brightest pixel usually has
STATED = "sampling_error", "lightcuts"  # of a picture, for its record
DARKEST_OF_GLTF = 1e-2  # whose lights may be in W/sr, 683 times as strong as the format says

if TYPE_CHECKING:
    from refgi.cli.destination import Pictures
    from refgi.methods import Picture
    from refgi.provenance import Job, Record
    from refgi.scene import Scene


@click.command("render")
@click.argument("scene", required=False)
@seen
@click.option("--method", default="sii", show_default=True, help="Short name of a method; `refgi info` lists them.")
@preset
@click.option("--set", "pairs", multiple=True, metavar="KEY=VALUE", help="A setting of the method; repeatable.")
@still
@machine
@shadows("auto")
@click.option("--engine", type=click.Choice(["kernels", "literal"]), default="kernels", show_default=True,
              help="literal: stages run by the plain NumPy of refgi/literal where they have it, after their kernels; "
              "sii of cornell_box at 64x48 takes 6 times as long, hssil 3, multires, val and gather 1.1 to 1.2.")
@click.option("--again", metavar="FILE.exr", help="Make this picture again, and say whether it is the same to the bit.")
@click.option("--scene", "scene_path", metavar="PATH", help="Where the scene of --again is now, if it was moved.")
@click.option("--exposure", type=Exposure(), help="Factor before the sRGB curve of a PNG, the scene's where absent; "
              "auto makes the 98th percentile white.")
@click.option("--allow-empty", is_flag=True, help="Write a black picture where the camera sees no surface.")
@click.option("--out", help="out.exr (linear), out.png (tone-mapped), or a folder for both.")
@writing
@speech
@click.pass_context
def _render(ctx: click.Context, /, **options: Any) -> int:
    """Render SCENE by one method.

    An EXR holds the radiance that the camera receives (R, G, B; W/m^2/sr) and the indirect irradiance
    (irradiance.R, .G, .B; W/m^2), of `truth` its variance too, where a glossy surface is seen the indirect light that
    its lobe reflects (lobes.R, .G, .B; W/m^2/sr), and all that is needed to make it again; a PNG the radiance,
    tone-mapped.

    --frames 20 shows a method with its temporal filter after so many frames of a resting scene.
    """
    from refgi.cli.destination import Permission, Pictures, picture_files
    from refgi.cli.job import asked, recorded, require_either, stem
    from refgi.cli.view import require_memory
    from refgi.errors import expect

    require_either(ctx)
    exposure, again, out = options["exposure"], options["again"], options["out"]
    auto = exposure == "auto"
    fits = exposure is None or auto or 0 < exposure < float("inf")
    expect(fits, "--exposure", "auto or a finite number > 0", exposure)
    job = asked(options) if again is None else recorded(again, options["scene_path"])
    job = job if exposure is None or auto else job._replace(exposure=exposure)
    permission = Permission(options["parents"], options["force"])
    name = stem(options["scene"] if job.scene.source is None else job.scene.source.name)
    files = Pictures() if out is None else picture_files(out, f"{name}_{job.method}", permission)
    require_memory(job.scene, job.options["dtype"], job.options["rsm_resolution"], traced=job.method == "truth",
                   settings={job.method: job.settings})
    return _rendered(ctx.ensure_object(Session), job, files, again, options)


command = _render


def _rendered(session: Session, job: "Job", files: "Pictures", again: str | None, options: dict[str, Any]) -> int:
    from refgi import stages
    from refgi.cli.job import differences, require_view
    from refgi.cli.options import on_threads
    from refgi.cli.session import progress
    from refgi.cli.warm import warm_up
    from refgi.compare.pictures import EXPOSED, auto_exposure
    from refgi.methods import render

    with progress() as tell:
        warm_up([job.method], str(job.options["dtype"]), tell)
    started = time.perf_counter()
    kept = stages.Memory() if job.still is not None else None  # frames of a resting scene share their buffers
    engine = None
    if options["engine"] == "literal":
        from refgi.vectors.recorded import Literal

        engine = Literal()
    with on_threads(options["threads"]), progress() as tell, stages.observe(
            memory=kept, progress=tell, substitute=engine) as log:
        if job.still is not None:
            from refgi.provenance.frames import render_still

            picture = render_still(job.scene, job.method, job.settings, job.still, job.options)
        elif job.frame is None:
            picture = render(job.scene, job.method, job.repeatable, **job.options)
        else:
            from refgi.provenance.frames import render_frame

            picture = render_frame(job.scene, job.method, job.settings, job.frame, job.options)
    seconds = time.perf_counter() - started
    require_view(bool(picture.frame.gbuffer.covered.any()), job.scene.name, options["allow_empty"] or again is not None)
    auto = options["exposure"] == "auto"
    if auto:
        job = job._replace(exposure=auto_exposure(picture.radiance))
    record = _record(job, picture) | ({"auto_exposure": {"percentile": EXPOSED}} if auto else {}) | (
        {} if engine is None else {"engine": options["engine"]})
    content = _content(picture, job, seconds, record) | {"stages": [_run(run) for run in log.runs]}
    planes = _write(picture, files, record)
    _say_aloud(content, job.scene)
    _warn_of_brightness(session, content, job.exposure)
    content["files"] = [str(file) for file in files.files]
    size = "x".join(map(str, content["size"]))
    text = f"{job.scene.name} by {job.method}: {size} in {seconds:.2f} s"
    text += f" -> {', '.join(content['files'])}" if files.files else ""
    text += "".join(f"\n{record[key]['statement']}" for key in ("estimate", *STATED) if key in record)
    text += f"\nlobes: {record['estimate']['lobes']['statement']}" if "lobes" in record.get("estimate", {}) else ""
    if engine is not None:
        content["literal"] = [one._asdict() for one in engine.timed]
        text += "".join(f"\n{one.stage} by the literal text: {one.literal:.3f} s, its kernel {one.kernel:.3f} s"
                        for one in engine.timed) or "\nno stage of this method has a literal form"
    if again is not None:
        other = differences(Path(again), planes)
        content["again"] = {"file": again, "same": not other, "differs": other}
        text += f"\n{again}: {'other: ' + '; '.join(other) if other else 'the same to the bit'}"
    session.result(text, content)
    return FAILED if content["non_finite_pixels"] or not content.get("again", {}).get("same", True) else DONE


def _record(job: "Job", picture: "Picture") -> "Record":
    from refgi.provenance import estimate_record, method_record, scene_record, stated_record

    frame, estimate = picture.frame, picture.estimate
    options = {"dtype": frame.dtype.name, "rsm_resolution": frame.rsm_resolution, "shadows": frame.shadows}
    record = {**scene_record(job.scene, options, exposure=job.exposure), **method_record(job.method, job.settings)}
    if job.frame is not None:
        from refgi.provenance.frames import whole_record

        record |= whole_record(job.scene, job.frame)
    if job.still is not None:
        record |= job.still.record
    if estimate is not None:
        record |= estimate_record(estimate, picture.lobe_estimate)
    for key in STATED:
        if (stated := getattr(picture, key)) is not None:
            record |= {key: stated_record(stated)}
    return record


def _content(picture: "Picture", job: "Job", seconds: float, record: "Record") -> dict[str, Any]:
    import numpy as np

    from refgi.compare.metrics import count_non_finite

    frame, covered = picture.frame, picture.frame.gbuffer.covered
    with np.errstate(invalid="ignore"):
        mean = picture.irradiance[:, covered].mean(dtype=np.float64) if covered.any() else 0.0
        lobes = {} if picture.lobes is None else {
            "mean_lobes": float(picture.lobes[:, covered].mean(dtype=np.float64)) if covered.any() else 0.0}
        return {
            "scene": job.scene.name, "method": job.method, "settings": job.settings,
            "size": [frame.width, frame.height], **record["options"], "seconds": seconds,
            "covered_pixels": int(covered.sum()), "mean_indirect_irradiance": float(mean), **lobes,
            "brightest_radiance": float(picture.radiance.max()),
            "non_finite_pixels": count_non_finite(picture.radiance), "versions": record["versions"],
            "provenance": record, **{key: record[key] for key in ("estimate", *STATED) if key in record},
        }


def _write(picture: "Picture", files: "Pictures", record: "Record") -> dict[str, Any]:
    """Write the files there are to be, and return the planes of the EXR, written or not."""
    from refgi.compare.pictures import linear_planes, write_preview
    from refgi.image import write_exr

    estimate = picture.estimate
    variance, samples = (None, None) if estimate is None else (estimate.variance_of_mean, estimate.samples)
    lobe_variance = None if picture.lobe_estimate is None else picture.lobe_estimate.variance_of_mean
    planes = linear_planes(picture.radiance, picture.irradiance, variance, samples, picture.frames, picture.lobes,
                           lobe_variance)
    files.make_folder()
    if files.exr is not None:
        write_exr(files.exr, planes, record)
    if files.png is not None:
        write_preview(files.png, picture.radiance, record)
    return planes


def _say_aloud(content: dict[str, Any], scene: "Scene") -> None:
    from refgi.scene.repair import faintest_irradiance

    least = faintest_irradiance(scene.lights, scene.geometry)
    if bad := content["non_finite_pixels"]:
        say(f"{bad} pixels of the picture are NaN or infinite")
    elif content["brightest_radiance"] <= least:
        seen = "nothing but surfaces without light" if content["covered_pixels"] else "no surface at all"
        say(f"the picture is wholly black: the camera sees {seen}")
    elif content["mean_indirect_irradiance"] <= least:
        say("there is no indirect light in the picture")


def _warn_of_brightness(session: Session, content: dict[str, Any], exposure: float) -> None:
    shown = content["brightest_radiance"] * exposure
    gltf = str(content["provenance"]["scene"]["source"]).lower().endswith((".gltf", ".glb"))
    if 0 < shown < (DARKEST_OF_GLTF if gltf else DARKEST) or shown > BRIGHTEST:
        from refgi.errors import RefgiWarning

        text = f"the brightest radiance is {content['brightest_radiance']:.3g} W/m^2/sr"
        text += f" ({shown:.3g} at the exposure of {exposure:.3g})" if exposure != 1 else ""
        text += f": a PNG of it is {'nearly black' if shown < 1 else 'nearly white'}; --exposure auto fits it"
        if gltf:
            text += ", --light-unit says what the file's lights are in"
        session.warn(text, RefgiWarning)


def _run(run: Any) -> dict[str, Any]:
    return {"name": run.name, "status": run.status, "seconds": run.seconds, "depth": run.depth, "reason": run.reason}
