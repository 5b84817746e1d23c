"""Cases of `PairSettings`, for every method that has them: `under("pairs", PAIR_CASES)`; and of ambient occlusion."""

from tests.wiring.cases import Case

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
