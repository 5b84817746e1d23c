"""Hard visibility by maps: against the literal text, and against rays."""

import numpy as np
import pytest

from refgi.cluster.maps import ShadowMaps, shadow_maps
from refgi.cluster.settings import ValSettings
from refgi.errors import InputError
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.lights.settings import LightSettings
from refgi.literal.val_maps import depth_maps
from refgi.literal.val_visibility import depth_tests
from refgi.rsm import facing_normals
from refgi.scene import load_scene
from refgi.settings import of
from tests.cluster.lights import area_lights, hard_visibility, surface_points
from tests.rsm.shapes import geometry, soup

CLOSE_CALLS = 2  # of 2700: where receivers and maps are float32, one may fall beside its texel or its blocker's edge
# Where the map's texels end, what it says changes: pairs whose ray, moved by up to this many of the widest texels
# across the receiver, meets an edge, are near a silhouette.
TEXELS_NEAR = 1.5
AWAY_FROM_SILHOUETTES = 5e-4  # share of pairs; sixteen rays around a point may miss the tip of a shadow
NEARER = 1e-3  # of the distance: what lies less before a receiver does not hide it
TIES = 4e-4  # share of pairs: rays are float32, and end a thousandth before facets of the ball that they graze
# The texels along silhouettes halve in number, as a share, with every doubling of the map: error of order h^1.
LEAST_ORDER = 0.8


@pytest.mark.feature("VAL-03")
@pytest.mark.parametrize(("dtype", "close_calls"), [(np.float32, CLOSE_CALLS), (np.float64, 0)])
def test_every_receiver_as_in_the_literal_text(dtype, close_calls):
    rng = np.random.default_rng(5)
    shape = soup(rng, 30)
    lights = area_lights(rng.normal(size=(3, 3)) * 0.3, rng.normal(size=(3, 3)))
    settings = of(ValSettings, maps_resolution=24, near_geometry="keep")
    maps = shadow_maps(shape, lights, settings.maps, dtype)
    points, normals = (array.astype(dtype) for array in surface_points(shape, 900, rng))
    depth = depth_maps(shape.vertices, shape.faces, np.ones(30, bool), maps.center, maps.frame, np.zeros(3), np.ones(3),
                       24)
    expected = depth_tests(points[:, None].astype(float), np.zeros((1, 900), int), normals[:, None].astype(float),
                           depth, maps.center, maps.frame, np.zeros(3), depth.min(axis=(1, 2)))[:, 0]
    seen = np.array([hard_visibility(maps, lights, m, points, normals) for m in range(3)])
    assert seen.dtype == dtype
    assert (seen != expected).sum() <= close_calls
    assert 600 < (expected == 0).sum() < 2100


@pytest.fixture(scope="module", params=["cornell_box", "cornell_sphere:faces=4000", "stage"])
def pairs(request):
    """Pixel lights and what a camera sees, among flat and bent surfaces: all pairs that face each other."""
    frame = Frame(load_scene(request.param), width=64, height=64, rsm_resolution=64, dtype=np.float64)
    scene, chosen, covered = frame.scene.geometry, choose_lights(frame, LightSettings(24)), frame.gbuffer.covered
    at, normal = chosen.position, chosen.normal
    points = np.ascontiguousarray(frame.gbuffer.position[:, covered])
    facing = facing_normals(scene, frame.gbuffer.triangle_id, frame.gbuffer.normal)[:, covered]
    toward = at[:, :, None] - points[:, None]
    lit = (np.einsum("km,kmi->mi", normal, toward) < 0) & (np.einsum("ki,kmi->mi", facing, toward) > 0)
    return request.param, frame, at, normal, points, facing, lit


@pytest.mark.feature("VAL-03")
@pytest.mark.parametrize("size", [64, 256])
def test_a_map_says_what_a_ray_along_its_texel_says(pairs, size, evidence):
    """The ray goes from the light through the middle of the receiver's texel to the receiver's plane, but no farther
    than the receiver, and ends a thousandth before: all that a map can know. Beyond the disc it knows nothing.
    """
    name, frame, at, normal, points, facing, lit = pairs
    settings, lights = of(ValSettings, maps_resolution=size, occluders_alone=False), area_lights(at.T, normal.T)
    maps = shadow_maps(frame.scene.geometry, lights, settings.maps, np.float64)
    wrong, moved = 0, 0
    for m in range(len(at.T)):
        x, up = points[:, lit[m]], facing[:, lit[m]]
        light, above = (np.broadcast_to(part[:, m : m + 1], x.shape) for part in (at, normal))
        seen = hard_visibility(maps, lights, m, x, up) == 1
        end, within = along_texels(maps.center[maps.map_of[m]], maps.frame[maps.map_of[m]], size, x, up)
        free = ~within | ~_blocked(frame.tracer, end, 0 * up, light, above)
        wrong += (seen != free).sum()
        moved += (free == _blocked(frame.tracer, x, up, light, above)).sum()
    evidence(f"{name}, maps of {size}: {100 * wrong / lit.sum():.4f} % of {lit.sum()} pairs differ from a ray along "
             f"the texel; that differs from the ray between the two in {100 * moved / lit.sum():.2f} %")
    assert wrong < TIES * lit.sum()


