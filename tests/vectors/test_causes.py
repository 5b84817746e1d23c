"""Each hypothesis names its bug on an array that has it, and nothing is blamed on a bug that is not there."""

import numpy as np
import pytest

from refgi.vectors.kit import Asked
from tests.vectors.port import Port


def srgb(a):
    return np.where(a <= 0.0031308, 12.92 * a, 1.055 * np.maximum(a, 0) ** (1 / 2.4) - 0.055)


BUGS = [
    ("rsm0.flux", lambda a: a * np.pi, "pi times"),
    ("rsm0.flux", lambda a: a / (2 * np.pi), "1/(2 pi) times"),
    ("rsm0.flux", lambda a: a / (2 * np.pi), "a factor 2 pi is missing"),
    ("rsm0.flux", lambda a: a * 4, "a factor 4 too many"),
    ("rsm0.flux", lambda a: -a, "sign is turned"),
    ("rsm0.flux", lambda a: a * 1.234, "1.234 times"),
    ("rsm0.flux", lambda a: a * 6.4, "T/N of rsm0 times"),
    ("lights.flux", lambda a: a / 6.4, "1/(T/N of rsm0) times"),
    ("rsm0.flux", lambda a: a * 1.00001, "too few digits"),
    ("gbuffer.depth", lambda a: a + 0.25, "0.25 is added"),
    ("rsm0.flux", lambda a: a[:, ::-1], "rows run upwards"),
    ("rsm0.flux", lambda a: a[:, :, ::-1], "columns run leftwards"),
    ("rsm0.flux", lambda a: a[:, ::-1, ::-1], "both rows and columns"),
    ("rsm0.flux", lambda a: np.swapaxes(a, 1, 2), "rows and columns are exchanged"),
    ("rsm0.flux", lambda a: np.roll(a, 1, 2), "columns are shifted by one"),
    ("rsm0.position", lambda a: 0.5 * (a + np.roll(a, 1, 1)), "half a texel off along rows"),
    ("rsm0.flux", lambda a: a[::-1], "in the order bgr"),
    ("rsm0.flux", lambda a: np.repeat(a[:1], 3, 0), "all channels hold red"),
    ("rsm0.position", lambda a: a[[0, 2, 1]], "in the order xzy"),
    ("rsm0.position", lambda a: a * np.array([1, 1, -1])[:, None, None], "z is mirrored"),
    ("rsm0.position", lambda a: np.stack([a[0], -a[2], a[1]]), "y and z are exchanged"),
    ("rsm0.flux", lambda a: np.moveaxis(a, 0, -1).reshape(a.shape), "beside each other"),
    ("rsm0.flux", lambda a: a.ravel(order="F").reshape(a.shape), "in Fortran order, the first axis fastest"),
    ("rsm0.flux", lambda a: a.ravel().reshape(a.shape, order="F"), "the header says Fortran order"),
    ("gbuffer.albedo", srgb, "encoded as sRGB"),
    ("gbuffer.albedo", lambda a: a ** (1 / 2.2), "gamma of 1/2.2"),
    ("rsm0.normal", lambda a: (a + 1) / 2, "packed as"),
    ("rsm0.normal", np.abs, "absolute value"),
    ("rsm0.position", lambda a: np.maximum(a, 0), "negative values are cut"),
    ("gbuffer.depth", lambda a: 1 / a, "reciprocal"),
    ("rsm0.flux", lambda a: a.astype(">f4").view("<f4"), "bytes are swapped"),
    ("rsm0.flux", lambda a: a.astype(np.float16), "float16"),
    ("rsm0.flux", np.zeros_like, "nothing was written"),
    ("rsm0.flux", lambda a: np.full_like(a, 3), "all elements are 3"),
    ("rsm0.flux", lambda a: np.where(a > 0.01, np.nan, a), "are NaN"),
    ("rsm0.texel", lambda a: a + 1, "indices begin at 1"),
    ("rsm0.texel", lambda a: a % 16 * 16 + a // 16, "column by column"),
    ("gbuffer.triangle_id", lambda a: np.where(a < 0, 0, a + 1), "one too high"),
    ("gbuffer.triangle_id", lambda a: np.where(a < 0, 0, a), "none is marked by 0"),
    ("rsm0.position", lambda a: a[:, [*range(8, 16), *range(8)]], "the right values in another order"),
    ("lights.map", lambda a: 1 - a, "0 and 1 are exchanged"),
    ("lights.map", lambda a: np.where(a == 0, 2, a), "every 0 is 2"),
    ("gbuffer.depth", lambda a: np.where(np.isinf(a), 0, a), "0 in place of infinity"),
    ("lights.lobe_exponent", lambda a: a[::-1], "lights are in reverse order"),
    ("rsm0.flux", lambda a: np.stack([a[0], 1.7 * a[1], a[2]]), "at rgb 1 alone: every element is 1.7 times"),
    ("rsm0.position", lambda a: a[[0, 1, 1]], "at xyz 2 alone: it holds xyz 1"),
    ("gbuffer.albedo", lambda a: np.stack([a[0], a[1], srgb(a[2])]), "at rgb 2 alone: encoded as sRGB"),
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
    red, green, _ = kit.array(case, "light0.intensity")
    assert abs(red / green - 1) > 0.05
    port.write("rsm0.flux", port.arrays["rsm0.flux"] * np.array([1, red / green, 1])[:, None, None])
    causes = [one.cause for one in port.first().causes]
    assert "at rgb 1 alone: every element is light0.intensity, red/green times what it should be" in causes


def test_another_array_in_its_place_is_named(kit, tmp_path):
    port = Port(kit, "sii-warp-a", tmp_path)
    port.write("gbuffer.normal", port.arrays["gbuffer.position"])
    assert "it holds gbuffer.position" in [one.cause for one in port.first().causes]


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
                    places, values = bugs.told(bug, name, wrong)
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
    array = port.arrays["sum.irradiance"]
    port.write("sum.irradiance", array * np.random.default_rng(1).uniform(0.5, 1.5, array.shape))
    (only,) = port.first().causes
    assert only.cause.startswith("no known cause fits; ")
    assert only.share == 0.0
