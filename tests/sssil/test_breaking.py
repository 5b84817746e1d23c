"""hssil under what may break it: odd pictures and scenes, extreme lengths, grazing views, sameness, symmetry."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.jit import threads
from refgi.scene import load_scene
from refgi.scene.builtin.surfaces import rectangle, sphere
from refgi.scene.model import Camera, DirectionalLight, Material, PointLight, Scene, merge
from refgi.settings import of
from refgi.sssil import HssilSettings
from refgi.sssil.hssil import hssil

QUICK = {"radius": None, "levels": 3, "samples": 8}
VIEWS = (Camera((0.2, 0.5, 0.4), (0.9, 0.0, 0.8), vfov=math.radians(72)),)  # into a corner behind the ball
MATTE = Material("matte", (0.8, 0.6, 0.4))
# of the brightest: a scene times a power of two has the same bits but where rays of shadow maps are rounded
UNIT = 1e-5
SINGLE = 1e-4  # of the brightest: 1e-7 a number, differences of places near to each other more


def ball(width=33, height=27, scene=None, **options):
    scene = scene or load_scene("cornell_sphere:faces=400")
    return Frame(scene, width=width, height=height, **{"rsm_resolution": 64} | options)


def light_of(frame, **settings):
    """Return the light, and expect what holds of any picture."""
    light = hssil(frame, of(HssilSettings, **QUICK | settings))
    assert light.shape == (3, frame.height, frame.width)
    assert light.dtype == frame.dtype
    assert np.isfinite(light).all()
    assert (light >= 0).all()
    assert not light[:, ~frame.gbuffer.covered].any()
    return light


def most(frame, settings):
    """Return the bound of Eq. 4: each sample sends at most pi L, whatever the distance."""
    settings = of(HssilSettings, **QUICK | settings)
    radiance = (frame.gbuffer.albedo * frame.direct).max() / math.pi
    sampling = settings.sampling
    return math.pi * radiance * (sampling.samples * sampling.levels + sampling.inner) * (1 + 1e-5)


@pytest.fixture(scope="module")
def seen():
    return ball()


@pytest.mark.parametrize("how", [
    {}, {"pattern": "pixel"}, {"pattern": "fixed"}, {"pattern": "all"}, {"start": "full"}, {"start": "quarter"},
    {"downsample": "average"}, {"downsample": "closest_average"}, {"form_factor": "point"}, {"upsampling": "bilinear"},
    {"upsampling": "nearest"}, {"visibility": "bitmask"}, {"visibility": "rays"}, {"levels": 1}, {"levels": 16},
    {"radius": 65536.0, "levels": 16}, {"samples": 1, "inner_samples": 0}, {"inner_samples": 100},
    {"only_level": 2, "samples": 64}, {"tile": 1}, {"tile": 16}, {"pattern": "row"}, {"density": "uniform"},
    {"blur": None}, {"blur.size": 16}, {"blur.plane_tolerance": 0.0, "blur.cosine": 1.0},
    {"blur.plane_tolerance": 1e6, "blur.cosine": -1.0},
    {"radius": 1.0, "levels": 6}, {"depth_sigma": 1e-6}, {"depth_sigma": 1e6, "normal_power": 0.0},
    {"normal_power": 1e4}, {"normal_power": 2.5}, {"thickness": 0.0, "visibility": "bitmask", "slices": 1},
    {"views": VIEWS}, {"views": VIEWS, "depth_tolerance": 0.0, "normal_cosine": 1.0},
    {"as_published": ("hss_tan_f", "hss_disc_pi", "hss_level_factor")},
], ids=str)
def test_every_setting_gives_a_sound_picture(seen, how):
    """Property: finite, not negative, black where nothing is seen, no sample above pi L."""
    light = light_of(seen, **how)
    assert light.any() or how.get("radius") == 65536.0  # all samples are off the picture
    if not how.keys() & {"form_factor", "as_published"} and how.get("pattern") != "all":
        assert light.max() <= most(seen, how)


@pytest.mark.parametrize("start", ["full", "half", "quarter"])
@pytest.mark.parametrize("size", [(1, 1), (1, 7), (7, 1), (2, 2), (5, 3), (17, 9), (1, 64)])
def test_pictures_of_any_size(size, start):
    light = light_of(ball(*size), start=start)
    if size == (1, 1):
        assert not light.any()  # the one sample lies on the receiver


@pytest.mark.parametrize("how", [{"pattern": "pixel"}, {"pattern": "all"}, {"pattern": "fixed"},
                                 {"visibility": "bitmask"}, {"visibility": "rays"}, {"downsample": "average"}], ids=str)
def test_one_pixel_is_dark(how):
    assert not light_of(ball(1, 1), **how).any()


@pytest.mark.parametrize("how", [{}, {"pattern": "pixel"}, {"visibility": "bitmask"}, {"visibility": "rays"},
                                 {"views": VIEWS}, {"downsample": "average", "start": "full"}], ids=str)
def test_a_picture_of_nothing_is_dark(how):
    away = load_scene("cornell_box").with_camera(eye=(0.278, 0.273, -0.8), target=(0.278, 0.273, -9.0))
    frame = ball(19, 14, away)
    assert not frame.gbuffer.covered.any()
    assert not light_of(frame, **how).any()


def test_a_light_that_hits_nothing_gives_darkness():
    scene = load_scene("cornell_box")
    light = dataclasses.replace(scene.lights[0], position=(0.0, 1e4, 0.0), direction=(0.0, 1.0, 0.0))
    assert not light_of(ball(19, 14, scene.with_lights(light)), views=VIEWS).any()


def test_a_flat_surface_does_not_light_itself():
    """Analytic: no point of a plane lies before another's plane, however the view grazes it."""
    plate = rectangle((-50, 0, 50), (100, 0, 0), (0, 0, -100), MATTE, "plate")
    geometry, materials = merge([plate])
    scene = Scene("plate", geometry, materials, Camera((0, 2, 5), (0, 0, 0)), (DirectionalLight((0, -1, 0), (1,) * 3),))
    for height in (2.0, 0.02):
        light = light_of(ball(40, 30, scene.with_camera(eye=(0, height, 5), target=(0, 0, 0))), start="full")
        assert light.max() < 1e-4  # of 1 W/m^2: depths are rounded


