"""One light and one receiver at a time, with what makes ports fail."""

import numpy as np

from refgi.pairs.steps import pairs
from refgi.types import Array
from refgi.vectors.recipe import Recipe
from refgi.vectors.recorded import record
from refgi.vectors.spec import Case

COUNT = 160


def diffuse() -> Case:
    """Return diffuse pairs: random ones, then coincident, grazing, behind, near, far, dim and bright ones."""
    return _pairs("pairs-diffuse", "one light, one receiver: random, coincident, grazing, behind, 1 mm to 1 km apart",
                  glossy=False)


def glossy() -> Case:
    """Return pairs with lobes: exponents of 0 to 1000, axes below the horizon of the surface, without diffuse part."""
    return _pairs("pairs-glossy", "one glossy light and one receiver: exponents 0 to 1000, purely glossy ones",
                  glossy=True)


QUICK = {"pairs-diffuse": diffuse, "pairs-glossy": glossy}
FULL: dict[str, object] = {}


def _pairs(id: str, what: str, *, glossy: bool) -> Case:
    random = np.random.default_rng(11)
    place, toward = random.normal(size=(3, COUNT)), _unit(random.normal(size=(3, COUNT)))
    apart = 10.0 ** random.uniform(-3, 3, COUNT)
    subnormal = np.s_[74:78]  # lights of such a flux, at distances that do not make it more: GPUs read it as 0
    apart[subnormal] = np.maximum(apart[subnormal], 10.0)
    receiver = place + apart * toward
    normal = _unit(0.4 * random.normal(size=(3, COUNT)) + toward)
    facing = _unit(0.4 * random.normal(size=(3, COUNT)) - toward)
    flux = 10.0 ** random.uniform(-4, 2, (3, COUNT))
    receiver[:, :8] = place[:, :8]  # coincident: no light, no NaN
    facing[:, 8:24] = _across(toward[:, 8:24]) - 1e-3 * toward[:, 8:24]  # grazing
    normal[:, 24:40] = _across(toward[:, 24:40]) + 1e-3 * toward[:, 24:40]
    facing[:, 40:52] *= -1  # behind the receiver
    normal[:, 52:64] *= -1  # behind the light
    facing[:, 64:70], normal[:, 64:70] = -facing[:, 64:70], -normal[:, 64:70]  # both
    flux[:, 70:74] = 0.0
    flux[:, subnormal] = 1e-40
    lobes: tuple[Array, ...] = ()
    if glossy:
        lobe = 10.0 ** random.uniform(-4, 2, (3, COUNT))
        axis, above = _unit(0.5 * random.normal(size=(3, COUNT)) + toward), _unit(normal)
        height = (axis * above).sum(axis=0)
        axis = np.where((height < 0) & (np.arange(COUNT) < 140), axis - 2 * height * above, axis)  # above the surface
        flux[:, 80:110] = 0.0  # purely glossy
        lobe[:, 110:120] = 0.0  # purely diffuse
        exponent = np.where(np.arange(COUNT) % 8 == 0, 0.0, 10.0 ** random.uniform(0, 3, COUNT))
        exponent[140:] = np.minimum(exponent[140:], 8.0)  # some axes lie below their surface
        lobes = lobe, axis, exponent
    recipe = Recipe(id, "pairs", what)
    record(recipe, lambda: pairs(receiver[:, None], _unit(facing)[:, None], place, _unit(normal), flux, *lobes))
    return recipe.case()


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=0))


def _across(vectors: Array) -> Array:
    """Return unit vectors across others."""
    other = np.where(np.abs(vectors[0]) < 0.5, 0, 1)
    helper = np.zeros_like(vectors)
    helper[other, np.arange(vectors.shape[1])] = 1.0
    return _unit(np.cross(vectors, helper, axis=0))
