"""Scene, settings and threads as the options ask for them, refused or made ready before anything is computed.

Refused is what is not usable and a picture that will not fit in memory; made ready are the methods' kernels.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from refgi.cli.options import Asked
from refgi.errors import InputError, expect, first_faults
from refgi.memory import available_bytes
from refgi.method import DEFAULT, Extent
from refgi.methods import find_method, require_filter
from refgi.scene import Camera, DirectionalLight, Light, PointLight, Scene, SpotLight, builtin_scenes, load_scene
from refgi.scene.files import did_you_mean, text_of
from refgi.scene.texture.image import BYTES_OF_ALPHA, BYTES_OF_COLOUR
from refgi.settings import from_text, leaves

if TYPE_CHECKING:
    from refgi.jit.ahead import Specialisation
    from refgi.provenance.frames import StillFrames
    from refgi.sssil.settings import TemporalSettings
    from refgi.types import Tell

KEYS = {
    "spot": ("position", "direction", "target", "inner_deg", "outer_deg", "falloff", "intensity"),
    "point": ("position", "intensity"),
    "directional": ("direction", "irradiance"),
}
DEFAULT_OUTER_DEG = 40.0
INNER_SHARE = 0.9  # of the outer half-angle, where the inner is not given
FEW = 4  # kernels that a run compiles faster by itself than other processes start
# From peaks measured at 1024^2 and 2048^2, rounded up by a third; the truth keeps moments in float64.
PIXEL_FLOATS = 32  # G-buffer, visibility, direct and indirect light, radiance, and their temporaries
TRUTH_PIXEL_BYTES = 280  # receivers, moments, tails, results
COMPARED_PIXEL_BYTES = 90  # a method's or reference's pictures, maps and figures
TEXEL_FLOATS = 36
FACE_BYTES = 460  # vertices, faces, clusters, Embree's tree


def settings_for(method: str, pairs: Iterable[str], seed: int | None = None, preset: str = "default") -> Any:
    """Make a method's settings from a preset and texts; an InputError names all that is not usable."""
    known = find_method(method)
    try:
        return from_text(known.preset(preset), [*pairs, *([] if seed is None else [f"seed={seed}"])])
    except InputError as error:
        raise InputError(f"{error} (`refgi settings {method}` lists the keys)", key=error.key) from error


def has_seed(method: str) -> bool:
    """Return whether a method draws random numbers: whether any of its settings is a seed."""
    return any(leaf.key.rpartition(".")[2] == "seed" for leaf in leaves(find_method(method).settings))


def filter_for(methods: Iterable[str], preset: str, pairs: Iterable[str]) -> "TemporalSettings":
    """Return the settings of a temporal filter that belong to a preset of a method, changed by texts `key=value`."""
    from refgi.sssil.temporal import TemporalSettings

    known: list[Any] = [find_method(name).temporal_presets for name in methods]
    return from_text(next((one[preset] for one in known if preset in one), TemporalSettings()), pairs)


def still_frames(
    methods: Iterable[str], frames: int | None, pairs: Sequence[str], preset: str = DEFAULT
) -> "StillFrames | None":
    """Return how many frames of a resting scene methods blend, and by which filter; None without --frames."""
    if frames is None:
        expect(not pairs, "--temporal", "--frames beside it", " ".join(pairs))
        return None
    from refgi.provenance.frames import StillFrames

    return StillFrames(frames, filter_for(require_filter(methods), preset, pairs))


def by_method(pairs: Iterable[str], methods: Iterable[str]) -> dict[str, list[str]]:
    """Sort texts such as ``sii.lights=1024`` by method; an InputError names all whose method is missing or unknown."""
    sorted_pairs: dict[str, list[str]] = {name: [] for name in methods}
    errors = []
    for pair in pairs:
        name, dot, rest = pair.partition(".")
        if not dot or "=" in name:
            errors.append(f"--set {pair!r}: expected METHOD.key=value")
        elif name not in sorted_pairs:
            errors.append(f"--set {pair!r}: {name!r} is not compared here ({', '.join(sorted_pairs)})"
                          + did_you_mean(name, sorted_pairs))
        else:
            sorted_pairs[name].append(rest)
    if errors:
        raise InputError(first_faults(errors, "; "), key="--set")
    return sorted_pairs


