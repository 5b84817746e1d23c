"""`refgi render`: one scene by one method, or a picture made again from the record that its file holds."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from refgi.cli.options import MACHINE, SEEN, WRITING, Asked, verb
from refgi.cli.session import DONE, FAILED, Session, progress, say

DARKEST, BRIGHTEST = 1e-3, 1e3  # radiance times exposure that a picture's brightest pixel usually has
STATED = "sampling_error", "lightcuts"  # of a picture, for its record
DARKEST_OF_GLTF = 1e-2  # whose lights may be in W/sr, 683 times as strong as the format says
BESIDE = frozenset({"again", "scene_path", "exposure", "out", "threads", "parents", "force", "allow_empty",
                    "json", "debug"})  # parameters that --again goes with

if TYPE_CHECKING:
    from refgi.cli.destination import Pictures
    from refgi.methods import Picture
    from refgi.provenance import Job, Record
    from refgi.scene import Scene


@verb("render", "SCENE", *SEEN, "method", "preset", "set", "frames", "temporal", *MACHINE, "shadows", "engine", "again",
      "scene", "exposure", "allow-empty", "out", *WRITING,
      SCENE={"required": False}, out="out.exr (linear), out.png (tone-mapped), or a folder for both.")
def _render(session: Session, asked: Asked) -> int:
    """Render SCENE by one method.

    An EXR holds the radiance that the camera receives (R, G, B; W/m^2/sr) and the indirect irradiance
    (irradiance.R, .G, .B; W/m^2), of `truth` its variance too, where a glossy surface is seen the indirect light that
    its lobe reflects (lobes.R, .G, .B; W/m^2/sr), and all that is needed to make it again; a PNG the radiance,
    tone-mapped.

    --frames 20 shows a method with its temporal filter after so many frames of a resting scene.
    """
    from refgi.cli.destination import Permission, Pictures, picture_files
    from refgi.cli.view import require_memory, stem
    from refgi.errors import expect

    _require_either(click.get_current_context())
    exposure = asked.exposure
    auto = exposure == "auto"
    fits = exposure is None or auto or 0 < exposure < float("inf")
    expect(fits, "--exposure", "auto or a finite number > 0", exposure)
    job = _job(asked)
    job = job if exposure is None or auto else job._replace(exposure=exposure)
    permission = Permission(asked.parents, asked.force)
    name = stem(asked.scene if job.scene.source is None else job.scene.source.name)
    files = Pictures() if asked.out is None else picture_files(asked.out, f"{name}_{job.method}", permission)
    require_memory(job.scene, job.options["dtype"], job.options["rsm_resolution"], traced=job.method == "truth",
                   settings={job.method: job.settings})
    return _rendered(session, job, files, asked)


def _require_either(ctx: click.Context) -> None:
    """Refuse (UsageError) a run without a scene, and one that is to make a picture again but otherwise."""
    by_name = {parameter.name: parameter for parameter in ctx.command.params}
    given = {name: parameter for name, parameter in by_name.items()
             if name and ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE}
    if "again" in given:
        more = [name for name in given if name not in BESIDE]
        if more:
            names = ", ".join(given[name].opts[-1] if name != "scene" else "SCENE" for name in more)
            raise click.UsageError(f"--again makes a picture as it was; it takes no {names}", ctx)
        return
    if "scene_path" in given:
        raise click.UsageError("--scene says where the scene of --again is now; without it name the SCENE alone", ctx)
    for name in ("scene", "out"):
        if name not in given:
            raise click.MissingParameter(ctx=ctx, param=by_name[name])


def _job(asked: Asked) -> "Job":
    """Return what the options say to render, or the record of --again, with the scene loaded.

    InputError if a setting, the scene, the camera or a light is not usable, a file has no record or its scene is not
    the same any more.
    """
    from refgi.cli.view import scene_of, settings_for, still_frames
    from refgi.provenance import Job, job_of, read_record

    if asked.again is not None:
        path = Path(asked.again)
        return job_of(read_record(path), path, asked.scene_path)
    settings = settings_for(asked.method, asked.pairs, asked.seed, asked.preset)
    still = still_frames([asked.method], asked.frames, asked.filtering, asked.preset)
    scene = scene_of(asked)
    frame = {key: getattr(asked, key) for key in ("dtype", "rsm_resolution", "shadows")}
    return Job(scene, asked.method, settings, frame, scene.exposure, still=still)


def _rendered(session: Session, job: "Job", files: "Pictures", asked: Asked) -> int:
    from refgi import stages
    from refgi.cli.view import on_threads, require_view, warm_up
    from refgi.compare.pictures import EXPOSED, auto_exposure
    from refgi.methods import render

    with progress() as tell:
        warm_up([job.method], str(job.options["dtype"]), tell)
    started = time.perf_counter()
    kept = stages.Memory() if job.still is not None else None  # frames of a resting scene share their buffers
    engine = None
    if asked.engine == "literal":
        from refgi.vectors.recorded import Literal

        engine = Literal()
    with on_threads(asked.threads), progress() as tell, stages.observe(
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
    covered = bool(picture.frame.gbuffer.covered.any())
    require_view(covered, job.scene.name, asked.allow_empty or asked.again is not None)
    auto = asked.exposure == "auto"
    if auto:
        job = job._replace(exposure=auto_exposure(picture.radiance))
    record = _record(job, picture) | ({"auto_exposure": {"percentile": EXPOSED}} if auto else {}) | (
        {} if engine is None else {"engine": asked.engine})
    content = _content(picture, job, seconds, record) | {"stages": [
        {key: getattr(run, key) for key in ("name", "status", "seconds", "depth", "reason")} for run in log.runs]}
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
    if asked.again is not None:
        other = _differences(Path(asked.again), planes)
        content["again"] = {"file": asked.again, "same": not other, "differs": other}
        text += f"\n{asked.again}: {'other: ' + '; '.join(other) if other else 'the same to the bit'}"
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


def _differences(file: Path, planes: dict[str, Any]) -> list[str]:
    """Return which planes, (h, w) by channel, are not to the bit those of an EXR that refgi wrote, a text each."""
    import numpy as np

    from refgi.image import read_exr

    found = []
    for name, plane in read_exr(file)[0].items():
        made = planes.get(name)
        if made is None or made.shape != plane.shape:
            found.append(f"{name} is missing or of another size")
        elif count := int((made.view(np.uint32) != plane.view(np.uint32)).sum()):
            found.append(f"{name} in {count} of {plane.size} pixels")
    return found


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
