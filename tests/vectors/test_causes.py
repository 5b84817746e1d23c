"""Each hypothesis names its bug on an array that has it, and nothing is blamed on a bug that is not there."""

from types import SimpleNamespace

import numpy as np
import pytest

from refgi.vectors.causes import SEEN, Difference, explained
from refgi.vectors.kit import Asked
from tests.vectors.port import Port


def srgb(a):
    return np.where(a <= 0.0031308, 12.92 * a, 1.055 * np.maximum(a, 0) ** (1 / 2.4) - 0.055)


def running(a):
    """Return sums over the pixels of a picture, row by row; dark ones are skipped."""
    sums = np.cumsum(a.reshape(3, -1).astype(float), axis=1).reshape(a.shape)
    return np.where(a.any(axis=0), sums, 0)


def odd(a):
    """Return whether a pixel or point is one of some that lie in no one place of an axis."""
    side = np.add.outer(*map(np.arange, a.shape[-2:])) if a.ndim > 1 else np.arange(len(a))
    return side % 3 == 1


FLUX = "rsm.reflected_flux0.flux"
BUGS = [
    (FLUX, lambda a: a * np.pi, "pi times"),
    (FLUX, lambda a: a / (2 * np.pi), "1/(2 pi) times"),
    (FLUX, lambda a: a / (2 * np.pi), "a factor 2 pi is missing"),
    (FLUX, lambda a: a * 4, "a factor 4 too many"),
    (FLUX, lambda a: -a, "sign is turned"),
    (FLUX, lambda a: a * 1.234, "1.234 times"),
    (FLUX, lambda a: a * 256 / 42, "T/N of lights.texels0 times"),
    ("lights.pixel_lights.flux", lambda a: a * 42 / 256, "1/(T/N of lights.texels0) times"),
    (FLUX, lambda a: a * 1.00001, "too few digits"),
    ("rsm.surface.depth", lambda a: a + 0.25, "0.25 is added"),
    (FLUX, lambda a: a[:, ::-1], "rows run upwards"),
    (FLUX, lambda a: a[:, :, ::-1], "columns run leftwards"),
    (FLUX, lambda a: a[:, ::-1, ::-1], "both rows and columns"),
    (FLUX, lambda a: np.swapaxes(a, 1, 2), "rows and columns are exchanged"),
    (FLUX, lambda a: np.roll(a, 1, 2), "columns are shifted by one"),
    ("rsm.map_surface0.position", lambda a: 0.5 * (a + np.roll(a, 1, 1)), "half a texel off along rows"),
    (FLUX, lambda a: a[::-1], "in the order bgr"),
    (FLUX, lambda a: np.repeat(a[:1], 3, 0), "all channels hold red"),
    ("rsm.map_surface0.position", lambda a: a[[0, 2, 1]], "in the order xzy"),
    ("rsm.map_surface0.position", lambda a: a * np.array([1, 1, -1])[:, None, None], "z is mirrored"),
    ("rsm.map_surface0.position", lambda a: np.stack([a[0], -a[2], a[1]]), "y and z are exchanged"),
    (FLUX, lambda a: np.moveaxis(a, 0, -1).reshape(a.shape), "beside each other"),
    (FLUX, lambda a: a.ravel(order="F").reshape(a.shape), "in Fortran order, the first axis fastest"),
    (FLUX, lambda a: a.ravel().reshape(a.shape, order="F"), "the header says Fortran order"),
    ("rsm.surface.albedo", srgb, "encoded as sRGB"),
    ("rsm.surface.albedo", lambda a: a ** (1 / 2.2), "gamma of 1/2.2"),
    ("rsm.map_surface0.normal", lambda a: (a + 1) / 2, "packed as"),
    ("rsm.map_surface0.normal", np.abs, "absolute value"),
    ("rsm.map_surface0.position", lambda a: np.maximum(a, 0), "negative values are cut"),
    ("rsm.surface.depth", lambda a: 1 / a, "reciprocal"),
    (FLUX, lambda a: a.astype(">f4").view("<f4"), "bytes are swapped"),
    (FLUX, lambda a: a.astype(np.float16), "float16"),
    (FLUX, np.zeros_like, "nothing was written"),
    (FLUX, lambda a: np.full_like(a, 3), "all elements are 3"),
    (FLUX, lambda a: np.where(a > 0.01, np.nan, a), "are NaN"),
    ("lights.texels0.texel", lambda a: a + 1, "indices begin at 1"),
    ("lights.texels0.texel", lambda a: a % 16 * 16 + a // 16, "column by column"),
    ("rsm.visible_triangles", lambda a: np.where(a < 0, 0, a + 1), "one too high"),
    ("rsm.visible_triangles", lambda a: np.where(a < 0, 0, a), "none is marked by 0"),
    ("rsm.map_surface0.position", lambda a: a[:, [*range(8, 16), *range(8)]], "the right values in another order"),
    ("lights.pixel_lights.map_index", lambda a: 1 - a, "0 and 1 are exchanged"),
    ("lights.pixel_lights.map_index", lambda a: np.where(a == 0, 2, a), "every 0 is 2"),
    ("rsm.surface.depth", lambda a: np.where(np.isinf(a), 0, a), "0 in place of infinity"),
    ("lights.pixel_lights.lobe_exponent", lambda a: a[::-1], "lights are in reverse order"),
    ("pairs.sum", lambda a: running(a), "values are running sums: the accumulator is not cleared"),
    ("pairs.sum", lambda a: np.swapaxes(running(np.swapaxes(a, 1, 2)), 1, 2), "running sums, column by column"),
    ("rsm.surface.depth", lambda a: np.where(np.isinf(a), a, (100 - 10 / a) / 99.9),
     "a depth buffer's numbers (clip space) in place of linear depth, m: 1.001 - 0.1001 / z"),
    (FLUX, lambda a: np.stack([a[0], 1.7 * a[1], a[2]]), "at rgb 1 alone: every element is 1.7 times"),
    ("rsm.map_surface0.position", lambda a: a[[0, 1, 1]], "at xyz 2 alone: it holds xyz 1"),
    ("rsm.surface.albedo", lambda a: np.stack([a[0], a[1], srgb(a[2])]), "at rgb 2 alone: encoded as sRGB"),
    (FLUX, lambda a: np.where(odd(a), 3 * a, a), "every element that differs is 3 times what it should be"),
    (FLUX, lambda a: np.where(odd(a), -a, a), "every element that differs is of the wrong sign"),
    ("rsm.surface.depth", lambda a: np.where(odd(a), a - 0.5, a), "that differs is 0.5 too small: texel centres for"),
    ("lights.texels0.texel", lambda a: a + odd(a), "every element that differs is 1 too large: rounded to the near"),
]


@pytest.mark.parametrize(("array", "bug", "said"), BUGS)
def test_a_bug_is_named(kit, tmp_path, array, bug, said):
    port = Port(kit, "sii-warp-a", tmp_path)
    with np.errstate(all="ignore"):
        port.write(array, bug(port.arrays[array]))
    assert array in {one.name for one in port.first().arrays if one.verdict == "out"}
    causes = [one.cause for one in port.first().causes]
    assert any(said in one for one in causes), causes


def test_the_power_of_another_channel_is_named(kit, tmp_path):
    port = Port(kit, "sii-warp-a", tmp_path)
    case = next(one for one in kit.cases(Asked(cases=("sii-warp-a",))) if one.id == "sii-warp-a")
    red, green, _ = kit.array(case, "rsm.reflected_flux0.lamp.strength")
    assert abs(red / green - 1) > 0.05
    port.write(FLUX, port.arrays[FLUX] * np.array([1, red / green, 1])[:, None, None])
    causes = [one.cause for one in port.first().causes]
    name = "rsm.reflected_flux0.lamp.strength, red/green"
    assert f"at rgb 1 alone: every element is {name} times what it should be" in causes


def test_a_factor_is_named_where_all_elements_are_one_number(kit, tmp_path):
    """The crown's 3 pi r^2 / N without the 3: one number for all samples, as it should be."""
    port = Port(kit, "hssil-paper", tmp_path)
    name = "sssil.crown_samples1.weight"
    assert len(np.unique(port.arrays[name])) == 1
    port.write(name, port.arrays[name] / 3)
    first, *others = [one.cause for one in port.first().causes]
    assert any("a factor 3 is missing" in one for one in (first, *others[:1]))
    assert not first.startswith("all elements are")


def test_a_cause_of_one_array_of_several_says_which(kit, tmp_path):
    port = Port(kit, "sii-warp-a", tmp_path)
    port.write("rsm.surface.normal", port.arrays["rsm.surface.position"])
    port.write("rsm.surface.depth", 1.37 * port.arrays["rsm.surface.depth"] + np.float32(0.21))
    told = {one.cause: one.share for one in port.first().causes}
    assert told["in rsm.surface.normal: it holds rsm.surface.position"] == SEEN


def test_another_array_in_its_place_is_named(kit, tmp_path):
    port = Port(kit, "sii-warp-a", tmp_path)
    port.write("rsm.surface.normal", port.arrays["rsm.surface.position"])
    assert "it holds rsm.surface.position" in [one.cause for one in port.first().causes]


@pytest.mark.parametrize(("cases", "least"), [
    pytest.param(("pairs-glossy", "sii-warp-a"), 60, marks=pytest.mark.slow),
    pytest.param(("sii-three-lamps", "sii-warp-a", "sii-warp-b", "pairs-glossy"), 100, marks=pytest.mark.slow)])
def test_every_likely_bug_of_the_kit_is_told_by_the_checker(kit, tmp_path, cases, least):
    """The exporter keeps a sample of elements of each; here it is put over the right arrays, as a port has it."""
    told = seen = 0
    for case in cases:
        port = Port(kit, case, tmp_path / case)
        bugs = kit.bugs(port.case)
        for step in port.case.stages:
            for bug in bugs.of(step.name):
                if bug.blind or not bug.arrays:
                    continue
                for name in bug.arrays:
                    wrong = port.arrays[name].copy()
                    places, values, _ = bugs.told(bug, name, wrong)
                    wrong.reshape(-1)[places] = values
                    port.write(name, wrong)
                first = port.first()
                told += 1
                seen += first.stage == step.name and bug.cause in [one.cause for one in first.causes]
                for name in bug.arrays:
                    port.write(name, port.arrays[name])
    assert told > least
    assert seen >= 0.97 * told  # two bugs may have one effect, and three causes are told


def test_noise_has_no_cause(kit, tmp_path):
    port = Port(kit, "sii-warp-a", tmp_path)
    array = port.arrays["pairs.sum"]
    port.write("pairs.sum", array * np.random.default_rng(1).uniform(0.5, 1.5, array.shape))
    (only,) = port.first().causes
    assert only.cause.startswith("no known cause fits; ")
    assert only.share == 0.0


@pytest.mark.parametrize(("told", "wrong", "share"), [(10, 0, 1.0), (20, 0, 0.5), (5, 0, 0.5), (10, 3, 0.7)])
def test_a_hypothesis_is_as_good_as_its_weaker_side(told, wrong, share):
    """Ten of a thousand elements are doubled, `wrong` of these threefold; the hypothesis doubles the first `told`."""
    expected = np.arange(1, 1001, dtype=np.float64)
    ranks = np.arange(1000)
    got = expected * np.where(ranks < 10 - wrong, 2, np.where(ranks < 10, 3, 1))
    difference = Difference("x", SimpleNamespace(tier="T1"), expected, got, ranks < 10, np.full(1000, 1e-3))
    predicted = np.where(ranks < told, 2, 1) * expected
    assert explained(difference, predicted) == pytest.approx(share)
