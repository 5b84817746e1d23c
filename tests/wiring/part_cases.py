"""Cases of settings that several methods share, to be taken over by `under`: of pixel lights, pairs, ambient occlusion
and shadows of clusters; `shadow_cases("visibility")` are those of `val`.
"""

from tests.wiring.cases import Case

# 14, 13 and 13 of three lamps, which the grid rounds to 16, 6 (one on each face) and 16
LIGHT_BASE = {"count": 40}
LONG_RAYS = {"openness.radius": 1.0}  # the default's leave most lights open
WARP_A, WARP_B = ({"source.warp": name, "source.warp.levels": 4} for name in "AB")


LIGHT_CASES = {
    "more lights": Case({"count": 100}),
    "another seed": Case({"seed": 7}),
    "a grid": Case({"source.pattern": "grid"}),
    "every texel": Case({"source.pattern": "all"}),
    "cubes of every lamp": Case({"source.projection": "cube"}, {"source.pattern": "grid", "count": 120}),
    "nearest texels of paraboloids": Case({"source.projection": "paraboloid"}, {"source.filtered": True}),
    "paraboloids by A": Case({"source.projection": "paraboloid"}, WARP_A),
    "random texels": Case({"source.pattern": "random"}),
    "random texels by another seed": Case({"seed": 3}, {"source.pattern": "random"}),
    "cells of a grid": Case({"source.filtered": True}, {"source.pattern": "grid", "count": 60}),
    "nearest texels": Case({"source.filtered": True}),
    "nearest texels of a warped pattern": Case({"source.filtered": True}, WARP_A),
    "nearest texels of a warped grid": Case({"source.filtered": True}, {**WARP_A, "source.pattern": "grid"}),
    "warp A": Case({"source.warp": "A"}),
    "warp B": Case({"source.warp": "B"}),
    "a warped grid": Case({"source.warp": "A"}, {"source.pattern": "grid"}),
    "a level of A": Case({"source.warp.levels": 1}, {"source.warp": "A"}),
    "levels of B": Case({"source.warp.levels": 5}, {"source.warp": "B"}),
    "peaks by A": Case({"source.warp.importance": "peak"}, WARP_A),
    "peaks by B": Case({"source.warp.importance": "peak"}, WARP_B),
    "printed peaks by A": Case({"source.as_published": frozenset({"sii_peak"})},
                               {**WARP_A, "source.warp.importance": "peak"}),
    "printed peaks by B, in the open": Case({"source.as_published": frozenset({"sii_peak"})},
                                            {**WARP_B, "source.warp.importance": "openness"}),
    "openness by A": Case({"source.warp.importance": "openness"}, WARP_A),
    "openness by B": Case({"source.warp.importance": "openness"}, WARP_B),
    "an even part of A": Case({"source.warp.defensive": 0.4}, WARP_A),
    "an even part of B": Case({"source.warp.defensive": 0.4}, WARP_B),
    "weights of A made to sum to N": Case({"source.warp.renormalise_weights": True}, WARP_A),
    "weights of B made to sum to N": Case({"source.warp.renormalise_weights": True}, WARP_B),
    "no refraction": Case({"source.refraction": None}, {"count": 200}, scene="glass"),
    "both interfaces of painted glass": Case({"source.refraction": "two_interface"}, {"count": 200},
                                             scene="painted glass"),
    "both interfaces": Case({"source.refraction": "two_interface"}, {"count": 200}, scene="glass"),
    "blunt lobes of backs": Case({"source.refraction.exponent": 40.0}, {"count": 200}, scene="smooth glass"),
    "blunt lobes of both": Case({"source.refraction.exponent": 40.0},
                                {"count": 200, "source.refraction": "two_interface"}, scene="smooth glass"),
    "without T/N": Case({"source.as_published": frozenset({"sii_no_tn"})}),
    "cells without T/N": Case({"source.as_published": frozenset({"sii_no_tn"})}, {"source.filtered": True}),
    "equal solid angles": Case({"source.as_published": frozenset({"equal_solid_angle"})}),
    "equal solid angles behind glass": Case({"source.as_published": frozenset({"equal_solid_angle"})}, {"count": 200},
                                            scene="glass"),
    "equal solid angles behind both interfaces": Case(
        {"source.as_published": frozenset({"equal_solid_angle"})},
        {"count": 200, "source.refraction": "two_interface"}, scene="glass"),
    "cells behind glass": Case({"source.filtered": True}, {"count": 200}, scene="glass"),
    "peaks behind glass": Case({"source.warp.importance": "peak"}, WARP_A, scene="glass"),
    "light paths": Case({"source": "walk"}),
    "three bounces": Case({"source.bounces": 3}, {"source": "walk"}),
    "shifted paths": Case({"seed": 5}, {"source": "walk", "source.bounces": 2}),
    "scaled flux": Case({"openness.flux": "scale"}, {"count": 200}),
    "flux scaled as printed": Case({"openness.as_published": frozenset({"sii_openness"})},
                                   {**LONG_RAYS, "openness.flux": "scale", "count": 200}),
    "scaled paths": Case({"openness.flux": "scale"}, {"source": "walk", "source.bounces": 2}),
    "roulette": Case({"openness.flux": "roulette"}, {**LONG_RAYS, "count": 200}),
    "roulette by another seed": Case({"seed": 2}, {**LONG_RAYS, "count": 200, "openness.flux": "roulette"}),
    "roulette of paths": Case({"openness.flux": "roulette"}, {**LONG_RAYS, "source": "walk"}),
    "long rays": Case({"openness.radius": 1.0}, {"openness.flux": "scale"}),
    "rays by another seed": Case({"seed": 2}, {**LONG_RAYS, "openness.flux": "scale", "source.pattern": "grid"}),
    "rays of importance by another seed": Case({"seed": 2}, {**WARP_A, **LONG_RAYS, "source.pattern": "grid",
                                                             "source.warp.importance": "openness"}),
    "few rays": Case({"openness.rays": 5}, {**LONG_RAYS, "openness.flux": "scale"}),
    "few rays of importance": Case({"openness.rays": 5},
                                   {**WARP_A, **LONG_RAYS, "source.warp.importance": "openness"}),
    "long rays of importance": Case({"openness.radius": 1.0}, {**WARP_A, "source.warp.importance": "openness"}),
    "a higher floor": Case({"openness.floor": 0.6}, {**LONG_RAYS, "openness.flux": "roulette"}),
    "scaled flux behind glass": Case({"openness.flux": "scale"}, {**LONG_RAYS, "count": 200}, scene="glass"),
    "scaled flux of a smooth ball": Case({"openness.flux": "scale"}, {**LONG_RAYS, "count": 200}, scene="smooth"),
    "a smooth ball": Case({"count": 200}, scene="smooth"),
    "light paths on a smooth ball": Case({"source.bounces": 3}, {"source": "walk", "count": 100, "seed": 4},
                                         scene="smooth"),
    "light paths to glass": Case({"source.bounces": 2}, {"source": "walk", "count": 100}, scene="painted glass"),
    "a higher floor of importance": Case({"openness.floor": 0.6}, {**WARP_A, "source.warp.importance": "openness"}),
}


