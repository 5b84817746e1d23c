"""Cut-outs in whole pictures: every method sees the same holes, light goes through them, and none is lost."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from refgi.cluster.maps import shadow_maps
from refgi.cluster.settings import ValSettings
from refgi.frame import Frame
from refgi.lights.refraction import refracted
from refgi.lights.walk import walk_lights
from refgi.literal import imperfect
from refgi.methods import find_method
from refgi.rays import Tracer
from refgi.rsm import reflective_shadow_map
from refgi.scene import DirectionalLight, Material, Mesh, Scene, light_table, load_scene, material_table, merge
from refgi.scene.builtin.surfaces import rectangle, sphere
from refgi.settings import of
from refgi.splat import SiiSettings
from refgi.splat.sii.approximations import sii_ledger
from refgi.stress.changes import CHANGES
from refgi.truth import TruthSettings, VplSettings, vpl
from refgi.truth.imperfect import Imperfect, imperfect_maps
from refgi.truth.truth import trace_truth
from tests.cluster.lights import area_lights
from tests.cutouts import half_plate, heap, opaque, pierced
from tests.literal.whole.vpl import STREAM, draw
from tests.naive import cutouts as naive
from tests.naive.textures import barycentric
from tests.test_ledger import WHOLE, balance
from tests.truth.test_imperfect import _one_light

# a method's settings, and how much a picture of the strip that is cut out may differ from that of its mesh, of the mean
METHODS: dict[str, tuple[dict[str, Any], float]] = {
    "sii": ({"lights": 200}, 1e-3), "multires": ({"lights": 64}, 1e-3), "gather": ({"samples": 100}, 1e-3),
    "hssil": ({}, 1e-3), "val": ({"lights": 100, "clusters_count": 8}, 5e-3), "vpl": ({"lights": 100}, 1e-3),
    "truth": ({"samples": 16}, 1e-3)}
pytestmark = pytest.mark.filterwarnings("ignore:.*of the indirect light:refgi.errors.RefgiWarning")  # of few lights
SILHOUETTE = 5e-4  # share of texels so near an edge that float32 sees another triangle
NEAR_MASK = 1e-4  # of a cutoff


def picture(method: str, scene: Scene, **extra: Any) -> np.ndarray:
    found = find_method(method)
    settings = of(found.settings, **{**METHODS[method][0], **extra})
    return np.asarray(found.function(Frame(scene, rsm_resolution=64), settings), np.float64)


@pytest.mark.feature("REF-28")
@pytest.mark.parametrize("method", METHODS)
def test_a_strip_that_is_cut_out_is_a_strip(method: str, evidence: Callable[[str], None]) -> None:
    """Edges between texels, where alpha crosses the cutoff: the picture of the mesh but for rounding."""
    cut, mesh, none = (picture(method, pierced(part)) for part in ("cut", "mesh", "none"))
    mean = mesh.mean()
    off, effect = np.abs(cut - mesh).mean() / mean, np.abs(none - mesh).mean() / mean
    evidence(f"{method}: off by {off:.1e} of the mean in the mean; the strip changes {effect:.2f}")
    assert off < METHODS[method][1]
    assert effect > 0.02


@pytest.mark.feature("REF-28")
@pytest.mark.parametrize("method", METHODS)
def test_a_hole_as_a_whole_changes_no_bit(method: str) -> None:
    np.testing.assert_array_equal(picture(method, pierced("hole")), picture(method, pierced("none")))


@pytest.mark.feature("REF-28")
@pytest.mark.slow("extra2")
@pytest.mark.parametrize("extra", [
    {"source": "walk"}, {"maps_renderer": "rays"}, {"maps": "imperfect", "maps_points": 2000}])
def test_other_ways_to_see_pass_holes_too(extra: dict[str, Any]) -> None:
    method = "sii" if "source" in extra else "val" if "maps_renderer" in extra else "vpl"
    hole, none, solid = (picture(method, pierced(part), **extra) for part in ("hole", "none", "mesh"))
    if method == "vpl":  # a map's points lie all over the scene, those in holes are left out
        assert np.abs(hole - none).mean() < 0.5 * np.abs(hole - solid).mean()
    else:
        np.testing.assert_array_equal(hole, none)
    assert (solid != none).any()


@pytest.mark.feature("REF-28")
@pytest.mark.parametrize("estimator", ["combined", "light", "hemisphere"])
def test_both_estimators_of_the_truth_pass_holes(estimator: str) -> None:
    settings = TruthSettings(samples=16, estimator=estimator)
    hole, none, cut, mesh = (trace_truth(Frame(pierced(part), rsm_resolution=32), settings).mean
                             for part in ("hole", "none", "cut", "mesh"))
    np.testing.assert_array_equal(hole, none)
    assert np.abs(cut - mesh).mean() < 1e-3 * mesh.mean()
    assert np.abs(none - mesh).mean() > 0.02 * mesh.mean()


@pytest.mark.slow("float64")
@pytest.mark.feature("REF-28")
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_flux_behind_a_plate_that_is_half_hole(dtype: type, evidence: Callable[[str], None]) -> None:
    """A point light 1 m above a plate of 40 x 40 m, its half x < 0 a hole; 1 m below it a floor of the same size.

    A rectangle a x b whose corner lies at the distance d below the light spans atan(a b / (d sqrt(a^2 + b^2 + d^2))).
    """
    frame = Frame(half_plate(), rsm_resolution=512, dtype=dtype)
    rsm, power = frame.rsms[0], 8.0 * 0.5
    flux, seen = rsm.flux.astype(np.float64), rsm.triangle_id
    through, stopped = (flux[:, (seen >= low) & (seen < low + 2)].sum(axis=1) for low in (0, 2))

    def corner(d: float) -> float:
        return math.atan(20.0 * 20.0 / (d * math.sqrt(2 * 20.0**2 + d * d)))

    expected = 2 * power * corner(2.0), 2 * power * corner(1.0)
    off = abs(through / expected[0] - 1).max(), abs(stopped / expected[1] - 1).max()
    evidence(f"through the hole: {off[0]:.1e} off the closed form; on the plate: {off[1]:.1e}")
    assert max(off) < 2e-3  # texels at the rims of plate and floor, 40 m wide
    lit = frame.direct.max(axis=0) > 0
    on_floor = (frame.gbuffer.triangle_id < 2) & frame.gbuffer.covered
    x = frame.gbuffer.position[0]
    clear = np.abs(x) > 0.05
    np.testing.assert_array_equal(lit[on_floor & clear], (x < 0)[on_floor & clear])


@pytest.mark.feature("REF-28")
@pytest.mark.parametrize("settings", [{}, {"filtered": True, "pattern": "grid", "lights": 64}, {"source": "walk"}])
def test_the_ledger_closes_on_leaves(settings: dict[str, Any], evidence: Callable[[str], None]) -> None:
    frame = Frame(load_scene("leaf_grid"), width=48, height=48, rsm_resolution=128)
    ledger = sii_ledger(frame, of(SiiSettings, **settings))
    evidence(f"{settings}: {balance(ledger):.1e} of the emitted power is missing")
    assert balance(ledger) <= WHOLE
    whole = sii_ledger(Frame(opaque(frame.scene), width=48, height=48, rsm_resolution=128), of(SiiSettings, **settings))
    assert np.abs(ledger.reflected - whole.reflected).max() > 0.01 * whole.reflected.max()


@pytest.mark.feature("REF-28")
def test_light_paths_meet_what_is_there() -> None:
    scene = load_scene("leaf_grid:leaves=200")
    lights = walk_lights(Tracer(scene.geometry), scene.geometry, material_table(scene.materials),
                         light_table(scene.lights), 400, bounces=2)
    shape, on_leaves = scene.geometry, 0
    corner = shape.vertices[shape.faces[shape.cut.face]]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    for place in lights.position.T:
        height = np.abs(((place - corner[:, 0]) * normal).sum(axis=1))
        for k in np.flatnonzero(height < 1e-5):
            weights = barycentric(corner[k], place + normal[k], -normal[k])
            if weights.min() > 1e-3:
                face = shape.cut.face[k]
                excess = naive.excess(scene.materials[shape.material_of_face[face]], *(weights @ shape.uv[face]))
                assert excess > -NEAR_MASK
                on_leaves += 1
    assert on_leaves > 100


@pytest.mark.feature("REF-28")
@pytest.mark.parametrize("rule", ["keep", "planes", "ball"])
def test_maps_of_area_lights_are_those_of_rays(rule: str, evidence: Callable[[str], None]) -> None:
    scene = load_scene("leaf_grid")
    areas = area_lights([[0.1, 0.05, 0.2], [0.4, 1.0, 0.1], [-0.9, 1.2, 0.3]],
                        [[0, 1, 0], [0, -1, 0.2], [1, 0, 0]], 0.2)
    drawn, traced, whole = (shadow_maps(shape, areas, of(ValSettings, maps_resolution=64, maps_renderer=kind,
                                                         near_geometry=rule).maps, np.float32)
                            for shape, kind in ((scene.geometry, "raster"), (scene.geometry, "rays"),
                                                (opaque(scene).geometry, "raster")))
    assert drawn.left_out == traced.left_out
    a, b = drawn.depth, traced.depth
    different = np.isfinite(a) != np.isfinite(b)
    both = np.isfinite(a) & np.isfinite(b)
    different[both] = np.abs(a[both] / b[both] - 1) > 2e-5
    changed = (np.nan_to_num(a, posinf=9.0) != np.nan_to_num(whole.depth, posinf=9.0)).mean()
    evidence(f"{rule}: {different.mean():.1e} of texels differ from rays; {changed:.2f} differ without holes")
    assert different.mean() < SILHOUETTE
    assert changed > 0.1


@pytest.mark.slow
def test_points_of_imperfect_maps_lie_on_what_is_there() -> None:
    """A light at 1 m below the plate sees points on its half alone, as many as the share of its area says."""
    scene = half_plate(size=4.0)
    plate = dataclasses.replace(scene.geometry, faces=scene.geometry.faces[2:], uv=scene.geometry.uv[2:],
                                material_of_face=scene.geometry.material_of_face[2:])
    lights = _one_light((0, 0, 0), (0, 1, 0))
    found = imperfect_maps(plate, lights, Imperfect(points=4000, resolution=64, splat=0.0)).depth[0]
    whole = imperfect_maps(dataclasses.replace(plate, cut_outs=None), lights,
                           Imperfect(points=4000, resolution=64, splat=0.0)).depth[0]
    seen, both = np.isfinite(found), np.isfinite(whole)
    assert (~seen | both).all()
    assert seen.sum() == pytest.approx(0.5 * both.sum(), rel=0.1)
    rows, columns = np.nonzero(seen)
    assert min(columns.min(), rows.min()) < 14 <= max(columns.min(), rows.min()) == 32  # the half x > 0 alone


@pytest.mark.feature("REF-17", "REF-28")
def test_imperfect_maps_hold_the_points_that_are_there() -> None:
    """Oracle: the literal text's points, without those where alpha is below the cutoff, on the literal text's map."""
    scene, settings = heap(), Imperfect(points=600, resolution=32)
    shape, lights = scene.geometry, _one_light((0.1, -0.3, 0.2), (0.0, 0.6, 0.8))
    given = np.asarray(shape.vertices, float), shape.faces
    shift = np.array([[draw(0, STREAM, c) for c in range(3)]])
    place, face, radius = imperfect.scattered_points(*given, shift, settings.points)
    corner = given[0][shape.faces[face[0]]]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    uv = [barycentric(*one) @ shape.uv[f] for *one, f in zip(corner, place[0] + normal, -normal, face[0], strict=True)]
    there = np.array([naive.excess(scene.materials[shape.material_of_face[f]], *at) >= 0
                      for f, at in zip(face[0], uv, strict=True)])
    assert 0.2 < there.mean() < 0.9
    expected = imperfect.depth_maps(*given, place[:, there], face[:, there], radius, lights.position,
                                    imperfect.map_frames(lights.normal), settings.resolution)
    np.testing.assert_allclose(imperfect_maps(shape, lights, settings).depth, expected, rtol=1e-6)


@pytest.mark.feature("REF-28")
def test_shadows_of_leaves_by_map_and_by_rays(evidence: Callable[[str], None]) -> None:
    """They differ where an edge of a shadow goes through a texel of the map or its neighbours."""
    scene = load_scene("leaf_grid")
    shares = []
    for size in (256, 1024):
        by_map, by_rays = (Frame(scene, width=192, height=192, rsm_resolution=size, shadows=how)
                           for how in ("map", "exact"))
        differ = (by_map.direct.max(axis=0) > 0) != (by_rays.direct.max(axis=0) > 0)
        row, column, _ = by_map.rsms[0].project(by_map.gbuffer.position[:, differ])
        ids = np.pad(by_map.rsms[0].triangle_id, 2, mode="edge")
        within = ~np.isnan(row)
        lines, columns = (np.floor(part[within]).astype(int) for part in (row, column))
        around = np.stack([ids[2 + lines + i, 2 + columns + j] for i in range(-2, 3) for j in range(-2, 3)])
        assert (around != around[0]).any(axis=0).mean() > 0.999
        shares.append(differ.sum() / (by_rays.direct.max(axis=0) > 0).sum())
    evidence(f"{shares[0]:.1%} of lit pixels differ at 256 texels a side, {shares[1]:.1%} at 1024")
    assert shares[1] < 0.45 * shares[0]


@pytest.mark.parametrize("name", ["faces permuted", "faces unwelded", "faces doubled", "faces split", "mirrored",
                                  "hidden plane"])
def test_changes_of_a_scene_keep_its_holes(name: str) -> None:
    scene = pierced("cut") if name == "hidden plane" else heap(18)
    change = next(one for one in CHANGES if one.name == name)
    made = change.apply(scene, 48, 40)
    one, other = (Frame(each, dtype=np.float64, width=48, height=40).gbuffer for each in (scene, made.scene))
    depth = made.back(other.depth, light=False)
    assert (np.isfinite(one.depth) != np.isfinite(depth)).sum() <= 2
    both = np.isfinite(one.depth) & np.isfinite(depth)
    assert (np.abs(one.depth[both] - depth[both]) > 1e-6).sum() <= 2
    assert (one.depth != Frame(opaque(scene), dtype=np.float64, width=48, height=40).gbuffer.depth).any()


def test_light_that_leaves_glass_passes_holes_before_it() -> None:
    """A sheet that is one hole under a glass ball, and its lobes stay; a whole sheet inside takes them."""
    glass = Material("glass", (0.0, 0.0, 0.0), ior=1.5)
    ball = sphere((0.0, 0.0, 0.0), 0.1, 5000, glass, "ball")
    lobes = {}
    hole = Material("sheet", alpha=0.1, cutoff=0.5)
    for kind, material in (("none", None), ("hole", hole), ("whole", Material("sheet"))):
        meshes: list[Mesh] = [ball]
        if material is not None:
            meshes.append(rectangle((-0.05, 0.01, 0.05), (0.1, 0, 0), (0, 0, -0.1), material, "sheet"))
        geometry, materials = merge(meshes, smooth=True)
        table = material_table(materials)
        down = DirectionalLight((0.0, -1.0, 0.0), (1.0, 1.0, 1.0))
        rsm = reflective_shadow_map(geometry, table, down, 64, np.float64)
        for mode in ("back_face", "two_interface"):
            tracer = Tracer(geometry) if mode == "two_interface" else None
            lobes[kind, mode] = refracted(rsm, geometry, table, mode, 1e4, tracer=tracer).lobe_flux
    for mode in ("back_face", "two_interface"):
        np.testing.assert_array_equal(lobes["hole", mode], lobes["none", mode])
        assert lobes["whole", mode].sum() < 0.95 * lobes["none", mode].sum()


@pytest.mark.slow
def test_imperfect_maps_are_smaller_than_nothing_blocked() -> None:
    free, mapped = (vpl(Frame(pierced("cut"), rsm_resolution=32), of(VplSettings, lights=50, **how))
                    for how in ({"visibility": False}, {"maps": "imperfect"}))
    assert (mapped <= free * (1 + 1e-6)).all()
