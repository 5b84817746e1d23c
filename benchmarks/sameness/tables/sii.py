"""What is varied of `sii`."""

from benchmarks.sameness.rows import Table, vary
from benchmarks.sameness.tables.lights import LIGHTS, OPENNESS, PAIRS

BOUNDS = "a bound changes no bit of the picture"
CUT = {"i_low": 0.05}

TABLE = Table({"lights": 96, "clamp": "none"}, [
    *PAIRS, *LIGHTS, *OPENNESS,
    vary("clamp", "none", same="what the cases start from"),
    vary("clamp", "disc"),
    vary("clamp", "auto"),
    vary("i_low", 0.05, 0.3),
    vary("reference_length", 0.3, **CUT),
    vary("irradiance_low", 0.02),
    vary("bound", "full", "quad", "ellipsoid", "mesh", same=BOUNDS, **CUT),
    vary("bound", "full", "ellipsoid", same=BOUNDS, half_resolution=True, **CUT),
    vary("mesh_faces", 8, 20, 320, 1280, same=BOUNDS, bound="mesh", **CUT),
    vary("mesh_faces", 8, 20, 320, bound="mesh", inflate=False, i_low=0.3),
    vary("mesh_faces", 1280, bound="mesh", inflate=False, i_low=0.3, same="hardly differs from 320 faces"),
    vary("inflate", False, bound="mesh", mesh_faces=20, **CUT),
    vary("stochastic_range", True, **CUT),
    vary("stochastic_range", True, irradiance_low=0.02),
    vary("seed", 7, pattern="grid", stochastic_range=True, **CUT),
    vary("as_published", "per_light_ilow", **CUT),
    vary("as_published", "per_light_ilow", stochastic_range=True, **CUT),
    vary("widening", 0.3, on=("stage", "ring"), **CUT),
    vary("lightcuts", "bounded", lights=500),
    vary("lightcuts.error", 0.3, lights=500, lightcuts="bounded"),
    vary("lightcuts", "none", same="few lights are summed in full in any case"),
    vary("quantisation", "published"),
    vary("compensation", "screen", clamp="geometry", clamp_value=2.0),
    vary("half_resolution", True),
    vary("half_resolution", True, **CUT),
])
