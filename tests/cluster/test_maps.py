"""Maps of area lights: the same by rays, none where nothing occludes, and what lies near the centre kept or lost."""

import numba
import numpy as np
import pytest

from refgi.cluster.maps import shadow_maps
from refgi.cluster.settings import ValSettings
from refgi.errors import InputError
from refgi.rays import Tracer
from refgi.scene import load_scene
from refgi.settings import of, replaced
from refgi.stages import observe
from tests.cluster.lights import area_lights, hard_visibility, surface_points
from tests.cluster.test_occluders import box, together
from tests.rsm.shapes import geometry, soup

# Embree keeps triangles and rays in float32: its distances are off by a few rounding steps over the cosine at the
# surface, which the scenes here keep above 1/50 almost everywhere.
GRAZING = 2e-5
ON_A_SILHOUETTE = 5e-4  # share of texels so near an edge that float32 sees another triangle, or so grazing
IN_A_CORNER = 0.02  # share of points within a texel of a corner of the room, 48 texels across
SMALL = of(ValSettings, maps_resolution=48)
SCENE = load_scene("cornell_sphere:faces=1500").geometry
LIGHTS = area_lights([[0.1, 0.3, 0.2], [0.4, 0.5, 0.1], [0.3, 0.05, 0.4], [0.25, 0.3, 0.3]],
                     [[1, 0.2, -0.3], [0, -1, 0], [-0.5, 0.8, 0.1], [0, 0.2, -1]], radius=0.09)


def maps_of(shape, areas, dtype=np.float32, **changed):
    return shadow_maps(shape, areas, replaced(SMALL, changed).maps, dtype)


@pytest.mark.feature("VAL-03", "VAL-22")
@pytest.mark.parametrize("alone", [True, False])
@pytest.mark.parametrize("rule", ["keep", "planes", "ball"])
def test_drawn_maps_are_those_of_rays(rule, alone, evidence):
    changed = {"near_geometry": rule, "occluders_alone": alone, "behind": "dual_paraboloid"}
    drawn, traced = (maps_of(SCENE, LIGHTS, renderer=kind, **changed) for kind in ("raster", "rays"))
    assert drawn.left_out == traced.left_out
    assert (drawn.left_out > 0) == (rule != "keep")
    np.testing.assert_array_equal(drawn.map_of, traced.map_of)
    off = 0.0
    for name in ("depth", "behind"):
        a, b = getattr(drawn, name), getattr(traced, name)
        both = np.isfinite(a) & np.isfinite(b)
        different = np.isfinite(a) != np.isfinite(b)
        different[both] = np.abs(a[both] / b[both] - 1) > GRAZING
        off = max(off, different.mean())
    assert off < ON_A_SILHOUETTE
    evidence(f"{rule}, occluders alone {alone}: {off:.1e} of texels differ from rays, {drawn.left_out} left out")


@pytest.mark.parametrize("alone", [True, False])
def test_rays_of_the_frame_serve_where_nothing_is_left_out(alone):
    settings = replaced(SMALL, {"renderer": "rays", "occluders_alone": alone, "near_geometry": "keep"})
    given = shadow_maps(SCENE, LIGHTS, settings.maps, np.float32, Tracer(SCENE))
    np.testing.assert_array_equal(given.depth, shadow_maps(SCENE, LIGHTS, settings.maps, np.float32).depth)


