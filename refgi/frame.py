"""Frame: one view of one scene; its buffers are computed on first use, then cached.

A `Frame` computes nothing on construction. A method that works in screen space alone never causes an RSM, a question
about the light never causes a G-buffer, and Embree is loaded only when rays are traced. Every buffer comes from a
stage, so frames of an animation share what did not change when they run under one `stages.Memory`.
"""

from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.scene.material import as_senders
from refgi.scene.model import DirectionalLight, LightTable, MaterialTable, Scene, light_table, material_table
from refgi.scene.motion import near_origin
from refgi.scene.values import is_count
from refgi.skips import left_out
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rays import Tracer
    from refgi.rsm import GBuffer, Rsm
    from refgi.rsm.buffers.extent import Extent
    from refgi.rsm.buffers.leaving import GlossyPoints
    from refgi.rsm.buffers.light_projection import MapShape
Shadows = Literal["map", "exact"]

BUFFERS = ("gbuffer", "rsms", "tracer")  # of a frame, the dear ones


class Frame:
    """One view of one scene under its lights.

    Parameters
    ----------
    scene : Scene
        The scene.
    width, height : int, optional
        Picture size in pixels; the camera's own where absent.
    dtype : dtype
        Float32 (default) or float64 (the oracle) for every buffer and kernel.
    rsm_resolution : int
        Texels along one side of a reflective shadow map (of one face of a cube).
    shadows : {"map", "exact"}, optional
        Direct light's shadows: from the RSM's depth as published, as where absent, or by rays. `render` takes rays
        where its method traces some anyway.

    Attributes
    ----------
    scene : Scene
        The scene; moved near the origin if it was many times its size away (`near_origin`).
    origin : tuple of 3 floats
        Where the origin of `scene` and of all positions in buffers lies, m; 0 unless the scene was moved.

    Raises
    ------
    InputError
        If a size, type or name is not usable, or the scene has nothing to see.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        width: int | None = None,
        height: int | None = None,
        dtype: npt.DTypeLike = np.float32,
        rsm_resolution: int = 512,
        shadows: Shadows | None = None,
    ) -> None:
        expect(isinstance(scene, Scene), "scene", "a Scene", type(scene).__name__)
        self.width = scene.camera.width if width is None else width
        self.height = scene.camera.height if height is None else height
        self.dtype = _dtype(dtype)
        self.rsm_resolution = rsm_resolution
        self.shadows: Shadows = "map" if shadows is None else shadows
        for key in ("width", "height"):
            size = getattr(self, key)
            expect(is_count(size) and 1 <= size <= 65536, key, "1 to 65536 pixels", size)
        expect(is_count(rsm_resolution) and 1 <= rsm_resolution <= 16384, "rsm_resolution", "1 to 16384 texels",
               rsm_resolution)
        expect(self.shadows in ("map", "exact"), "shadows", "'map' or 'exact'", shadows)
        expect(scene.face_count > 0, f"scene {scene.name!r}", "at least one triangle", "none")
        expect(len(scene.lights) > 0, f"scene {scene.name!r}", "at least one light", "none")
        self.scene, self.origin = near_origin(scene)
        self._visible: dict[int, Array] = {}  # where each light arrives, of a frame with glossy receivers
        self._shaped: dict[MapShape, tuple[Rsm, ...]] = {}  # maps of other shapes than the usual

    @cached_property
    def materials(self) -> MaterialTable:
        """The scene's materials as arrays."""
        return material_table(self.scene.materials, self.dtype)

    @cached_property
    def senders(self) -> MaterialTable:
        """The materials as they light others, `materials` itself where all of them do (HSS Sec. 4)."""
        black = as_senders(self.scene.materials)
        return self.materials if black == self.scene.materials else material_table(black, self.dtype)

    @cached_property
    def sent_albedo(self) -> Array:
        """Diffuse reflectance with which visible surfaces light others, (3, h, w)."""
        buffer = self.gbuffer
        return buffer.albedo if self.senders is self.materials else buffer.of_materials(self.senders).albedo

    @cached_property
    def lights(self) -> LightTable:
        """The scene's lights as arrays."""
        return light_table(self.scene.lights)

    @cached_property
    def gbuffer(self) -> "GBuffer":
        """The camera's G-buffer; its channels are resolved on first use."""
        from refgi.rsm import gbuffer

        camera = self.scene.camera
        return gbuffer(self.scene.geometry, self.materials, camera, self.width, self.height, self.dtype)

    @cached_property
    def rsms(self) -> "tuple[Rsm, ...]":
        """One reflective shadow map a light."""
        return self._drawn_maps("auto")

    def rsms_as(self, shape: "MapShape") -> "tuple[Rsm, ...]":
        """Return one map a light, that of a spot or point light of a shape; "auto": `rsms`, which shadows read too."""
        if shape == "auto":
            return self.rsms
        if shape not in self._shaped:
            self._shaped[shape] = self._drawn_maps(shape)
        return self._shaped[shape]

    def _drawn_maps(self, shape: "MapShape") -> "tuple[Rsm, ...]":
        from refgi.rsm import reflective_shadow_map

        return tuple(reflective_shadow_map(
            self.scene.geometry, self.senders, light, self.rsm_resolution, self.dtype,
            "auto" if isinstance(light, DirectionalLight) else shape) for light in self.scene.lights)

    @cached_property
    def visible_extent(self) -> "Extent":
        """Bounding box of visible surfaces; of all triangles where none is visible."""
        from refgi.rsm.buffers.extent import visible_extent

        return visible_extent(self.gbuffer).or_whole(self.scene.geometry)

    @cached_property
    def illuminated_extent(self) -> "Extent":
        """Bounding box of surfaces that reflect direct light; of all triangles where there are none."""
        from refgi.rsm.buffers.extent import illuminated_extent

        return illuminated_extent(self.rsms).or_whole(self.scene.geometry)

    @cached_property
    def extent(self) -> "Extent":
        """The scene's extent: bounding box of visible and illuminated surfaces."""
        from refgi.rsm.buffers.extent import joined

        return joined(self.visible_extent, self.illuminated_extent)

    @cached_property
    def tracer(self) -> "Tracer":
        """The scene's triangles, ready for rays."""
        return _tracer(self.scene.geometry)

    @cached_property
    def direct(self) -> Array:
        """Direct irradiance of all lights with shadows, (3, h, w), W/m^2."""
        from refgi.rsm.buffers.direct import irradiance_of_lamps
        from refgi.scene.light import lamp_of

        visible = [self._visible_from_light(index) for index in range(len(self.scene.lights))]
        position, normal, covered = self.gbuffer.resolve("position", "normal", "covered")
        lamps = [lamp_of(light) for light in self.scene.lights]
        return irradiance_of_lamps(position, normal, covered, visible, lamps)

    @cached_property
    def glossy_receivers(self) -> bool:
        """Whether any visible surface reflects by a lobe; without, no code of lobes runs."""
        from refgi.rsm.buffers.leaving import shows_glossy

        if not any(material.is_glossy and not material.is_dielectric for material in self.scene.materials):
            return not left_out("frame.lobes", lambda: (self.width * self.height,) * 2)
        if shows_glossy(self.gbuffer, self.materials, self.scene.geometry.material_of_face):
            return True
        return not left_out("frame.lobes", lambda: (self.width * self.height,) * 2)

    @cached_property
    def glossy_points(self) -> "GlossyPoints":
        """The pixels whose surface reflects by a lobe towards the eye."""
        from refgi.rsm.buffers.leaving import glossy_points

        return glossy_points(self.gbuffer, self.materials, self.scene.camera.eye)

    @cached_property
    def direct_lobes(self) -> Array:
        """Radiance of lobes by direct light with its shadows, (3, h, w), W/m^2/sr; 0 where there is no lobe."""
        from refgi.rsm.buffers.leaving import direct_lobes, spread_over_picture

        points = self.glossy_points
        parts = [direct_lobes(points, light, self._visible_from_light(index))
                 for index, light in enumerate(self.scene.lights)]
        total = parts[0] if len(parts) == 1 else sum_of_lamps(parts)
        return spread_over_picture(points, total, (self.height, self.width))

    @property
    def unused(self) -> list[str]:
        """Names among `BUFFERS` of what nothing has asked for yet."""
        return [name for name in BUFFERS if name not in vars(self)]

    def radiance(self, indirect: Array | None = None, lobes: Array | None = None) -> Array:
        """Return what the camera receives: emission + albedo/pi (direct + indirect) + direct and indirect lobes.

        (3, h, w), W/m^2/sr, linear RGB, of indirect irradiance (W/m^2) and the radiance towards the eye of receivers'
        lobes by indirect light (W/m^2/sr), both (3, h, w); none where absent.
        """
        radiance = compose(self.direct, indirect, self.gbuffer, self.materials)
        return add_lobes(radiance, self.direct_lobes, lobes) if self.glossy_receivers else radiance

    def _visible_from_light(self, index: int) -> Array:
        if index in self._visible:
            return self._visible[index]
        visible = self._found_visible(index)
        if self.glossy_receivers:  # who asks again
            self._visible[index] = visible
        return visible

    def _found_visible(self, index: int) -> Array:
        buffer, light = self.gbuffer, self.scene.lights[index]
        if self.shadows == "map":
            from refgi.rsm import shadow_map_visibility

            return shadow_map_visibility(buffer.position, buffer.facing, buffer.covered, self.rsms[index],
                                         interpolated=buffer.facing is not buffer.normal)
        from refgi.rays.tracer import visible_from_light

        return visible_from_light(self.tracer, self.scene.geometry, buffer.position, buffer.facing, buffer.covered,
                                  light)