@pytest.mark.parametrize("form", ["disc", "point"])
@pytest.mark.parametrize("downsample", ["closest", "average"])
def test_grazing_views_stay_bounded(form, downsample):
    """Property: silhouettes of interpolated normals, where Eq. 2 grows without bound, and a floor seen along itself."""
    geometry, materials = merge([rectangle((-5, 0, 5), (10, 0, 0), (0, 0, -10), MATTE, "floor"),
                                 sphere((0, 0.5, 0), 0.5, 60, MATTE, "ball")], smooth=True)
    camera = Camera((0, 1e-3, 3), (0, 1.1e-3, 0), vfov=math.radians(50))
    scene = Scene("graze", geometry, materials, camera, (PointLight((1, 2, 2), (5.0, 5.0, 5.0)),))
    frame = ball(48, 36, scene, shadows="exact")
    how = {"form_factor": form, "downsample": downsample, "start": "full"}
    light = light_of(frame, **how)
    assert light.any()
    if form == "disc":
        assert light.max() <= most(frame, how)


def scaled(scene, scale):
    """Return a scene of another size with the same irradiances."""
    geometry = dataclasses.replace(scene.geometry, vertices=scene.geometry.vertices * scale)
    camera = dataclasses.replace(scene.camera, eye=tuple(scale * np.array(scene.camera.eye)),
                                 target=tuple(scale * np.array(scene.camera.target)))
    light = dataclasses.replace(scene.lights[0], position=tuple(scale * np.array(scene.lights[0].position)),
                                intensity=tuple(scale**2 * np.array(scene.lights[0].intensity)))
    return dataclasses.replace(scene, geometry=geometry, camera=camera, lights=(light,))


@pytest.mark.parametrize("how", [{}, {"form_factor": "point"}, {"pattern": "pixel"}, {"visibility": "bitmask"},
                                 {"downsample": "average"}], ids=str)
@pytest.mark.parametrize("scale", [2.0**-10, 2.0**20])
def test_the_unit_of_length_does_not_matter(seen, how, scale):
    """Property: depths from 1e-3 to 1e6 m; a scene twice as large under four times the power has the same light."""
    expected = light_of(seen, **how)
    got = light_of(ball(scene=scaled(seen.scene, scale)), **how)
    off = np.abs(got - expected).max(axis=0)
    assert np.median(off) <= UNIT * expected.max()
    assert (off > UNIT * expected.max()).mean() < 0.01


def test_near_and_far_in_one_picture():
    """Property: a plate at 1e-3 m before a wall at 1e6 m: nine powers of ten in one picture."""
    near, far = 1e-3, 1e6
    geometry, materials = merge([rectangle((-1e-4, -1e-4, -near), (2e-4, 0, 0), (0, 2e-4, 0), MATTE, "plate"),
                                 rectangle((-far, -far, -far), (2 * far, 0, 0), (0, 2 * far, 0), MATTE, "wall"),
                                 rectangle((-far, -1, far), (2 * far, 0, 0), (0, 0, -2 * far), MATTE, "floor")])
    scene = Scene("deep", geometry, materials, Camera((0, 0, 0), (0, 0, -1), vfov=math.radians(60)),
                  (DirectionalLight((0, -1, -1), (1.0, 1.0, 1.0)),))
    frame = ball(32, 24, scene)
    depth = frame.gbuffer.depth[frame.gbuffer.covered]
    assert depth.min() < 2 * near
    assert depth.max() > 0.9 * far
    for how in ({}, {"pattern": "pixel"}, {"visibility": "bitmask"}, {"downsample": "average"}):
        assert light_of(frame, **how).max() <= most(frame, how)


