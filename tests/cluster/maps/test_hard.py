"""Hard visibility by maps: against its literal twin, and against rays."""

import numpy as np
import pytest

from refgi.cluster.maps import ShadowMaps, shadow_maps
from refgi.cluster.settings import ValSettings
from refgi.cluster.visibility.pcf import SLACK
from refgi.errors import InputError
from refgi.rays import Tracer
from refgi.scene import load_scene
from refgi.settings import of
from tests.cluster.maps.lights import area_lights, hard_visibility, surface_points
from tests.naive import hard_map
from tests.rsm.shapes import geometry, soup

CLOSE_CALL = 1e-9  # float64 rounding of a decision, relative
CLOSE_CALL_FLOAT32 = 1e-5  # the same where receivers and maps are float32
# Where the map's texels end, what it says changes: pairs whose ray, moved by up to this many of the widest texels
# across the receiver, meets an edge, are near a silhouette.
TEXELS_NEAR = 1.5
AWAY_FROM_SILHOUETTES = 5e-4  # share of pairs; eight rays around a point may miss the tip of a shadow
# The texels along silhouettes halve in number, as a share, with every doubling of the map: error of order h^1.
LEAST_ORDER = 0.8


@pytest.mark.parametrize(("dtype", "close"), [(np.float32, CLOSE_CALL_FLOAT32), (np.float64, CLOSE_CALL)])
def test_every_receiver_as_its_literal_twin(dtype, close):
    rng = np.random.default_rng(5)
    shape = soup(rng, 30)
    lights = area_lights(rng.normal(size=(3, 3)) * 0.3, rng.normal(size=(3, 3)))
    settings = of(ValSettings, maps_resolution=24, near_geometry="keep")
    maps = shadow_maps(shape, lights, settings.maps, dtype)
    points, normals = (array.astype(dtype) for array in surface_points(shape, 90, rng))
    checked = hidden = 0
    for m in range(3):
        seen = hard_visibility(maps, lights, m, points, normals)
        assert seen.dtype == dtype
        for i in range(90):
            at = points[:, i].astype(float)
            cell = (maps.frame[m] @ (at - maps.center[m]))
            scale = (np.linalg.norm(cell) + cell[2]) / 24
            if cell[2] > 0 and np.abs((cell[:2] / scale / 2) % 1).min() < 24 * close:
                continue  # between two texels
            expected, margin = hard_map.visible(maps.center[m], maps.frame[m], 24, at, normals[:, i].astype(float),
                                                shape.vertices, shape.faces, SLACK)
            if margin > close:
                assert seen[i] == expected
                checked += 1
                hidden += expected == 0
    assert checked > 240
    assert hidden > 60


@pytest.mark.feature("VAL-03", "REF-15")
def test_against_shadow_rays(evidence):
    scene, rng = load_scene("cornell_sphere:faces=4000").geometry, np.random.default_rng(4)
    at, normal = surface_points(scene, 24, rng)
    points, facing = surface_points(scene, 2000, rng)
    normal, facing = (_inward(scene, p, n) for p, n in ((at, normal), (points, facing)))
    lights, tracer = area_lights(at.T, normal.T), Tracer(scene)
    toward = at[:, :, None] - points[:, None]
    lit = (np.einsum("km,kmi->mi", normal, toward) < 0) & (np.einsum("ki,kmi->mi", facing, toward) > 0)
    m, i = np.nonzero(lit)
    blocked = _blocked(tracer, points[:, i], facing[:, i], at[:, m], normal[:, m])
    errors, away = [], []
    for size in (64, 128, 256, 512):
        maps = shadow_maps(scene, lights, of(ValSettings, maps_resolution=size).maps, np.float32)
        seen = np.stack([hard_visibility(maps, lights, k, points, facing) for k in range(24)])[lit] == 1
        wrong = np.flatnonzero(seen == blocked)
        pairs = points[:, i[wrong]], facing[:, i[wrong]], at[:, m[wrong]], normal[:, m[wrong]]
        errors.append(len(wrong) / len(m))
        away.append((~_near_silhouette(tracer, *pairs, TEXELS_NEAR * 4 / size)).sum() / len(m))
    order = np.log2(errors[0] / errors[-1]) / 3
    assert order > LEAST_ORDER
    assert max(away) < AWAY_FROM_SILHOUETTES
    shares = ", ".join(f"{100 * error:.2f}" for error in errors)
    evidence(f"maps of 64, 128, 256, 512 texels disagree with rays in {shares} % of {len(m)} pairs, order {order:.2f}; "
             f"away from silhouettes in at most {100 * max(away):.3f} %")


def _inward(scene, points, normals):
    """Normals towards the middle of the room, or outwards on the sphere in it."""
    middle = np.mean(scene.bounds, axis=0)[:, None]
    low, high = scene.bounds
    wall = (np.minimum(np.abs(points - low[:, None]), np.abs(high[:, None] - points)) < 1e-6).any(axis=0)
    toward = (normals * (middle - points)).sum(axis=0)
    return np.where((toward > 0) == wall, 1.0, -1.0) * normals


def _blocked(tracer, points, facing, light, normal):
    return tracer.segments_blocked(points.T, light.T, facing.T, normal.T)


def _near_silhouette(tracer, points, facing, light, normal, angle):
    """Tell where one of eight rays to around the receiver, an angle away, differs from the ray to itself."""
    across = np.cross(facing, [[0.37], [0.56], [0.74]], axis=0)
    across /= np.linalg.norm(across, axis=0)
    along = np.cross(facing, across, axis=0)
    reach = angle * np.linalg.norm(points - light, axis=0)
    plain, found = _blocked(tracer, points, facing, light, normal), np.zeros(points.shape[1], bool)
    for turn in np.pi / 4 * np.arange(8):
        around = points + reach * (np.cos(turn) * across + np.sin(turn) * along)
        found |= _blocked(tracer, around, facing, light, normal) != plain
    return found


@pytest.mark.feature("VAL-22")
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_lone_plane_never_shadows_itself(dtype, evidence):
    plane = geometry([[-9, 1, -9], [9, 1, -9], [0, 1, 15]], [[0, 1, 2]])
    light = area_lights([[0.1, 0, 0.2]], [[0.3, 1, 0.1]])
    settings = of(ValSettings, maps_resolution=32, occluders_alone=False)
    maps = shadow_maps(plane, light, settings.maps, dtype)
    points, normals = (array.astype(dtype) for array in surface_points(plane, 5000, np.random.default_rng(2)))
    assert (hard_visibility(maps, light, 0, points, normals) == 1).all()
    evidence("V = 1 at 5000 points of a lone plane, map of 32^2, no bias")


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