@stage("frame.sum_of_lamps")
def sum_of_lamps(parts: list[Array]) -> Array:
    """Add up what receivers have of each lamp.

    parts list of (3, ...): Irradiance, W/m^2, or radiance of lobes, W/m^2/sr; one a lamp.
    -> (3, ...): Their sum.
    """
    return np.asarray(sum(parts[1:], start=parts[0]))


@stage("frame.compose", steps="refgi.rsm.buffers.leaving.leaving_steps")
def compose(direct: Array, indirect: Array | None, buffer: "GBuffer", materials: MaterialTable) -> Array:
    """Turn irradiance into what the camera receives.

    direct (3, h, w): Direct irradiance, W/m^2.
    indirect (3, h, w): Indirect irradiance, W/m^2.
    materials: The scene's materials; only their emission is used here.
    -> (3, h, w): Radiance, W/m^2/sr, linear RGB.
    """
    from refgi.rsm import leaving_radiance

    return leaving_radiance(direct, indirect, buffer, materials)


@stage("frame.add_lobes")
def add_lobes(radiance: Array, direct: Array, indirect: Array | None) -> Array:
    """Add to what the camera receives from diffuse receivers what their lobes reflect.

    radiance (3, h, w): Emission and diffuse reflection, W/m^2/sr.
    direct (3, h, w): Lobes by direct light, W/m^2/sr.
    indirect (3, h, w): Lobes by indirect light, W/m^2/sr.
    -> (3, h, w): Radiance, W/m^2/sr, linear RGB.
    """
    from refgi.rsm.pool import plane

    total = plane(radiance.shape, np.result_type(radiance, direct))
    lobes = direct if indirect is None else np.add(direct, indirect, out=total)
    return np.add(radiance, lobes, out=total)


def _dtype(requested: npt.DTypeLike) -> np.dtype[Any]:
    try:
        dtype: np.dtype[Any] | None = np.dtype(requested)
    except TypeError:
        dtype = None
    expect(dtype in (np.float32, np.float64), "dtype", "float32 or float64", dtype.name if dtype else requested)
    assert dtype is not None
    return dtype


@stage("rays.build")
def _tracer(geometry: Any) -> "Tracer":
    """Build Embree's acceleration structure.

    geometry Geometry: The triangles.
    -> Tracer: Traces closest hits and occlusion.
    """
    from refgi.rays import Tracer

    return Tracer(geometry)