def test_what_a_map_says_of_itself():
    maps = maps_of(SCENE, LIGHTS, np.float64, occluders_alone=False, near_geometry="keep", behind="dual_paraboloid")
    assert maps.depth.dtype == maps.behind.dtype == np.float64
    low, high = SCENE.bounds
    for k in range(4):
        assert maps.near[k] == maps.depth[k].min()
        assert maps.near_behind[k] == maps.behind[k].min()
        corners = np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, -1).T
        assert maps.scene_far[k] == pytest.approx(np.linalg.norm(corners - maps.center[k], axis=1).max(), rel=1e-14)
        assert maps.far[k] == maps.depth[k][np.isfinite(maps.depth[k])].max() <= maps.scene_far[k]
        assert maps.far_behind[k] == maps.behind[k][np.isfinite(maps.behind[k])].max() != maps.far[k]
    np.testing.assert_allclose(maps.center, LIGHTS.center.T, atol=1e-5 * SCENE.diagonal)
    assert (((maps.center - LIGHTS.center.T) * LIGHTS.normal.T).sum(axis=1) > 0).all()
    np.testing.assert_array_equal(maps.frame, LIGHTS.frame)
    single = maps_of(SCENE, LIGHTS, occluders_alone=False, near_geometry="keep", behind="dual_paraboloid")
    for name in ("depth", "behind"):
        finite = np.isfinite(getattr(maps, name))
        np.testing.assert_allclose(getattr(single, name)[finite], getattr(maps, name)[finite], rtol=1e-6)


@pytest.mark.feature("VAL-11", "VAL-21")
def test_the_hemisphere_behind_is_that_of_the_opposite_light():
    both = maps_of(SCENE, LIGHTS, behind="dual_paraboloid", occluders_alone=False)
    turned = LIGHTS._replace(frame=LIGHTS.frame * np.array([[-1.0], [1.0], [-1.0]]))  # the same lift
    np.testing.assert_array_equal(both.behind, maps_of(SCENE, turned, occluders_alone=False).depth)


@pytest.mark.feature("VAL-03")
def test_area_lights_that_nothing_occludes_have_no_map(evidence):
    room = together(box(), box((0.6, 0.2, 0.2), (0.8, 0.4, 0.8)))
    # before the block; behind it; on the wall beside it, looking away; without lights
    lights = area_lights([[0.1, 0.5, 0.5], [0.9, 0.3, 0.5], [0.9, 0.5, 0.5], [0.5, 1, 0.5]],
                         [[1, 0, 0], [-1, 0, 0], [1, 0, 0], [0, -1, 0]], members=[1, 2, 1, 0])
    with observe() as log:
        culled = maps_of(room, lights)
    np.testing.assert_array_equal(culled.map_of, [0, 1, -1, -1])
    assert [run.reason for run in log.runs if run.status == "skipped"] == ["nothing occludes 2 of 4 area lights"]
    every = maps_of(room, lights, occluders_alone=False)
    np.testing.assert_array_equal(every.map_of, [0, 1, 2, -1])
    points, normals = surface_points(room, 3000, np.random.default_rng(3))
    inward = np.where(((points - lights.center[:, 2:3]) * normals).sum(axis=0) > 0, -1, 1) * normals
    blocked = Tracer(room).segments_blocked(np.tile(every.center[2], (3000, 1)), points.T, None, inward.T)
    ahead = lights.normal[:, 2] @ (points - every.center[2][:, None]) > 0
    assert ahead.sum() > 300
    assert not blocked[ahead].any()  # so leaving out its map loses nothing
    spared = 0
    for m in range(4):
        seen, by_every = (hard_visibility(maps, lights, m, points, normals) for maps in (culled, every))
        assert (seen >= by_every).all()  # a wall hides what lies in the corner to the next wall, within a texel
        assert (seen == by_every).mean() > 1 - IN_A_CORNER
        spared += int((seen > by_every).sum())
    evidence(f"1 of 3 maps and 12 of 24 triangles left out: V of 12000 pairs the same but {spared}, where a wall of "
             "the room itself hid its corner")


def test_an_empty_room_has_no_maps():
    maps = maps_of(box(), area_lights([[0.5, 0, 0.5]], [[0, 1, 0]]), behind="dual_paraboloid")
    assert maps.depth.shape == maps.behind.shape == (0, 48, 48)
    assert maps.map_of.tolist() == [-1]
    points, normals = surface_points(box(), 50, np.random.default_rng(1))
    lights = area_lights([[0.5, 0, 0.5]], [[0, 1, 0]])
    assert (hard_visibility(maps, lights, 0, points, normals) == 1).all()


