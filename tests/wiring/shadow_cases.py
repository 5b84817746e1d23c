"""Cases of shadows of clusters, for every method that has them: `shadow_cases("visibility")` are those of `val`."""

from tests.wiring.cases import Case

FEW = {"clusters.count": 4}
ONE = {"clusters.count": 1, "maps.near_distance": 0.1}


def few(values, over=None, **options):
    """Return a case with four area lights."""
    return Case(values, FEW | (over or {}), **options)


def shadow_cases(kind):
    """Return cases of clusters, area lights, maps and soft shadows, by the key that says the kind of the latter."""
    pcss, back = {kind: "pcss"}, {kind: "back_projection"}
    adaptive = {"clusters": "adaptive", "clusters.target_error": 0.073, "maps.near_distance": 0.6, **pcss}

    def tried(values):  # on flat walls such a target takes nearly every light, whose clusters no key changes
        return Case(values, adaptive, scene="tilted")

    bias = f"{kind}.constant_bias"
    return {
        "more clusters": Case({"clusters.count": 7}),
        "distances as printed": few({"clusters.distance": "raw"}, {"clusters.normal_weight": 0.2}),
        "distances squared": few({"clusters.distance": "squared"}),
        "positions alone": few({"clusters.normal_weight": 0.0}),
        "normals first": few({"clusters.position_weight": 0.05}),
        "one round": few({"clusters.rounds": 1}),
        "as many as it takes": Case({"clusters": "adaptive"}),
        "adaptive, a lower target": tried({"clusters.target_error": 0.055}),
        "adaptive, as printed": tried({"clusters.distance": "raw"}),
        "adaptive, squared": tried({"clusters.distance": "squared"}),
        "adaptive, positions alone": tried({"clusters.normal_weight": 0.0}),
        "adaptive, normals first": tried({"clusters.position_weight": 0.05}),
        "adaptive, one round": tried({"clusters.rounds": 1}),
        "principal axes": few({"area.axes": "pca"}),
        "least area": few({"area.axes": "min_area"}),
        "the longer side": few({"area.extent": "longer"}),
        "the shorter side": few({"area.extent": "shorter"}),
        "unbiased areas": few({"area.unbiased_area": True}),
        "foreshortened": few({"area.foreshortened": True}),
        "single lights with their footprint": Case({"area.single_light": "footprint"}, {"clusters.count": 40, **pcss}),
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