PAIR_CASES = {
    "no clamp": Case({"clamp": None}),
    "least distance": Case({"clamp": "distance", "clamp.value": 0.7}),
    "bounded geometry term": Case({"clamp": "geometry", "clamp.value": 0.4}),
    "discs": Case({"clamp": "disc"}, same="what is taken where nothing is said"),
    "spheres": Case({"clamp": "sphere", "clamp.value": 4.0}, scene="matte", frame={"width": 6, "height": 5}),
    "lights behind their surface": Case({"offset": 0.15}),
    "lobes as printed": Case({"lobe.norm": "none"}),
    "lobes without the clamp's share": Case({"lobe.norm": "full_lobe"}),
    "exponents that fall": Case({"lobe.widening": 1.2}),
    "exponents that fall, of full lobes behind their surface": Case(
        {"lobe.widening": 0.8, "lobe.norm": "full_lobe", "offset": 0.1}, over={"clamp": "disc"}),
    "diffuse flux as peak intensity": Case({"as_published": {"sii_no_pi"}}),
    "widening as printed": Case({"as_published": {"sii_widening"}}, over={"lobe.widening": 1.2}),
    "widening without a norm": Case({"as_published": {"sii_widening_unnorm"}}, over={"lobe.widening": 1.2}),
}
OCCLUSION_CASES = {
    "ambient occlusion": Case({"ambient_occlusion": "openness"}),
    "ambient occlusion by long rays": Case({"ambient_occlusion.radius": 1.0}, {"ambient_occlusion": "openness"}),
    "ambient occlusion by few rays": Case({"ambient_occlusion.rays": 5},
                                          {"ambient_occlusion": "openness", "lights.seed": 3}),
}


FEW = {"clusters.count": 4}
ONE = {"clusters.count": 1, "maps.near_distance": 0.1}


def few(values, over=None, **options):
    """Return a case with four area lights."""
    return Case(values, FEW | (over or {}), **options)


