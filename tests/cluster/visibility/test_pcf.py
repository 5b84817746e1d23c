"""Percentage closer filtering: against the literal text, one texel against hard shadows, what must hold anywhere."""

import numpy as np
import pytest

from refgi.cluster.maps import shadow_maps
from refgi.cluster.settings import ConstantBias, ValSettings
from refgi.cluster.visibility.shadow import visibility
from refgi.errors import InputError
from refgi.literal.val_visibility import depth_tests
from refgi.rays import Tracer
from refgi.settings import of
from tests.cluster.lights import hard_visibility
from tests.cluster.visibility.plates import are_shares, lit_by, map_of_plates, on_plane
from tests.rsm.shapes import geometry

ROUNDING = 1e-14  # of a count over a count
PLATES = [(-0.6, -0.1, -0.3, 0.3, 1.0), (0.1, 0.6, -0.3, 0.3, 1.0)]
FAR = 6.4


def pcf(areas, maps, points, normals, texels):
    """V by texels x texels depth tests."""
    return visibility(maps, areas, 0, points, normals, of(ValSettings, visibility="pcf", texels=texels))


@pytest.mark.feature("VAL-12")
@pytest.mark.parametrize("texels", [1, 3, 7, 31])
def test_pcf_is_the_literal_text(texels, evidence):
    n, slope = 24, np.array([0.3, -0.2, 1.0]) / np.linalg.norm([0.3, -0.2, 1.0])
    depth = map_of_plates(n, PLATES, 2.8, slope)
    points, _ = on_plane(3.0, 2.2, 9)
    points[2] = (2.8 - slope[0] * points[0] - slope[1] * points[1]) / slope[2]
    points = np.concatenate([points, -points[:, :3]], axis=1)  # some behind the light
    normals = np.repeat(-slope[:, None], points.shape[1], axis=1)
    areas, maps = lit_by(depth, 0.5, FAR)
    expected = depth_tests(points[:, None], np.zeros((1, points.shape[1]), int), normals[:, None], depth[None],
                           np.zeros((1, 3)), np.eye(3)[None], np.array([0.5]), depth.min()[None], texels)[0, 0]
    got = pcf(areas, maps, points, normals, texels)
    assert np.abs(got - expected).max() <= ROUNDING
    assert np.array_equal(pcf(areas, maps, points, -normals, texels), got)  # normals on either side
    assert len(np.unique(expected)) > (1 if texels == 1 else 3)
    off = np.abs(got - expected).max()
    evidence(f"{texels} x {texels} texels: {off:.1e} off the literal text, V {got.min():.2f} to 1")


@pytest.mark.feature("VAL-22")
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_lone_plane_is_wholly_visible(dtype):
    """No surface shadows itself, however wide the kernel and however steep the surface."""
    for slope in ((0.0, 0.0, 1.0), (0.5, 0.3, 1.0)):
        normal = np.array(slope) / np.linalg.norm(slope)
        areas, maps = lit_by(map_of_plates(64, [], 2.0, normal, dtype=dtype), 0.5, 50.0)
        points, normals = on_plane(2.0, 1.2, 21)
        points[2] = (2.0 - normal[0] * points[0] - normal[1] * points[1]) / normal[2]
        normals[:] = -normal[:, None]
        for texels in (1, 5, 21):
            assert (pcf(areas, maps, points.astype(dtype), normals.astype(dtype), texels) == 1).all()


def room_with_blocker():
    """A wall at x = 3 that looks towards -x, and a plate at x = 1 that crosses the plane z = 0."""
    def quad(x, half):
        return [[x, -half, -half], [x, half, -half], [x, half, half], [x, -half, half]]

    vertices = np.array(quad(3.0, 4.0) + quad(1.0, 0.8) + [[-1.0, -4.0, -4.0], [-1.0, 4.0, -4.0], [-1.0, 4.0, 4.0]])
    return geometry(vertices, np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [8, 9, 10]]))


@pytest.mark.feature("VAL-21")
def test_shadow_breaks_off_at_the_light_s_plane(evidence):
    scene = room_with_blocker()
    areas, _ = lit_by(map_of_plates(4, []), 0.3, 1.0)
    z = np.linspace(-2.0, 2.0, 41)
    points = np.stack([np.full(41, 3.0), np.zeros(41), z])
    facing = np.repeat([[-1.0], [0.0], [0.0]], 41, axis=1)
    seen = {}
    for behind in ("visible", "dual_paraboloid", "raytrace"):
        settings = of(ValSettings, behind=behind, visibility="pcss", maps_resolution=128)
        maps = shadow_maps(scene, areas, settings.maps, np.float64)
        tracer = Tracer(scene) if behind == "raytrace" else None
        seen[behind] = visibility(maps, areas, 0, points, facing, settings, tracer)
    middle = slice(18, 23)
    assert (seen["visible"][z <= 0] == 1).all()
    assert (seen["visible"][z > 0][:3] == 0).all()
    for behind in ("dual_paraboloid", "raytrace"):
        assert (seen[behind][middle] == 0).all()
        assert np.abs(seen[behind] - seen[behind][::-1]).max() < 0.25  # a scene that is its own mirror image
    steps = {name: float(np.abs(np.diff(v[middle])).max()) for name, v in seen.items()}
    assert steps == {"visible": 1.0, "dual_paraboloid": 0.0, "raytrace": 0.0}
    evidence("jump of V across the plane: " + ", ".join(f"{name} {step:.2f}" for name, step in steps.items()))