def along_texels(center, frame, n, points, facing):
    """Return where rays through the texels of receivers (3, n) end, and whether the texels lie in the unit disc."""
    x = frame @ (points - center[:, None])
    d = np.linalg.norm(x, axis=0)
    s, t = (np.floor((x[:2] / (d + x[2]) + 1) / 2 * n) + 0.5) * 2 / n - 1
    square = s * s + t * t
    w = frame.T @ (np.stack([2 * s, 2 * t, 1 - square]) / (1 + square))
    height, slope = (facing * (points - center[:, None])).sum(axis=0), (facing * w).sum(axis=0)
    with np.errstate(divide="ignore"):
        to_plane = np.where(height * slope > 0, height / slope, d)
    return center[:, None] + w * (1 - NEARER) * np.minimum(d, to_plane), square <= 1


@pytest.mark.feature("VAL-03", "REF-15")
def test_against_shadow_rays(pairs, evidence):
    name, frame, at, normal, points, facing, lit = pairs
    scene, tracer, lights = frame.scene.geometry, frame.tracer, area_lights(at.T, normal.T)
    m, i = np.nonzero(lit)
    blocked = _blocked(tracer, points[:, i], facing[:, i], at[:, m], normal[:, m])
    errors, away = [], []
    for size in (64, 128, 256, 512):
        maps = shadow_maps(scene, lights, of(ValSettings, maps_resolution=size).maps, np.float32)
        seen = np.stack([hard_visibility(maps, lights, k, points, facing) for k in range(len(at.T))])[lit] == 1
        wrong = np.flatnonzero(seen == blocked)
        pairs = points[:, i[wrong]], facing[:, i[wrong]], at[:, m[wrong]], normal[:, m[wrong]]
        errors.append(len(wrong) / len(m))
        away.append((~_near_silhouette(tracer, *pairs, TEXELS_NEAR * 4 / size)).sum() / len(m))
    order = np.log2(errors[0] / errors[-1]) / 3
    shares = ", ".join(f"{100 * error:.2f}" for error in errors)
    evidence(f"{name}: maps of 64, 128, 256, 512 texels disagree with rays in {shares} % of {len(m)} pairs, "
             f"{100 * blocked.mean():.0f} % of them blocked, order {order:.2f}; away from silhouettes in at most "
             f"{100 * max(away):.3f} %")
    assert 0.05 < blocked.mean() < 0.95
    assert order > LEAST_ORDER
    assert max(away) < AWAY_FROM_SILHOUETTES


def _blocked(tracer, points, facing, light, normal):
    return tracer.segments_blocked(points.T, light.T, facing.T, normal.T)


def _near_silhouette(tracer, points, facing, light, normal, angle):
    """Tell where one of sixteen rays to around the receiver, an angle away, differs from the ray to itself."""
    across = np.cross(facing, [[0.37], [0.56], [0.74]], axis=0)
    across /= np.linalg.norm(across, axis=0)
    along = np.cross(facing, across, axis=0)
    reach = angle * np.linalg.norm(points - light, axis=0)
    plain, found = _blocked(tracer, points, facing, light, normal), np.zeros(points.shape[1], bool)
    for turn in np.pi / 8 * np.arange(16):
        around = points + reach * (np.cos(turn) * across + np.sin(turn) * along)
        found |= _blocked(tracer, around, facing, light, normal) != plain
    return found


@pytest.mark.feature("VAL-21")
def test_behind_an_area_light_all_is_visible_unless_there_is_a_map():
    plate = geometry([[-1, -1, -1], [1, -1, -1], [0, -1, 1]], [[0, 1, 2]])
    light, below = area_lights([[0, 0, 0]], [[0, 1, 0]]), np.array([[0.0, -2, 0], [0, 2, 0]]).T
    facing = np.array([[0.0, 1, 0], [0, -1, 0]]).T
    for behind, expected in (("visible", 1), ("dual_paraboloid", 0)):
        maps = shadow_maps(plate, light, of(ValSettings, behind=behind, occluders_alone=False).maps, np.float64)
        assert hard_visibility(maps, light, 0, below, facing).tolist() == [expected, 1]


def test_no_receivers_and_no_such_light():
    none = ShadowMaps(np.zeros((0, 4, 4)), np.array([-1], np.int32), np.zeros((0, 3)), np.zeros((0, 3, 3)),
                      np.zeros(0), np.zeros(0), np.zeros(0))
    lights = area_lights([[0, 0, 0]], [[0, 1, 0]])
    assert hard_visibility(none, lights, 0, np.zeros((3, 0)), np.zeros((3, 0))).shape == (0,)
    with pytest.raises(InputError, match="m: expected an area light, 0 to 0, got 1"):
        hard_visibility(none, lights, 1, np.zeros((3, 0)), np.zeros((3, 0)))
