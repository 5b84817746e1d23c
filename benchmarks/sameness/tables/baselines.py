"""What is varied of `gather`, `vpl` and `truth`."""

from benchmarks.sameness.rows import Table, vary

BATCH = "pairs or rays held at a time change no bit"
GLOSSY = ("stage", "ring")
CAUSTIC = ("glass_ball", "ring")
CAUSTICS = {"caustics": True, "photons": 4096}

GATHER = Table({"samples": 96}, [
    vary("samples", 40),
    vary("radius", 0.1, 2.0),
    vary("seed", 7),
    vary("grid", 0, same="64 pixels are more than the picture has"),
    vary("grid", 8, 16, reach=0.3),
    vary("least_cosine", 0.5, 0.9999, grid=16, reach=0.3),
    vary("reach", 0.1, 0.3, grid=16),
    vary("offset", 0.02, -0.02),
    vary("as_published", "rsm_weight_squared"),
])

VPL = Table({"lights": 96}, [
    vary("lights", 64, 200, on=("cornell_box", "stage", "two_lamps")),
    vary("pattern", "grid", "all", "random", on=("cornell_box", "stage", "two_lamps")),
    vary("seed", 7),
    vary("seed", 7, pattern="random"),
    vary("filtered", True),
    vary("filtered", True, pattern="grid"),
    vary("visibility", False, on=("cornell_box", "stage", "ring")),
    vary("batch", 5000, same=BATCH),
    vary("maps", "imperfect", on=("cornell_box", "stage", "ring")),
    vary("points", 500, 3000, maps="imperfect"),
    vary("resolution", 32, maps="imperfect"),
    vary("splat", 0.3, maps="imperfect"),
    vary("levels", 2, maps="imperfect"),
    vary("bias", 0.5, maps="imperfect"),
    vary("seed", 7, maps="imperfect"),
    vary("batch", 5000, maps="imperfect", same=BATCH),
], {"as_published": "forms of the maps that `sii` has cases of"}, ("lights.source", "lights.openness"))

TRUTH = Table({"samples": 24}, [
    vary("estimator", "hemisphere", "light"),
    vary("samples", 72),
    vary("target_error", 0.9, samples=96),
    vary("visibility", False),
    vary("visibility", False, estimator="hemisphere"),
    vary("emitters", "seen"),
    vary("emitters", "seen", estimator="light"),
    vary("bounces", 3),
    vary("bounces", 3, estimator="hemisphere"),
    vary("caustics", True, on=CAUSTIC, photons=4096),
    vary("photons", 2048, on=CAUSTIC, **CAUSTICS),
    vary("bounces", 3, on=CAUSTIC, **CAUSTICS),
    vary("seed", 7),
    vary("seed", 7, on=CAUSTIC, **CAUSTICS),
    vary("light_grid", 16),
    vary("interleave", 2),
    vary("uniform_share", 0.9),
    vary("picks", 4),
    vary("directions", 3),
    vary("directions", 3, estimator="hemisphere"),
    vary("bound", 0.5, on=("cornell_box", *GLOSSY)),
    vary("batch", 5000, same=BATCH),
    vary("batch", 5000, on=CAUSTIC, same=BATCH, **CAUSTICS),
], {"seconds": "depends on the time that passes", "checkpoint": "writes a file and changes no picture"})

TABLES = {"gather": GATHER, "vpl": VPL, "truth": TRUTH}
