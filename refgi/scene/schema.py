"""The JSON scene file as pydantic models: strict, frozen, no unknown keys, every error of a file at once.

Each model builds its counterpart of `refgi.scene.model` while it is validated, so that the rules for values stand in
one place and their errors come with the others. Angles are in degrees here and nowhere else. Only `scenefile` imports
this module, when it meets a scene file.
"""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationInfo, field_validator, model_validator

from refgi.errors import MOST_FAULTS, shortened
from refgi.scene import model
from refgi.scene.files import did_you_mean
from refgi.scene.light import Falloff
from refgi.scene.motion import affine
from refgi.scene.texture.table import Filter, Wrap


class Names:
    """The file's materials by name, and how many names without one were met.

    `materials`: what stands under that key in the file, not yet validated.
    """

    def __init__(self, materials: Any) -> None:
        self.known = set(materials) if isinstance(materials, dict) else set()
        self.unknown = 0

    def suggestion(self, name: str) -> str:
        """Return the known name nearest to an unknown one; nothing once more were met than an error shows."""
        self.unknown += 1
        return did_you_mean(name, self.known) if self.unknown <= MOST_FAULTS else ""


Number = Annotated[float, Field(allow_inf_nan=False)]
Triple = tuple[Number, Number, Number]
Matrix = Annotated[tuple[Number, ...], Field(min_length=16, max_length=16)]


class Entry(BaseModel):
    """What every object of the file has in common: `note` and `extras` are allowed anywhere, unknown keys nowhere."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    note: str = ""
    extras: Any = None  # of other programs

    @model_validator(mode="after")
    def build_once(self) -> Self:
        """Report a value that the model refuses together with all other errors."""
        self.built("")
        return self

    def built(self, name: str) -> Any:
        """Return the counterpart in `refgi.scene.model`."""


class TextureEntry(Entry):
    """A reflectance that an image varies."""

    texture: Annotated[str, Field(min_length=1)]
    factor: Triple = (1.0, 1.0, 1.0)
    wrap: Wrap | tuple[Wrap, Wrap] = "repeat"
    filter: Filter = "trilinear"


def _form_of_reflectance(value: Any) -> str:
    return "image" if isinstance(value, dict | TextureEntry) else "rgb"


Reflectance = Annotated[
    Annotated[Triple, Tag("rgb")] | Annotated[TextureEntry, Tag("image")], Discriminator(_form_of_reflectance)]


def factor_of(reflectance: Triple | TextureEntry) -> Triple:
    """Return a reflectance's colour, that of a texture its factor."""
    return reflectance.factor if isinstance(reflectance, TextureEntry) else reflectance


class Diffuse(Entry):
    """A diffuse surface."""

    type: Literal["diffuse"]
    diffuse: Reflectance
    emission: Triple = model.BLACK
    alpha: Number = 1.0
    cutoff: Number | None = None

    def built(self, name: str) -> model.Material:
        """Return the material under this name, without its texture's image."""
        return model.Material(name, factor_of(self.diffuse), emission=self.emission, alpha=self.alpha,
                              cutoff=self.cutoff)


class Phong(Entry):
    """A diffuse surface with a Phong lobe."""

    type: Literal["phong"]
    diffuse: Reflectance
    specular: Triple
    exponent: Number
    emission: Triple = model.BLACK
    alpha: Number = 1.0
    cutoff: Number | None = None

    def built(self, name: str) -> model.Material:
        """Return the material under this name, without its texture's image."""
        return model.Material(name, factor_of(self.diffuse), self.specular, self.exponent, emission=self.emission,
                              alpha=self.alpha, cutoff=self.cutoff)


class Dielectric(Entry):
    """Clear glass."""

    type: Literal["dielectric"]
    ior: Annotated[float, Field(allow_inf_nan=False, ge=1)]

    def built(self, name: str) -> model.Material:
        """Return the material under this name."""
        return model.Material(name, model.BLACK, ior=self.ior)


MaterialEntry = Annotated[Diffuse | Phong | Dielectric, Field(discriminator="type")]


def _form_of_material(value: Any) -> str:
    return "name" if isinstance(value, str) else "inline"


class Object(Entry):
    """One mesh file placed in the world."""

    mesh: Annotated[str, Field(min_length=1)]
    material: Annotated[
        Annotated[str, Tag("name")] | Annotated[MaterialEntry, Tag("inline")], Discriminator(_form_of_material)
    ] | None = None
    transform: Matrix | None = None
    smooth_normals: bool | None = None
    sends: bool = True
    rigid: bool = False
    name: str = ""

    @field_validator("transform")
    @classmethod
    def invertible(cls, numbers: tuple[float, ...] | None) -> tuple[float, ...] | None:
        """Refuse a matrix that is singular or not affine."""
        if numbers is not None:
            affine(numbers, "transform")
        return numbers

    @field_validator("material")
    @classmethod
    def known(cls, material: Any, info: ValidationInfo) -> Any:
        """Refuse a name that `materials` does not have."""
        names = info.context or Names(None)
        if isinstance(material, str) and material not in names.known:
            suggestion = names.suggestion(material)
            raise ValueError(f"expected a key of materials, got {shortened(repr(material), 80)}{suggestion}")
        return material


class CameraEntry(Entry):
    """The pinhole camera."""

    eye: Triple
    target: Triple
    up: Triple = (0.0, 1.0, 0.0)
    vfov_deg: Number
    width: int
    height: int

    def built(self, name: str) -> model.Camera:  # noqa: ARG002
        """Return the camera."""
        return model.Camera(self.eye, self.target, self.up, math.radians(self.vfov_deg), self.width, self.height)


class Spot(Entry):
    """A spot light."""

    type: Literal["spot"]
    position: Triple
    direction: Triple
    inner_half_angle_deg: Number
    outer_half_angle_deg: Number
    intensity_w_per_sr: Triple
    falloff: Falloff = "smoothstep"

    def built(self, name: str) -> model.SpotLight:  # noqa: ARG002
        """Return the light."""
        return model.SpotLight(self.position, self.direction, math.radians(self.inner_half_angle_deg),
                               math.radians(self.outer_half_angle_deg), self.intensity_w_per_sr, self.falloff)


class Point(Entry):
    """A point light."""

    type: Literal["point"]
    position: Triple
    intensity_w_per_sr: Triple

    def built(self, name: str) -> model.PointLight:  # noqa: ARG002
        """Return the light."""
        return model.PointLight(self.position, self.intensity_w_per_sr)


class Directional(Entry):
    """A directional light."""

    type: Literal["directional"]
    direction: Triple
    irradiance_w_per_m2: Triple

    def built(self, name: str) -> model.DirectionalLight:  # noqa: ARG002
        """Return the light."""
        return model.DirectionalLight(self.direction, self.irradiance_w_per_m2)


LightEntry = Annotated[Spot | Point | Directional, Field(discriminator="type")]


class SceneFile(Entry):
    """The whole file."""

    schema_: Annotated[Literal[1], Field(alias="schema")]
    name: Annotated[str, Field(min_length=1)]
    description: str = ""
    units: Literal["m"] = "m"
    up: Literal["+y"] = "+y"
    handedness: Literal["right"] = "right"
    objects: Annotated[list[Object], Field(min_length=1)]
    materials: dict[str, MaterialEntry] = {}
    camera: CameraEntry | None = None
    lights: list[LightEntry] = []
    smooth_normals: bool = False
    preview_exposure: Annotated[float, Field(allow_inf_nan=False, gt=0)] = 1.0
