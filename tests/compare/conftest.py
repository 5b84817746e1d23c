"""A comparison made by hand: three methods with known errors, no rendering."""

import dataclasses
from typing import NamedTuple

import numpy as np
import pytest

from refgi.compare.metrics import Flip
from refgi.compare.outcome import Comparison, MethodResult, Reference, measure
from refgi.scene import Camera, Geometry, Material, Scene, SpotLight
from refgi.stages import Run


@dataclasses.dataclass(frozen=True)
class Knobs:
    lights: int | None = 1024
    pattern: str = "grid"


class Row(NamedTuple):
    name: str
    watts: np.ndarray
    meaning: str
    is_part: bool


class Account:
    """A ledger made by hand: 8 W out, 6 and 2.5 W spent, so off by -0.5 W."""

    rows = (Row("emitted", np.array([2.0, 4.0, 2.0]), "by all", False),
            Row("off_screen", np.array([1.0, 3.0, 2.0]), "met <nothing>", True),
            Row("subtotal", np.array([1.0, 1.0, 1.0]), "on the way", False),
            Row("arrived", np.array([1.0, 1.5, 0.0]), "on the screen", True))
    difference = np.array([0.0, -0.5, 0.0])


@pytest.fixture
def scene():
    return make_scene()


def make_scene():
    triangle = Geometry(np.eye(3), np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32))
    return Scene("made_by_hand", triangle, (Material(),), Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0)),
                 (SpotLight((0.0, 2.0, 0.0), (0.0, -1.0, 0.0), 0.3, 0.5, (9.0, 9.0, 9.0)),), "A <test> & nothing else.")


@pytest.fixture
def comparison(scene):
    return make_comparison(scene)


def make_comparison(scene, height=36, width=48):
    rng = np.random.default_rng(4)
    y, x = np.mgrid[0:height, 0:width] / height
    covered = (x - 0.65) ** 2 + (y - 0.5) ** 2 < 0.24
    ideal = np.stack([1 + np.sin(5 * x), 1 + np.cos(4 * y), 0.5 + 0.4 * x]) * covered
    variance = (0.02 * ideal) ** 2
    noisy = ideal + rng.standard_normal(ideal.shape) * np.sqrt(variance)
    brighter = noisy * 1.3
    runs = (Run("rsm", "ran", 0.012, 0), Run("pairs.sum", "ran", 0.2, 1),
            Run("pairs.lobes", "skipped", reason="no glossy material"))
    samples = np.full((height, width), 64)
    references = {name: Reference(name, Knobs(), mean, variance, np.full(3, 4e-6), samples, mean / 4, 2.5, runs,
                                  estimate={"estimate": {"passes": 2}})
                  for name, mean in (("truth", noisy), ("unoccluded", brighter))}

    def result(name, irradiance, judges, seconds, flip):
        against = {j: measure(irradiance, references[j].irradiance, variance, covered, references[j].mean_variance)
                   for j in judges}
        return MethodResult(name, f"what {name} is", Knobs(), irradiance.astype(np.float32),
                            (irradiance / 4).astype(np.float32), seconds, runs, against, flip)

    results = {
        "sii": result("sii", ideal * 1.3, ("truth", "unoccluded"), 0.21, Flip(0.08, None, (-1.0, 2.0, 3))),
        "gather": result("gather", ideal * 1.6 - 0.2 * covered, ("truth", "unoccluded"), 0.55, Flip(skipped="no")),
        "vpl": result("vpl", ideal, ("truth",), 1.4, Flip(0.004, None, (-1.0, 2.0, 3))),
    }
    results["sii"] = dataclasses.replace(results["sii"], ledger=Account())
    environment = {"versions": {"refgi": "0.1.0", "python": "3.11", "flip-evaluator": None}, "platform": "Linux x86_64",
                   "cpu": "generic", "simd": ["avx2"], "threads": 2}
    return Comparison(scene, width, height, {"dtype": "float32", "rsm_resolution": 512, "shadows": "map"}, covered,
                      references, results, {}, environment)
