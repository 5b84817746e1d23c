"""Whole methods by the literal text, called by their named arguments, are the methods' own pictures."""

import numpy as np
import pytest

from refgi.cluster import ValSettings, val
from refgi.frame import Frame
from refgi.lights.selection import choose_lights, footprints
from refgi.lights.settings import with_clamp
from refgi.literal import hssil as literal_hssil
from refgi.literal import multires_upsample, val_areas
from refgi.literal import val as literal_val
from refgi.settings import of
from refgi.splat import MultiresSettings, multires
from refgi.sssil import HssilSettings
from refgi.sssil.hssil import hssil
from tests.literal.whole.hssil import random_shares
from tests.literal.whole.val import illuminated
from tests.naive import crown_points
from tests.wiring.cases import SCENES

ROUNDING = 1e-9  # of the brightest pixel: float64 in another order
SIZE = {"width": 17, "height": 13, "rsm_resolution": 16, "dtype": np.float64}
FLUX = ("position", "normal", "flux", "lobe_flux", "lobe_axis", "lobe_exponent")

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light", "ignore:radius")


@pytest.fixture(params=["lamps", "smooth"], scope="module")
def frame(request):
    return Frame(SCENES[request.param](), **SIZE)


def lights_of(frame, settings):
    """Return pixel lights as arrays, and the surface that each stands for."""
    settings = with_clamp(settings)
    lights = choose_lights(frame, settings.lights)
    return [getattr(lights, name) for name in FLUX], footprints(frame, settings.lights, settings.pairs)


def same(got, expected):
    assert expected.max() > 0
    assert np.abs(got - expected).max() < ROUNDING * expected.max()


def test_multires_by_geometry_and_by_each_light(frame):
    buffer = frame.gbuffer
    common = {"top": 3, "finest": 0, "mode": "tent", "filter_all": False, "corner_rule": True, "a": 0.2}
    planes, camera = (buffer.position, buffer.normal), np.array([frame.scene.camera.eye])
    settings = of(MultiresSettings, **{"lights.count": 30, "subsplats.coarsest": 3, "detail": 0.2,
                                     "subsplats.criteria.depth.threshold": 0.4})
    lights, area = lights_of(frame, settings)
    criteria = settings.subsplats.criteria
    same(multires_upsample.multires(
        *planes, buffer.depth, buffer.triangle_id, camera, *lights, area, mean=False, rim=criteria.rim,
        diagonal=criteria.diagonal, depth_threshold=0.4, depth_measure=criteria.depth.measure,
        normal_threshold=criteria.normal.threshold, components=len(criteria.normal.components), **common),
        multires(frame, settings))
    own = of(MultiresSettings, **{"lights.count": 30, "subsplats": "irradiance", "subsplats.coarsest": 3,
                                "subsplats.threshold": 0.4, "detail": 0.2})
    same(multires_upsample.multires_of_lights(
        *planes, buffer.triangle_id, camera, *lights, area, threshold=0.4, form=own.subsplats.form,
        **common), multires(frame, own))


@pytest.mark.parametrize(("shadow", "soft"), [
    ("csm", {"terms": 4, "attenuation": 0.0, "rescale": "none", "bias": None, "depth_scale": "log_map", "mip": True,
             "in_bytes": False}),
    ("pcss", {"cone": True, "axial": False}), ("pcf", {"texels": 5})])
def test_val(frame, shadow, soft):
    settings = of(ValSettings, **{"lights.count": 48, "clusters.count": 4, "maps.resolution": 16,
                                  "interleaving.block": 4, "visibility": shadow, "maps.near_distance": 0.4})
    buffer, geometry = frame.gbuffer, frame.scene.geometry
    lights, area = lights_of(frame, settings)
    kmeans, rectangle, blurred = settings.clusters, settings.area, settings.blur
    picture = literal_val.val(
        buffer.position, buffer.normal, buffer.triangle_id, geometry.vertices, geometry.faces,
        val_areas.facing(buffer.normal, buffer.triangle_id, geometry.vertices, geometry.faces), illuminated(frame),
        *lights, area,
        clusters={"count": 4, "distance": kmeans.distance, "w_x": kmeans.position_weight, "w_a": kmeans.normal_weight,
                  "rounds": kmeans.rounds},
        rectangles={"axes": rectangle.axes, "extent": rectangle.extent, "unbiased": rectangle.unbiased_area},
        texels=16, near_distance=0.4, touching=not settings.maps.occluders_alone, shadow=shadow, soft=soft, side=4,
        window=(blurred.extent, blurred.cosine, blurred.every_subset))
    same(picture, val(frame, settings))


@pytest.mark.feature("HSS-09")
@pytest.mark.parametrize("downsample", ["closest", "average", "closest_average", "resampled"])
def test_hssil(frame, downsample):
    settings = of(HssilSettings, **{"levels": 3, "radius": 2.0, "samples": 9, "downsample": downsample})
    sampling, smooth, join = settings.sampling, settings.blur, settings.upsampling
    first, view = sampling.first_level, frame.gbuffer.projection
    seen = frame.gbuffer.resolve("depth", "normal", "albedo")
    shapes = [tuple(-(-size >> first + k) for size in seen[0].shape) for k in range(3)]
    samples = [crown_points.samples(sampling, 2.0, k, first + k, shape) for k, shape in enumerate(shapes)]
    picture = literal_hssil.hssil(
        *seen, frame.direct, view.frame, view.half, samples, first=first, downsample=downsample,
        form=settings.senders.form_factor, disc_share=settings.senders.disc_share,
        window=(smooth.size, smooth.plane_tolerance, smooth.cosine), depth_sigma=join.depth_sigma,
        normal_power=join.normal_power,
        shares=[random_shares(sampling.seed, first + k, shape) for k, shape in enumerate(shapes)])
    same(picture, hssil(frame, settings))
