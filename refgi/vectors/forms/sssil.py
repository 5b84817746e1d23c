"""Literal forms of stages of screen-space light: levels, samples, sums, blur, upsampling, earlier frames."""

import numpy as np

from refgi.literal import hssil_crown, hssil_levels, temporal, upsampling
from refgi.sampling import FIRST_STEP, SECOND_STEP
from refgi.sssil.settings import Bilateral
from refgi.types import Array
from refgi.vectors.forms.beside import Arguments, Described, Names, alone, form_of, own, written
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Bug, Run, reading, writing

EYE = "positions are relative to the eye, z times the ray of depth 1 through the pixel's centre (E-HSS-10)"
AREA = "E-HSS-06"
LEVELS = "HSS Sec. 3.2: sums of disjoint crowns"
PLANES = ("position", "depth", "normal", "radiance", "area", "pixel")
CAMERA = {"frame": "projection.frame", "half": "projection.half"}
OFFSETS = {"axes": "row modulo tile, column modulo tile, sample, (right, down)"}
WEIGHT = {"axes": "row modulo tile, column modulo tile, sample", "paper": AREA}
POINTS = {"axes": "sample, (u, cos 2 pi v, sin 2 pi v)", "space": ""}
SHIFTS = {"axes": "row of the tile, column of the tile, uv"}
# the variance in one pass, as Salvi 2016 has it, pixel by pixel: from the first on, and from the last
MEAN = "(around * known).sum(axis=-1) / count"
VARIANCE = "((around - mean[..., None]) ** 2 * known).sum(axis=-1) / count"
MOMENTS = tuple((
    (f"mean = {MEAN}", f"order = np.s_[..., ::{step}]; around, known = around[order], known[order]; "
                       "mean = np.cumsum(around * known, axis=-1)[..., -1] / count"),
    (VARIANCE, "np.maximum(0, np.cumsum(around**2 * known, axis=-1)[..., -1] / count - mean**2)")) for step in (1, -1))


def _first_level(arguments: Arguments) -> Described:
    number, shape = arguments["number"], arguments["depth"].shape
    if arguments["as_published"]:
        return _kept(None, (), shape)
    cut = number > 0 and any(size % (1 << number) for size in shape)
    form = form_of(hssil_levels.first_level, arguments, PLANES, CAMERA)
    lists = own("first_level", "first_level/places", *(("first_level/several", "first_level/several/places") if number
                                                       else ()), *(("first_level/cut",) if cut else ()))
    return _kept(form, lists, shape, bugs=(in_world,))


def in_world(stage: Run, reads: Names, writes: Names) -> tuple[Bug, ...]:
    """Return bugs of places in the world, with areas of them or of the right places."""
    cause = "positions lie in the world, not relative to the eye: the camera's origin is added"
    place, depth, area, up, pixel = (writes[leaf] for leaf in ("position", "depth", "area", "normal", "pixel"))

    def run(arrays: Arrays, real: object) -> dict[str, Array]:
        made = dict(stage(arrays, real))
        return {**made, place: made[place] + (made[pixel] >= 0) * arrays[reads["projection.origin"]][0][:, None, None]}

    def with_area(arrays: Arrays, real: object) -> Arrays:
        made, right = run(arrays, real), stage(arrays, real)[place]
        seen = made[pixel] >= 0
        z = np.where(seen, made[depth], 1)
        facing = [np.abs((made[up] * d / z).sum(axis=0)) for d in (right, made[place])]
        with np.errstate(all="ignore"):  # edge-on from the wrong place
            return {**made, area: made[area] * np.where(seen, facing[0], 1) / np.where(seen, facing[1], 1)}

    return Bug(cause, with_area, EYE), Bug(cause, run, EYE)


def _coarser_level(arguments: Arguments) -> Described:
    number, size = arguments["number"], arguments["size"]
    cut = {name: one % (1 << number) > 0 for name, one in zip(("rows", "columns"), size, strict=True)}
    form = form_of(hssil_levels.coarser_level, arguments, PLANES, {"place": "position"})
    return _kept(form, own("coarser_level", *(("coarser_level/cut",) if any(cut.values()) else ()),
                           *(f"coarser_level/cut {name}" for name, one in cut.items() if one)), size)


def _first_mean(arguments: Arguments) -> Described:
    form = form_of(hssil_levels.first_mean, arguments, PLANES[:5], CAMERA)
    return Described(form, own("level_of_means"), ("depth",)) if not arguments["as_published"] else Described()