def shadow_cases(kind):
    """Return cases of clusters, area lights, maps and soft shadows, by the key that says the kind of the latter."""
    pcss, back = {kind: "pcss"}, {kind: "back_projection"}
    bias = f"{kind}.constant_bias"
    return {
        "more clusters": Case({"clusters.count": 7}),
        "distances as printed": few({"clusters.distance": "raw"}, {"clusters.normal_weight": 0.2}),
        "distances squared": few({"clusters.distance": "squared"}),
        "positions alone": few({"clusters.normal_weight": 0.0}),
        "normals first": few({"clusters.position_weight": 0.05}),
        "one round": few({"clusters.rounds": 1}),
        "principal axes": few({"area.axes": "pca"}),
        "least area": few({"area.axes": "min_area"}),
        "the longer side": few({"area.extent": "longer"}),
        "the shorter side": few({"area.extent": "shorter"}),
        "unbiased areas": few({"area.unbiased_area": True}),
        "foreshortened": few({"area.foreshortened": True}),
        "finer maps": few({"maps.resolution": 24}),
        "maps by rays": few({"maps.renderer": "rays"}, same="both renderers find the same distances"),
        "near geometry kept": few({"maps.near_geometry": "keep"}, {"maps.near_distance": 0.6}),
        "near planes left out": few({"maps.near_geometry": "planes"}, {"maps.near_distance": 0.5}),
        "a larger ball": few({"maps.near_distance": 0.9}),
        "walls in the maps": few({"maps.occluders_alone": False}),
        "a map behind": Case({"maps.behind": "dual_paraboloid"}, ONE),
        "rays from behind": Case({"maps.behind": "raytrace"}, ONE),
        "a map behind, PCSS": Case({"maps.behind": "dual_paraboloid"}, ONE | pcss),
        "a map behind, back projection": Case({"maps.behind": "dual_paraboloid"}, ONE | back),
        "rays from behind, back projection": Case({"maps.behind": "raytrace"}, ONE | back),
        "rays from behind, rays to the rectangle": Case({"maps.behind": "raytrace"},
                                                        {"clusters.count": 1, kind: "rays_rectangle"}),
        "near planes do not stop rays to the rectangle": few({"maps.near_geometry": "planes"},
                                                             {kind: "rays_rectangle"}),
        "PCSS": few(pcss),
        "PCF": few({kind: "pcf"}),
        "hard": few({kind: "hard"}),
        "back projection": few(back),
        "rays to the rectangle": few({kind: "rays_rectangle"}),
        "rays to pixel lights": few({kind: "rays_vpls"}),
        "two terms": few({f"{kind}.terms": 2}),
        "depths in metres": few({f"{kind}.depth_scale": "map"}),
        "depths to the scene's end": few({f"{kind}.depth_scale": "scene"}),
        "exact means": few({f"{kind}.prefilter": "brute"}),
        "a bias": few({f"{kind}.bias": 0.12}),
        "attenuated": few({f"{kind}.attenuation": 1.0}),
        "twice the series": few({f"{kind}.rescale": "scale2"}),
        "a plateau of one": few({f"{kind}.rescale": "plateau"}, {f"{kind}.attenuation": 1.0}),
        "8 and 16 bits": Case({f"{kind}.quantisation": "published"}, {"clusters.count": 6, "maps.near_distance": 0.6}),
        "8 and 16 bits, exact means": few({f"{kind}.quantisation": "published"}, {f"{kind}.prefilter": "brute"}),
        "blockers beside the cone": few({f"{kind}.cone": False}, pcss),
        "blockers' depth along the axis": few({f"{kind}.blocker_depth": "axial"}, pcss),
        "depth along the axis beside the cone": few({f"{kind}.blocker_depth": "axial"}, pcss | {f"{kind}.cone": False}),
        "a constant bias": few({bias: "constant_bias"}, pcss),
        "a larger constant bias": few({f"{bias}.value": 0.1}, pcss | {bias: "constant_bias"}),
        "a constant bias in metres": few({f"{bias}.scale": "map"}, pcss | {
            bias: "constant_bias", f"{bias}.value": 0.25, "maps.near_distance": 0.5}),
        "a constant bias of the scene": few({f"{bias}.scale": "scene"}, pcss | {bias: "constant_bias",
                                                                               f"{bias}.value": 0.1}),
        "a small kernel": few({f"{kind}.texels": 3}, {kind: "pcf"}),
        "the printed angle": few({"as_published": {"val_alpha"}}),
        "the printed square": few({"as_published": {"val_alpha_over_pi"}}),
        "the printed square, exact means": few({"as_published": {"val_alpha_over_pi"}}, {f"{kind}.prefilter": "brute"}),
        "the printed search": few({"as_published": {"val_search_solid_angle"}}),
    }