@pytest.mark.feature("VAL-16", "VAL-21")
def test_no_light_leaks_in_over_the_rim(evidence):
    """Near the plane half of a filter lies beyond the hemisphere, where the square of the map mirrors it."""
    scene, points = room_with_blocker(), np.array([[3.0], [0.0], [0.02]])
    areas, _ = lit_by(map_of_plates(4, []), 0.3, 1.0)
    half = np.sqrt(0.5)  # the map's corners, not its edges, lie that way
    areas = areas._replace(frame=np.array([[[half, half, 0.0], [-half, half, 0.0], [0.0, 0.0, 1.0]]]))
    seen = {}
    for prefilter, dtype in (("brute", np.float64), ("mip", np.float32)):
        settings = of(ValSettings, behind="dual_paraboloid", prefilter=prefilter, maps_resolution=128,
                      depth_scale="scene")
        maps = shadow_maps(scene, areas, settings.maps, np.float64)
        maps = maps._replace(depth=maps.depth.astype(dtype), behind=maps.behind.astype(dtype))
        seen[prefilter] = float(visibility(maps, areas, 0, points, -points, settings)[0])
    assert max(seen.values()) < 0.02
    evidence("V just before the plane, in full shadow: " + ", ".join(f"{name} {v:.2f}" for name, v in seen.items()))


def test_rays_are_asked_for():
    areas, maps = lit_by(map_of_plates(8, [], 2.0), 0.5, 4.0)
    points, normals = on_plane(2.0, 1.0, 2)
    with pytest.raises(InputError, match="tracer"):
        visibility(maps, areas, 0, points, normals, of(ValSettings, behind="raytrace"))
    with pytest.raises(InputError, match="m: expected an area light"):
        visibility(maps, areas, 1, points, normals, ValSettings())
    with pytest.raises(InputError, match="visibility"):
        visibility(maps, areas, 0, points, normals, of(ValSettings, visibility="rays_vpls"))


@pytest.mark.feature("VAL-03")
def test_light_without_extent_casts_the_hard_shadow():
    plates = [(-0.5, 0.2, -0.4, 0.4, 1.0)]
    points, normals = on_plane(3.0, 2.0, 30)
    areas, maps = lit_by(map_of_plates(64, plates, 3.0), 0.0, 6.4)
    hard = hard_visibility(maps, areas, 0, points, normals)
    assert set(np.unique(hard)) == {0.0, 1.0}
    for mode in ("csm", "pcss", "pcf", "hard"):
        assert np.array_equal(visibility(maps, areas, 0, points, normals, of(ValSettings, visibility=mode)), hard)
    none = visibility(maps, areas, 0, points, normals, of(ValSettings, visibility="none"))
    unmapped = visibility(maps._replace(map_of=np.array([-1])), areas, 0, points, normals, ValSettings())
    assert (none == 1).all()
    assert (unmapped == 1).all()


EVERY_KIND = [
    *({"visibility": "pcf", "texels": texels} for texels in (1, 5, 255)),
    *({"visibility": "pcss"} | how for how in ({}, {"cone": False, "as_published": {
        "val_search_solid_angle", "val_alpha_over_pi"}}, {"constant_bias": ConstantBias(0.25, "scene")})),
    *({"prefilter": prefilter, "terms": terms, "depth_scale": scale} | how for prefilter, terms, scale, how in (
        ("mip", 1, "log_map", {}), ("mip", 4, "map", {"attenuation": 100.0, "rescale": "plateau"}),
        ("mip", 64, "scene", {"rescale": "scale2", "foreshortened": True}),
        ("brute", 4, "log_map", {"bias": 0.25, "as_published": {"val_alpha", "val_alpha_over_pi"}}),
        ("brute", 64, "map", {"bias": 0.0, "as_published": {"val_search_solid_angle"}})))]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("how", EVERY_KIND,
                         ids=lambda how: str(how | {"as_published": sorted(how.get("as_published", []))}))
def test_any_receiver_sees_a_share(how, dtype):
    """Property: 0 to 1 wherever it is, 1 behind the light, by itself in any order."""
    rng, settings = np.random.default_rng(5), of(ValSettings, **how)
    extreme = np.array([[0, 0, 0], [0, 0, 1e-20], [1, 0, 0], [1, 1, -1e-9], [0, 0, -2], [0, 0, 100], [4, 5, 1e-12],
                        [1e-8, 0, 1e-8], [0, 0, 3], [3, 0, 1e-6]]).T
    points = np.concatenate([extreme, rng.uniform(-3, 3, (3, 30))], axis=1).astype(dtype)
    normals = rng.normal(size=points.shape).astype(dtype)
    normals[:, 3] = 0
    order = rng.permutation(points.shape[1])
    for plates, plane in ((PLATES, 3.0), ([], None), ([(-50, 50, -50, 50, 1e-3)], None), ([], 3.0)):
        depth = map_of_plates(17, plates, plane, dtype=dtype)
        for delta in (0.0, 1e-9, 0.5, 1e6):
            areas, maps = lit_by(depth, delta, FAR)
            got = visibility(maps, areas, 0, points, normals, settings)
            assert are_shares(got, dtype)
            assert (got[points[2] <= 0] == 1).all()
            assert np.array_equal(visibility(maps, areas, 0, points[:, order], normals[:, order], settings), got[order])