@pytest.mark.feature("VAL-22")
@pytest.mark.parametrize(("rule", "near_one", "far_one"), [("keep", 0, 0), ("planes", 1, 0), ("ball", 1, 0)])
def test_the_shadow_of_an_object_near_the_centre_is_kept_or_lost(rule, near_one, far_one, evidence):
    def plate(x, y):
        return box((x - 0.05, y, -0.05), (x + 0.05, y + 0.01, 0.05))

    floor = geometry([[-2, 2, -2], [2, 2, -2], [2, 2, 2], [-2, 2, 2], [0, -1, 0]], [[0, 1, 2], [0, 2, 3], [0, 1, 4]])
    # a plate 0.1 above the cluster's centre, and one 1 above; the cluster reaches 0.3
    shape = together(floor, plate(0, 0.1), plate(0.8, 1))
    light = area_lights([[0, 0, 0]], [[0, 1, 0]], radius=0.3)
    maps = maps_of(shape, light, near_geometry=rule, maps_resolution=128)
    receivers = np.array([[0.0, 2, 0], [1.6, 2, 0], [-1.2, 2, 0.3]]).T
    seen = hard_visibility(maps, light, 0, receivers, np.array([[0.0, -1, 0]] * 3).T)
    np.testing.assert_array_equal(seen, [near_one, far_one, 1])
    evidence(f"{rule}: shadow of the plate at 0.3 radii {'lost' if near_one else 'kept'}, at 3 radii kept")


@pytest.mark.feature("VAL-22")
def test_a_ball_cuts_surfaces_and_shows_what_lies_beyond():
    sheets = geometry([[-5, 1, -5], [5, 1, -5], [0, 1, 9], [-5, 1.5, -5], [5, 1.5, -5], [0, 1.5, 9]],
                      [[0, 1, 2], [3, 4, 5]])
    light = area_lights([[0, 0, 0]], [[0, 1, 0]], radius=1.2)
    maps = maps_of(sheets, light, np.float64, near_geometry="ball", near_distance=1.0, occluders_alone=False,
                   maps_resolution=65)
    middle, frame = maps.depth[0][32], maps.frame[0]
    s = (2 * np.arange(65) + 1) / 65 - 1
    cosine = (1 - s * s) / (1 + s * s)
    height = np.where(1 / cosine < 1.2, 1.5, 1.0)  # the lower sheet is cut within the ball
    across = np.abs(s) < 0.6  # beyond, the sheets may end
    lifted = maps.center[0] @ frame[2]
    np.testing.assert_allclose(middle[across], ((height - lifted) / cosine)[across], rtol=1e-12)


@pytest.mark.parametrize("size", [1, 3, 17])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_any_size_and_any_number_of_threads_give_the_same_bits(size, dtype):
    shape, areas = soup(np.random.default_rng(1), 70), area_lights(np.eye(3) * 0.3, np.ones((3, 3)), radius=0.4)
    first = None
    before = numba.get_num_threads()
    for count in (1, before):
        numba.set_num_threads(count)
        try:
            maps = maps_of(shape, areas, dtype, maps_resolution=size, near_geometry="ball", near_distance=0.5)
        finally:
            numba.set_num_threads(before)
        assert maps.depth.shape[1:] == (size, size)
        assert len(maps.depth) > 0
        assert not np.isnan(maps.depth).any()
        assert (maps.depth >= 0.2 * (1 - 1e-6)).all()  # the ball is half the radius
        first = first or maps
        np.testing.assert_array_equal(maps.depth, first.depth)


def test_no_lights_no_maps():
    none = area_lights(np.zeros((0, 3)), np.zeros((0, 3)))
    maps = maps_of(SCENE, none)
    assert maps.depth.shape == (0, 48, 48)
    assert maps.map_of.shape == (0,)


def test_types_are_checked():
    with pytest.raises(InputError, match="float16"):
        maps_of(SCENE, LIGHTS, np.float16)
