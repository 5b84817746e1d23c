"""What each method promises after each change: the settings it is asked with, the limit, and where that comes from.

Bits are promised where a change rounds nothing, or names the same triangles otherwise. Where numbers round anew, the
limit is twice the worst that was observed on scenes that stand in docs/precision.md. Lights that are drawn from a map
are other lights after some changes, so there every texel is a light.
"""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from refgi.scene import DirectionalLight, PointLight, Scene, SpotLight
from refgi.settings import Settings, from_text
from refgi.stress.changes import Change, NotPromisedError, Promise
from refgi.stress.rows import Kind

NONE: Mapping[str, Any] = MappingProxyType({})
FILE = Path(__file__).parent / "files" / "observed.json"
LEAST = 1e-6  # of the mean: a limit is never below what a handful of roundings of float32 come to
UNLIKELY = 1e-5  # probability that a right estimate is called wrong
SURFACES = "visible surfaces"

FEW = {"vpl": ("lights=192",), "truth": ("samples=128",)}  # as many as time allows
# every texel of a small map a light, every texel of a level a sample, every pixel a subsplat: nothing is drawn
EVERY = {"sii": ("pattern=all",), "multires": ("pattern=all", "coarsest=65536"), "vpl": ("pattern=all",),
         "hssil": ("sampling.pattern=all", "downsample=closest", "disc_share=1")}
SMALL_MAP: Mapping[str, Any] = MappingProxyType({"rsm_resolution": 16})
DRAWN_ANEW = ("mirrored", "two lamps of half")  # changes after which other lights or samples are drawn
SAMPLED_ANEW = ("quarter turn", "turned", "mirrored", "two lamps of half")  # changes after which paths go elsewhere
# the same where surfaces have images: a hit that is rounded otherwise reads another place, and senders are picked by it
PAINTED_ANEW = ("moved far", "moved aside", "faces permuted", "faces split", "faces unwelded", "faces doubled")

AROUND = "it looks at the picture around a pixel"
WITHOUT_MAPS = ("hssil", "truth")
BY_NUMBER = "its clusters begin at lights by number"
SILENT: Mapping[tuple[str, str], str] = MappingProxyType({
    ("multires", "cropped"): AROUND, ("hssil", "cropped"): AROUND, ("gather", "cropped"): AROUND,
    ("truth", "cropped"): "it draws by a pixel's number",
    ("gather", "mirrored"): "its fixed samples have a handedness",
    ("val", "mirrored"): BY_NUMBER, ("val", "two lamps of half"): BY_NUMBER,
})
UNBOUNDED = {"gather": "its sum of points has no clamp", "vpl": "its sum of points has no clamp"}
POWER_OF_TWO = "a factor that is a power of two rounds nothing"
SUBNORMAL = "sums that reach subnormal numbers"
SAME = "the same triangles, each owned by the same texels and rays"


class Asked(NamedTuple):
    """How a method is asked for a change."""

    promise: Promise
    settings: tuple[str, ...] = ()  # beside the defaults
    options: Mapping[str, Any] = NONE  # of both frames
    limit: float = 0.0
    kind: Kind = "exact"
    source: str = ""


def asked(method: str, change: Change, scene: Scene, size: tuple[int, int] | None = None) -> Asked:
    """Return how a method is asked for a change: promise, settings and limit, infinity where nothing was observed yet.

    Of the scene as it is: some lamps' maps do not turn with it. Without a picture's size, width and height, one that
    any promise holds for. A NotPromisedError says why the method promises nothing after this change.
    """
    if (method, change.name) in SILENT:
        raise NotPromisedError(SILENT[method, change.name])
    if method not in WITHOUT_MAPS and (why := _other_maps(change.name, scene)):
        raise NotPromisedError(why)
    if (method, change.name) == ("hssil", "mirrored") and size is not None:
        _require_whole_texels(*size)
    few = FEW.get(method, ())
    if method == "hssil" and change.name == "flux x 2^-60":
        return Asked("rounding", few, limit=LEAST, kind="derived", source=SUBNORMAL)
    sampled_anew = SAMPLED_ANEW + PAINTED_ANEW * any(material.textures for material in scene.materials)
    if change.promise == "bits" and not (method == "truth" and change.name in sampled_anew):
        return Asked("bits", few, source=POWER_OF_TWO if " x 2^" in change.name else SAME)
    if method == "truth" and change.name in sampled_anew:
        return Asked("estimate", few, kind="statistics", source=f"Student's t of both estimates, {UNLIKELY:g}")
    if change.name == "hidden plane":
        return Asked("rounding", few, limit=LEAST, kind="derived", source="no light comes from it, none goes to it")
    limit, source = _observed(method, change.name)
    rounded = Asked("mean" if change.promise == "mean" else "rounding", few, NONE, limit, "observed x 2", source)
    # ranges of normals are those of x, y and z
    if change.name in DRAWN_ANEW or (method, change.name) == ("multires", "turned"):
        return rounded._replace(settings=EVERY.get(method, few), options=SMALL_MAP)
    return rounded


def _require_whole_texels(width: int, height: int) -> None:
    """Refuse a width that texels of the coarsest level do not divide: counted from the left, they are not mirrored."""
    from refgi.sssil.pyramid.levels import useful_levels
    from refgi.sssil.settings import HssilSettings

    sampling = HssilSettings().sampling
    texel = 2 ** (sampling.first_level + useful_levels((height, width), sampling) - 1)
    if width % texel:
        raise NotPromisedError(f"a width of {width} pixels is no multiple of the {texel} of its coarsest texels")


def _other_maps(change: str, scene: Scene) -> str:
    """Return why lamps' maps hold other texels after a change; nothing where they do not."""
    spots = [light.direction for light in scene.lights if isinstance(light, SpotLight)]
    if change in ("quarter turn", "turned") and any(x == z == 0 for x, _, z in spots):
        return "the axes of a spot's map are the world's where it shines along y"
    if change == "turned" and any(isinstance(light, PointLight) for light in scene.lights):
        return "a point lamp's map stands along the world's axes"
    if change == "turned" and any(isinstance(light, DirectionalLight) for light in scene.lights):
        return "a directional lamp's map is fitted to the scene's box along the world's axes"
    if change == "mirrored" and any(material.is_dielectric for material in scene.materials):
        return "the search behind glass ends on other texels"
    return ""


def surfaces(change: Change) -> Asked:
    """Return promise and limit of the surfaces that pixels show after a change."""
    if change.promise == "bits" or change.name in ("hidden plane", "two lamps of half"):
        return Asked("bits", source="no place is rounded")
    limit, source = _observed(SURFACES, change.name)
    return Asked("rounding", limit=limit, kind="observed x 2", source=source)


def settings_of(method: str, pairs: tuple[str, ...]) -> Settings:
    """Return a method's settings with some changed, such as ``lights=64``."""
    from refgi.methods import find_method

    settings: Settings = from_text(find_method(method).settings(), pairs)
    return settings


@cache
def _file() -> dict[str, Any]:
    content: dict[str, Any] = json.loads(FILE.read_text())
    return content


def _observed(subject: str, change: str) -> tuple[float, str]:
    worst = _file()["worst"].get(subject, {}).get(change)
    limit = float("inf") if worst is None else max(LEAST, 2 * worst[0])
    return limit, "nothing yet" if worst is None else f"{_file()['scenes']}; worst {worst[1]}"