def named_methods(text: str | None) -> list[str] | None:
    """Return the names of --methods; None where it is absent."""
    return None if text is None else [name.strip() for name in text.split(",")]


def read_lights(texts: Sequence[str]) -> list[Light] | None:
    """Make lights from texts such as ``point:position=0,2,0:intensity=20``; None without any."""
    return [_read(text) for text in texts] if texts else None


def _read(text: str) -> Light:
    kind, _, rest = text.partition(":")
    try:
        if kind not in KEYS:
            raise InputError(f"expected one of {', '.join(KEYS)}, got {kind!r}" + did_you_mean(kind, KEYS))
        return _build(kind, _values(kind, rest))
    except InputError as error:
        raise InputError(f"--light {text!r}: {error}", key="--light") from error


def _values(kind: str, rest: str) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for pair in filter(None, rest.split(":")):
        key, _, value = pair.partition("=")
        if key not in KEYS[kind]:
            raise InputError(f"{key!r} is not a key of {kind} ({', '.join(KEYS[kind])})"
                             + did_you_mean(key, KEYS[kind]))
        read = _number if key.endswith("_deg") else _triple
        values[key] = value if key == "falloff" else read(key, value)
    return values


def _build(kind: str, values: dict[str, Any]) -> Light:
    if kind == "spot" and "target" in values:
        if "direction" in values:
            raise InputError("direction: expected direction or target, got both")
        target, position = values.pop("target"), _needed(values, "position")
        values["direction"] = tuple(t - p for t, p in zip(target, position, strict=True))
    needed = {"spot": ("position", "direction", "intensity"), "point": KEYS["point"],
              "directional": KEYS["directional"]}[kind]
    given = [_needed(values, key) for key in needed]
    if kind == "point":
        return PointLight(*given)
    if kind == "directional":
        return DirectionalLight(*given)
    outer = values.get("outer_deg", DEFAULT_OUTER_DEG)
    inner = values.get("inner_deg", INNER_SHARE * outer)
    position, direction, intensity = given
    return SpotLight(position, direction, math.radians(inner), math.radians(outer), intensity,
                     values.get("falloff", SpotLight.falloff))


def _needed(values: dict[str, Any], key: str) -> Any:
    if key not in values:
        raise InputError(f"{key}: expected a value, got none")
    return values[key]


def _triple(key: str, text: str) -> tuple[float, ...]:
    parts = text.split(",")
    if len(parts) == 1 and key in ("intensity", "irradiance"):
        parts *= 3  # white
    if len(parts) != 3:
        raise InputError(f"{key}: expected three numbers, got {text!r}")
    return tuple(_number(key, part) for part in parts)


def _number(key: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"{key}: expected a number, got {text!r}") from error


def scene_of(asked: Asked) -> Scene:
    """Return the scene with camera, size and lights changed as the options of `SEEN` ask for it."""
    changes = {key: value for key in ("eye", "target", "up") if (value := getattr(asked, key, None)) is not None}
    if getattr(asked, "vfov_deg", None) is not None:
        changes["vfov"] = math.radians(asked.vfov_deg)
    if asked.size is not None:
        changes["width"], changes["height"] = asked.size
    how = {key: getattr(asked, key) for key in ("light_unit", "emissive", "strict") if hasattr(asked, key)}
    how["lights"] = read_lights(getattr(asked, "lights", ()))
    whole = "eye" in changes and "target" in changes
    if whole and Path(asked.scene).suffix.lower() in (".glb", ".gltf", ".obj", ".ply"):
        return load_scene(asked.scene, camera=Camera(**changes), **how)
    scene = load_scene(asked.scene, **how)
    return scene.with_camera(**changes) if changes else scene