def _level_of_means(arguments: Arguments) -> Described:
    form = form_of(hssil_levels.level_of_means, {**arguments, "side": 2}, PLANES[:5], {"place": "position"})
    return Described(form, own("level_of_means"), ("depth",))


def _first_mean_radiance(arguments: Arguments) -> Described:
    form = form_of(hssil_levels.first_mean_radiance, arguments, (*PLANES, "count"), CAMERA)
    return Described() if arguments["as_published"] else _kept(
        form, own("mean_radiance"), arguments["depth"].shape, without=("texels of the finer level",))


def _coarser_mean_radiance(arguments: Arguments) -> Described:
    form = form_of(hssil_levels.coarser_mean_radiance, arguments, (*PLANES, "count"), {"place": "position"})
    return _kept(form, own("mean_radiance"), arguments["size"])


def _kept(form: Form | None, lists: tuple[tuple[str, str], ...], size: tuple[int, int], **others: object) -> Described:
    """Return what levels of kept pixels have; `size`: rows and columns of the picture."""
    return Described(form, lists, ("depth",), {"pixel": {"index_of": size}}, **others)  # type: ignore[arg-type]


def _points_and_shifts(arguments: Arguments) -> Described:
    lists = ("sample_points", "tile_shifts", "points_and_shifts",
             *(("sample_points/disc", "tile_shifts/disc") if arguments["inner"] else ()),
             *(("tile_shifts/oblong",) if arguments["rows"] != arguments["columns"] else ()))
    form = form_of(hssil_crown.points_and_shifts, arguments, ("points", "shifts"))
    return Described(form, own(*lists), ("start",), {"points": POINTS, "shifts": SHIFTS},
                     facts={"steps": [FIRST_STEP, SECOND_STEP]})


def _sample_points(arguments: Arguments) -> Described:
    lists = ("sample_points", "sample_points/alone", *(("sample_points/disc",) if arguments["inner"] else ()))
    return Described(form_of(hssil_crown.sample_points, arguments), own(*lists), specs={"": POINTS},
                     facts={"steps": [FIRST_STEP, SECOND_STEP]})


def _crown_samples(arguments: Arguments) -> Described:
    density, inner = arguments["density"], arguments["inner"]
    kinds = ("", f"/{density}", *(("/disc", f"/{density} disc") if inner else ()))
    form = form_of(hssil_crown.crown_samples, arguments, ("offsets", "weight"))
    return Described(form, own(*(f"crown_samples{one}" for one in kinds)), specs={"offsets": OFFSETS, "weight": WEIGHT})


def _mirrored_samples(arguments: Arguments) -> Described:
    form = form_of(hssil_crown.mirrored_samples, arguments, ("offsets", "weight"))
    return Described(form, own("mirrored_samples", f"mirrored_samples/{arguments['density']}"), ("start",),
                     {"offsets": OFFSETS, "weight": WEIGHT})


def _every_texel(arguments: Arguments) -> Described:
    form = form_of(hssil_crown.every_texel, arguments, ("offsets", "weight"))
    return Described(form, own("every_texel", *(("every_texel/ring",) if arguments["low"] else ())),
                     specs={"offsets": OFFSETS, "weight": WEIGHT})


def _gather_samples(arguments: Arguments) -> Described:
    share, offsets, index = arguments["share"], arguments["offsets"], arguments["index"]
    if arguments["form_factor"] != "disc" or arguments["factor"] != 1:
        return Described()
    form = form_of(hssil_crown.gather if share == 1 else hssil_crown.gather_shared, arguments)
    lists = own("gather", "gather/whole" if share == 1 else "gather/shared",
                *(("gather/senders",) if arguments["sender_position"] is not arguments["position"] else ()))
    inner = arguments["inner"]
    bugs = (*((lambda stage, reads, _: parts_left_out(stage, inner, reads),) if 0 < inner < offsets.shape[2] else ()),
            *((lambda stage, reads, writes: scaled_again(stage, index, reads, writes),) if index else ()))
    return Described(form, lists, ("position", "sender_position"), bugs=bugs)


def parts_left_out(stage: Run, inner: int, reads: Names) -> tuple[Bug, ...]:
    """Return bugs of disc and crown as a whole; the first `inner` samples are those of the disc."""
    def only(part: slice) -> Bug:
        """Return a sum over a part of the samples."""
        names = (reads[key].replace(".", "__") for key in ("offsets", "weight"))
        cut = dict(zip(names, (lambda a: a[..., part, :], lambda a: a[..., part]), strict=True))
        left = "disc are left out: the crown" if part.start else "crown are left out: the disc"
        return Bug(f"the samples of the {left} alone", reading(stage, **cut), "HSS Sec. 3.2")

    return only(slice(inner, None)), only(slice(inner))