@pytest.mark.parametrize("form", ["disc", "point"])
def test_samples_on_the_receiver_count_for_nothing(form):
    """Property: through so narrow a view that float32 puts many pixels in one place."""
    scene = load_scene("cornell_box")
    narrow = scene.with_camera(eye=(0.2, 0.3, -0.8), target=(0.25, 0.17, 0.0), vfov=2e-6)
    light_of(ball(24, 18, narrow), form_factor=form, start="full")


@pytest.mark.feature("REF-19")
def test_threads_change_no_bit(evidence):
    kinds = ({}, {"pattern": "row"}, {"pattern": "pixel"}, {"visibility": "bitmask"}, {"visibility": "rays"},
             {"visibility": "bitmask", "pattern": "pixel"}, {"visibility": "bitmask", "pattern": "row"},
             {"downsample": "average"}, {"downsample": "closest_average", "upsampling": "bilinear"}, {"views": VIEWS})
    for how in kinds:
        pictures = []
        for count in (1, 2):
            with threads(count):
                pictures.append(light_of(ball(360, 64), **how))  # several strips, blocks and bands
        np.testing.assert_array_equal(*pictures)
    evidence(f"hssil in {len(kinds)} settings, one thread and two: the same bits")


def symmetric(width, height, dtype, seed=7):
    """Return a frame whose buffers are random, with holes, and mirror images of themselves to the bit."""
    draw = np.random.default_rng(seed)
    scene = load_scene("cornell_box").with_camera(eye=(0.0, 0.3, -1.0), target=(0.0, 0.2, 0.0))
    frame = ball(width, height, scene, dtype=dtype)
    normal = draw.normal(size=(3, height, width))
    normal[2] = -2 - np.abs(normal[2])  # towards the eye, more or less
    normal /= np.linalg.norm(normal, axis=0)
    covered = draw.random((height, width)) < 0.9
    depth = np.where(covered, draw.uniform(0.5, 2.0, (height, width)), np.inf)
    channels = {"depth": depth, "normal": normal * covered, "albedo": draw.random((3, height, width)) * covered,
                "covered": covered}
    direct = draw.random((3, height, width)) * covered
    frame.gbuffer._channels.update({name: mirrored(plane, frame.dtype if plane.dtype == np.float64 else plane.dtype)
                                    for name, plane in channels.items()})
    frame.gbuffer._channels["normal"] = mirrored(channels["normal"], frame.dtype, flip=True)
    frame.direct = mirrored(direct, frame.dtype)
    return frame


def mirrored(plane, dtype, flip=False):
    """Return a picture whose right half is the left one's mirror image; vectors turn their x."""
    width = plane.shape[-1]
    result = plane.astype(dtype)
    if flip and width % 2:
        result[0, :, width // 2] = 0  # the middle column is its own mirror image
    half = result[..., : width // 2][..., ::-1].copy()
    if flip:
        half[0] *= -1
    result[..., width - width // 2:] = half
    return np.ascontiguousarray(result)


@pytest.mark.feature("HSS-10")
def test_a_mirror_symmetric_scene_has_a_mirror_symmetric_picture(evidence):
    """Property: to the bit, where the pattern is symmetric and texels of all levels are, whatever else is set."""
    kinds = [{"pattern": pattern, "start": start, "downsample": downsample, "samples": 16}
             for pattern in ("fixed", "all") for start in ("full", "half", "quarter")
             for downsample in ("closest", "average", "closest_average")]
    kinds += [{"pattern": "fixed", "upsampling": upsampling, "downsample": "closest"}
              for upsampling in ("bilinear", "nearest")]
    pictures = [(symmetric(64, 23, np.float32), how) for how in kinds]  # no texel of a level straddles the middle
    odd = symmetric(33, 23, np.float32)  # texels of coarser levels would be cut on one side alone
    pictures += [(odd, how | {"levels": 1}) for how in kinds if how.get("start") == "full"]
    pictures += [(symmetric(16, 9, np.float64), kinds[0])]
    broken = [(frame.width, how) for frame, how in pictures if not is_symmetric(light_of(frame, **how))]
    assert not broken
    evidence(f"random symmetric pictures with holes, {len(pictures)} settings: the same bits left and right")


def is_symmetric(light):
    """Tell whether a picture is its own mirror image to the bit."""
    return bool(light.any()) and np.array_equal(light, light[..., ::-1])


def test_single_precision_has_the_light_of_double(seen):
    """Oracle; means, as the closest of pixels that are equally near is another one with other roundings."""
    fine = light_of(ball(dtype=np.float64), downsample="average")
    assert np.abs(light_of(seen, downsample="average") - fine).max() < SINGLE * fine.max()
