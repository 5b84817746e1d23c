"""The scene as the options ask for it, refused before it is begun if its pictures will not fit in memory.

`--light KIND:KEY=VALUE:...`: lights from the command line.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from refgi.errors import InputError
from refgi.memory import available_bytes
from refgi.method import Extent
from refgi.methods import find_method
from refgi.scene import Camera, DirectionalLight, Light, PointLight, Scene, SpotLight, load_scene
from refgi.scene.files import did_you_mean
from refgi.scene.texture.image import BYTES_OF_ALPHA, BYTES_OF_COLOUR

KEYS = {
    "spot": ("position", "direction", "target", "inner_deg", "outer_deg", "falloff", "intensity"),
    "point": ("position", "intensity"),
    "directional": ("direction", "irradiance"),
}
DEFAULT_OUTER_DEG = 40.0
INNER_SHARE = 0.9  # of the outer half-angle, where the inner is not given


def read_lights(texts: Sequence[str]) -> list[Light] | None:
    """Make lights from texts such as ``spot:position=0,2,0:target=0,0,0:outer_deg=35:intensity=20``.

    None where there are none: the scene keeps its own. InputError, which names the light, if a kind, key or value is
    not usable.
    """
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


@dataclasses.dataclass(frozen=True)
class View:
    """What the options of `options.view` say."""

    scene: str
    size: tuple[int, int] | None
    eye: tuple[float, float, float] | None
    target: tuple[float, float, float] | None
    up: tuple[float, float, float] | None
    vfov_deg: float | None
    lights: tuple[str, ...]
    strict: bool = False
    light_unit: str = "cd"
    emissive: str = "seen"

    def load(self) -> Scene:
        """Return the scene with its camera, of the picture's size, and lights changed as asked.

        InputError if the scene, the camera or a light is not usable.
        """
        changes = self._camera_changes()
        lights = read_lights(self.lights)
        how: dict[str, Any] = {"light_unit": self.light_unit, "emissive": self.emissive, "strict": self.strict}
        whole = "eye" in changes and "target" in changes
        if whole and Path(self.scene).suffix.lower() in (".glb", ".gltf", ".obj", ".ply"):
            return load_scene(self.scene, camera=Camera(**changes), lights=lights, **how)
        scene = load_scene(self.scene, lights=lights, **how)
        return scene.with_camera(**changes) if changes else scene

    def _camera_changes(self) -> dict[str, Any]:
        changes = {key: getattr(self, key) for key in ("eye", "target", "up") if getattr(self, key) is not None}
        if self.vfov_deg is not None:
            changes["vfov"] = math.radians(self.vfov_deg)
        if self.size is not None:
            changes["width"], changes["height"] = self.size
        return changes


# From peaks measured at 1024^2 and 2048^2, rounded up by a third; the truth keeps moments in float64.
PIXEL_FLOATS = 32  # G-buffer, visibility, direct and indirect light, radiance, and their temporaries
TRUTH_PIXEL_BYTES = 280  # receivers, moments, tails, results
COMPARED_PIXEL_BYTES = 90  # a method's or reference's pictures, maps and figures
TEXEL_FLOATS = 36
FACE_BYTES = 460  # vertices, faces, clusters, Embree's tree


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
    """Refuse a picture of the camera's size that will not fit; an InputError names what is needed and available.

    Arguments as of `needed_bytes`; `settings` are those of each method, which run one after the other.
    """
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