def scaled_again(stage: Run, index: int, reads: Names, writes: Names) -> tuple[Bug, ...]:
    """Return bugs of 4^k, which areas of level k have already."""
    area, light = (name.replace(".", "__") for name in (reads["area"], writes[""]))
    return (Bug("areas are scaled by 4^k a second time", writing(stage, **{light: lambda a: a * 4.0**index}), AREA),
            Bug("areas are divided by 4^k: a coarse texel counts as one of the first level",
                reading(stage, **{area: lambda a: a / 4.0**index}), AREA))


def _blur(arguments: Arguments) -> Described:
    lists = ("blur", *(("blur/even",) if arguments["size"] % 2 == 0 else ()))
    return Described(form_of(upsampling.blur, arguments), own(*lists), ("position", "normal", "depth"))


def _level_upsampling(arguments: Arguments) -> Described:
    settings, guide, coarse = arguments["settings"], arguments["guide"], arguments["coarse"]
    weights, adds = settings.upsampling, arguments["added"] is not None
    factor = next(2**k for k in range(1, 6) if -(-guide.depth.shape[0] // 2**k) <= coarse.shape[1])
    if not isinstance(weights, Bilateral):
        return Described()
    mean = settings.senders.downsample == "average"
    reads = {"coarse": "coarse", "below_depth": "coarse_guide.depth", "below_normal": "coarse_guide.normal",
             "depth": "guide.depth", "normal": "guide.normal", **({"own": "added"} if adds else {})}
    numbers = {"depth_sigma": weights.depth_sigma, "normal_power": weights.normal_power}
    form = Form(upsampling.level_sum if adds else upsampling.upsample, reads, ("",), {
        "factor": factor, "nearest": not mean, **numbers})
    lists = ("upsample", *(("level_sum",) if adds else ()), *(("upsample/mean",) if mean else ()))
    return Described(form, own(*lists), ("coarse_guide.depth", "guide.depth"), facts={
        **numbers, "factor": factor,
        "depth_of_a_texel": "mean, at its centre" if mean else "nearest, at its corner along the slope"})


VIEW = {key: f"projection.{key}" for key in ("origin", "frame", "half")}


def _reprojection(arguments: Arguments) -> Described:
    counted = ("count",) if arguments["frames"] is not None else ()
    form = form_of(temporal.reprojection, arguments, ("light", "weight", *counted), VIEW)
    return Described(form, own("reprojection", f"reprojection/{arguments['fetch']}"),
                     ("position", "projection.origin", "depth"))


def _blend(arguments: Arguments) -> Described:
    counted = arguments["frames"] is not None
    form = form_of(temporal.blend, arguments, ("irradiance", "share", *(("count",) if counted else ())))
    kinds = (("counted", "frames"), ("entering", "entering_share"), ("moving", "speed"))
    return Described(form, own("blend", *(f"blend/{kind}" for kind, name in kinds if arguments[name] is not None)))


def _clamp(arguments: Arguments) -> Described:
    form = form_of(temporal.clamp, arguments)
    return Described(form, own("clamp"), variants=written(form, *MOMENTS))


FORMS = {"sssil.first_level": _first_level, "sssil.coarser_level": _coarser_level, "sssil.first_mean": _first_mean,
         "sssil.level_of_means": _level_of_means, "sssil.first_mean_radiance": _first_mean_radiance,
         "sssil.coarser_mean_radiance": _coarser_mean_radiance, "sssil.points_and_shifts": _points_and_shifts,
         "sssil.sample_points": _sample_points, "sssil.crown_samples": _crown_samples,
         "sssil.mirrored_samples": _mirrored_samples, "sssil.every_texel": _every_texel,
         "sssil.gather_samples": _gather_samples, "sssil.blur": _blur, "sssil.upsample": _level_upsampling,
         "sssil.motion": alone(temporal.motion, ("position", "normal", "speed"), ("vertices", "before", "position"),
                               others=VIEW, specs={"speed": {"unit": "pixels"}}),
         "sssil.reprojection": _reprojection,
         "sssil.entering": alone(temporal.entering, ("made", "share"), ("position", "projection.origin"), others=VIEW),
         "sssil.clamp": _clamp, "sssil.blend": _blend}