def require_view(covered: bool, scene: str, allowed: bool) -> None:
    """Refuse (InputError), unless allowed, a picture on which there is nothing, which nobody wants by intention."""
    if not (covered or allowed):
        raise InputError(f"scene {scene!r}: camera: expected a view of some surface, got one past all of it; "
                         "--allow-empty writes the black picture", key="camera")


def stem(scene: str) -> str:
    """Return how files are named after a scene: its name without folder, suffix and parameters."""
    base = scene.partition(":")[0]
    return base if base in builtin_scenes() else text_of(Path(scene).stem)


def on_threads(count: int | None) -> AbstractContextManager[None]:
    """Run kernels on `count` threads, all where None, inside the block; InputError if there are not so many."""
    import numba

    from refgi.jit import threads

    config: Any = numba.config
    most = config.NUMBA_NUM_THREADS
    expect(count is None or 1 <= count <= most, "--threads", f"1 to {most} (NUMBA_NUM_THREADS)", count)
    return threads(count)


def warm_up(methods: Iterable[str], dtype: str, tell: "Tell") -> None:
    """Compile in several processes what methods at their defaults would have to compile first."""
    from refgi.jit.ahead import compile_ahead, cores

    if cores() > 1 and len(lacking := lacking_kernels(methods, dtype)) >= FEW:
        compile_ahead(lacking, tell)


def lacking_kernels(methods: Iterable[str], dtype: str) -> "list[Specialisation]":
    """Return what methods at their defaults need and no run has compiled."""
    from refgi.jit.ahead import missing, read_list

    needs = {f"{name}/{dtype}" for name in methods}
    return missing(one for one in read_list() if one.needed_by & needs)


def needed_bytes(scene: Scene, width: int, height: int, *, float_bytes: int = 4, rsm_resolution: int = 512,
                 traced: bool = False, compared: int = 0) -> int:
    """Estimate the memory that a picture takes, bytes, rather too many than too few.

    `float_bytes`: 4 or 8; `rsm_resolution`: texels along a side; `traced`: whether the truth is among the methods;
    `compared`: how many methods are compared.
    """
    pixel = PIXEL_FLOATS * float_bytes + traced * TRUTH_PIXEL_BYTES + compared * COMPARED_PIXEL_BYTES
    texels = map_count(scene) * rsm_resolution**2 * TEXEL_FLOATS * float_bytes
    images = {texture.image for one in scene.materials for texture in one.textures}
    painted = sum(image.width * image.height for image in images) * BYTES_OF_COLOUR
    cut = {texture.image for one in scene.materials if one.cutoff is not None for texture in one.textures}
    painted += sum(image.width * image.height for image in cut) * BYTES_OF_ALPHA
    return width * height * pixel + texels + scene.face_count * FACE_BYTES + painted


def map_count(scene: Scene) -> int:
    """Return how many shadow maps the lamps of a scene have: a point light has one for each face of a cube."""
    return sum(6 if isinstance(light, PointLight) else 1 for light in scene.lights)


def require_memory(scene: Scene, dtype: str, rsm_resolution: int, *, traced: bool = False, compared: int = 0,
                   settings: Mapping[str, Any] | None = None) -> None:
    """Refuse a picture that will not fit; `settings` are those of each method, which run one after the other."""
    width, height = scene.camera.width, scene.camera.height
    float_bytes = 8 if dtype == "float64" else 4
    needed = needed_bytes(scene, width, height, float_bytes=float_bytes, rsm_resolution=rsm_resolution, traced=traced,
                          compared=compared)
    extent = Extent((width, height), float_bytes, map_count(scene), rsm_resolution**2)
    extra = {name: find_method(name).extra_bytes(own, extent) for name, own in (settings or {}).items()}
    most = max(extra, key=extra.__getitem__, default="")
    added, available = extra.get(most, 0), available_bytes()
    if available is not None and needed + added > available:
        of = f", {added:,} of them for the settings of {most}" if added else ""
        raise InputError(f"size: {width}x{height} needs about {needed + added:,} bytes of memory{of}, {available:,} "
                         "are available")
