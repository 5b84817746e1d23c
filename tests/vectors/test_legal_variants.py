"""Legal variants of a port raise no alarm: float64, float32, reordered and fused sums, tiles, half floats in T2."""

from itertools import permutations, product

import numpy as np
import pytest

from refgi.literal.pairs import lobe_norm
from refgi.vectors.cases import kit_cases
from refgi.vectors.check import ALL_WITHIN, Asked, check_output
from refgi.vectors.spec import as_read
from tests.vectors.literal_port import written

CASES = ("pairs-diffuse", "sii-halton", "sii-three-lamps", "sii-warp-a", "sii-warp-b", "sii-grid")


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("chained", [False, True])
@pytest.mark.parametrize("name", CASES)
def test_refgi_itself_in_either_type(kit, tmp_path, name, chained, real):
    """The production kernels as a port, outputs in their own type."""
    made = kit_cases("quick")[name]()
    entry = next(one for one in kit.cases(Asked(cases=(name,))) if one.id == name)
    known = {one: kit.array(entry, one) for one in entry.arrays}
    (tmp_path / name).mkdir()
    for step in made.stages:
        outputs = step.run(as_read(known, step.reads, real), real)
        for one in step.writes:
            np.save(tmp_path / name / f"{one}.npy", np.asarray(outputs[one]))
            if chained:
                known[one] = np.asarray(outputs[one])
    assert check_output(kit, tmp_path, Asked(chained=chained, cases=(name,))).exit_code == ALL_WITHIN


def single(x):
    return np.asarray(x, np.float32)


def forwards(terms):
    total = np.zeros(terms.shape[1:], np.float32)
    for term in terms:
        total += term
    return total


def pairwise(terms):
    while len(terms) > 1:
        odd = terms[-1:] if len(terms) % 2 else terms[:0]
        terms = np.concatenate([terms[0 : len(terms) - len(odd) : 2] + terms[1 : len(terms) : 2], odd])
    return terms[0]


def by_fours(terms):
    parts = [forwards(terms[k::4]) for k in range(4)]
    return (parts[0] + parts[2]) + (parts[1] + parts[3])


def compensated(terms):
    total, rest = np.zeros(terms.shape[1:], np.float32), np.zeros(terms.shape[1:], np.float32)
    for term in terms:
        added = term - rest
        grown = total + added
        rest, total = (grown - total) - added, grown
    return total


def terms_of(arrays, kind):
    """Return Eq. 2 of each light at each pixel in float32, (N, 3, h, w), in one of the ways that ports write it."""
    x, n = single(arrays["rsm.surface.position"]), single(arrays["rsm.surface.normal"])
    p, facing = (single(arrays[f"lights.pixel_lights.{key}"])[:, :, None, None] for key in ("position", "normal"))
    flux = single(arrays["lights.pixel_lights.flux"])[:, :, None, None] / single(np.pi)
    d = x[:, None] - p
    square = (d * d).sum(axis=0)
    if kind == "fused":  # products summed in a wider type and rounded once
        square = single((d.astype(np.float64) ** 2).sum(axis=0))
    if kind == "unnormalised":  # both dot products over r^4
        cosines = np.maximum(0, (facing * d).sum(axis=0)) * np.maximum(0, -(n[:, None] * d).sum(axis=0))
        return np.moveaxis(flux * (cosines / np.maximum(square * square, single(1e-30))), 1, 0)
    inverse = single(1) / np.sqrt(np.maximum(square, single(1e-30)))
    w = d * inverse
    cosines = np.maximum(0, (facing * w).sum(axis=0)) * np.maximum(0, -(n[:, None] * w).sum(axis=0))
    fall = inverse * inverse if kind == "reciprocal" else 1 / np.maximum(square, single(1e-30))
    return np.moveaxis(flux * (cosines * fall), 1, 0)


@pytest.mark.parametrize("order", [forwards, lambda t: forwards(t[::-1]), pairwise, by_fours, compensated,
                                   lambda t: forwards(t[np.random.default_rng(3).permutation(len(t))])])
@pytest.mark.parametrize("kind", ["plain", "fused", "unnormalised", "reciprocal"])
def test_sums_in_any_order(kit, tmp_path, kind, order):
    case = next(one for one in kit.cases(Asked(cases=("sii-halton",))))
    arrays = {name: kit.array(case, name) for name in case.arrays}
    total = np.where(arrays["rsm.visible_triangles"] >= 0, order(terms_of(arrays, kind)), 0)
    (tmp_path / case.id).mkdir()
    np.save(tmp_path / case.id / "pairs.sum.npy", total)
    result = check_output(kit, tmp_path, Asked(stages=("pairs.sum",), cases=("sii-halton",)))
    assert result.exit_code == ALL_WITHIN


def dot(a, b, order, fused):
    """Return a dot product in float32, summed in an order of components; fused: each step is rounded once."""
    first, *rest = order
    total = a[first] * b[first]
    for k in rest:
        total = single(a[k].astype(np.float64) * b[k] + total) if fused else total + a[k] * b[k]
    return total


@pytest.mark.parametrize("name", ["sii-three-lamps", "sii-warp-b"])
def test_fused_and_reordered_dot_products_of_lobes(kit, name):
    """What an exponent magnifies: coincident lights, cosines of lobes, by the inverse of a length or a division."""
    case = next(one for one in kit.cases(Asked(cases=(name,))))
    known = {one: kit.array(case, one) for one in case.arrays}
    light = {key: known[f"lights.pixel_lights.{key}"] for key in (
        "position", "normal", "flux", "lobe_flux", "lobe_axis", "lobe_exponent")}
    x, n = (known[f"rsm.surface.{key}"][:, None] for key in ("position", "normal"))
    p, m, axis = (light[key][:, :, None, None] for key in ("position", "normal", "lobe_axis"))
    exponent = light["lobe_exponent"][:, None, None]
    norm = single(lobe_norm((light["normal"] * light["lobe_axis"]).sum(axis=0).astype(float), light["lobe_exponent"]))
    limit, expected = kit.extra(case, case.arrays["pairs.sum"].bound), known["pairs.sum"]
    worst = 0.0
    for order, fused, inverse, fused_sum in product(permutations(range(3)), *[(False, True)] * 3):
        d = x - p
        square = dot(d, d, order, fused)
        length = np.sqrt(np.maximum(square, single(1e-30)))
        w = d * (single(1) / length) if inverse else d / length
        fall = np.maximum(0, -dot(n, w, order, fused)) / (square if fused else length * length)
        sent = np.maximum(0, dot(m, w, order, fused))
        lobe = np.where(sent > 0, np.maximum(0, dot(axis, w, order, fused)) ** exponent, 0) * norm[:, None, None] * fall
        total = np.zeros(expected.shape, np.float32)
        for k in range(len(exponent)):
            for key, part in (("flux", sent[k] * fall[k] / single(np.pi)), ("lobe_flux", single(lobe[k]))):
                added = light[key][:, k, None, None]
                total = single(added.astype(np.float64) * part + total) if fused_sum else total + added * part
        off = np.where(known["rsm.visible_triangles"] >= 0, np.abs(total.astype(float) - expected), 0)
        worst = max(worst, float((off / limit).max()))
    assert 0.05 < worst < 1


@pytest.mark.parametrize("tier", ["T2", "T2B"])
@pytest.mark.parametrize("name", CASES)
def test_few_bits_between_stages(kit, tmp_path, name, tier):
    """Buffers of 16 or 8 bits pass their tier and fail T1, each stage reading the kit's inputs rounded."""
    made = kit_cases("quick")[name]()
    entry = next(one for one in kit.cases(Asked(cases=(name,))) if one.id == name)
    (tmp_path / name).mkdir()
    steps = {one: step_of_bytes(kit, entry, one) if tier == "T2B" else None for one in entry.arrays}
    for step in made.stages:
        inputs = {one: kit.array(entry, one) for one in step.reads}
        inputs |= {one: in_few_bits(np.clip(inputs[one], -65504, 65504), steps[one]) for one in step.reads
                   if one not in step.exact and inputs[one].dtype.kind == "f"}
        outputs = step.run(inputs, np.float32)
        for one in step.writes:
            np.save(tmp_path / name / f"{one}.npy", in_few_bits(np.asarray(outputs[one]), steps[one]))
    assert check_output(kit, tmp_path, Asked(tiers={"": tier}, cases=(name,))).exit_code == ALL_WITHIN
    assert check_output(kit, tmp_path, Asked(cases=(name,))).exit_code != ALL_WITHIN


@pytest.mark.parametrize(("name", "kept"), [*((name, "") for name in (
    *CASES, "gather-spot", "multires-odd", "val-single", "hssil-ramp")), ("sii-halton", "lights.")])
def test_half_floats_that_later_stages_read(kit, tmp_path, name, kept):
    """A chain in which all, or lights alone, but what is exact is kept in half floats passes T2, and fails T1."""
    made = kit_cases("quick")[name]()
    entry = next(one for one in kit.cases(Asked(cases=(name,))) if one.id == name)
    known = {one: kit.array(entry, one) for one in entry.given}
    exact = {one for step in made.stages for one in step.exact}
    (tmp_path / name).mkdir()
    for step in made.stages:
        outputs = step.run(as_read(known, step.reads, np.float32), np.float32)
        for one in step.writes:
            array = np.asarray(outputs[one])
            known[one] = array if one in exact or not one.startswith(kept) else in_few_bits(array, None)
            np.save(tmp_path / name / f"{one}.npy", known[one])
    assert check_output(kit, tmp_path, Asked(chained=True, tiers={kept: "T2"}, cases=(name,))).exit_code == ALL_WITHIN
    assert check_output(kit, tmp_path, Asked(chained=True, cases=(name,))).exit_code != ALL_WITHIN


def step_of_bytes(kit, case, name):
    """Return (step, least value) where docs/vectors says that 8 bits keep an array, None elsewhere."""
    array, unit = kit.array(case, name), case.arrays[name].unit
    if array.dtype.kind != "f" or unit != "1" or not array.any() or np.abs(array).max() > 1:
        return None
    if np.quantile(np.abs(array[array != 0]), 0.9) < 0.1:
        return None
    return (1 / 255, 0) if array.min() >= 0 else (1 / 127, -1)


def in_few_bits(array, step):
    if array.dtype.kind != "f":
        return array
    if step is None:
        with np.errstate(over="ignore"):
            return array.astype(np.float16).astype(np.float32)
    return (step[0] * np.rint(np.clip(array, step[1], 1) / step[0])).astype(np.float32)


def test_tiles_in_any_order(kit, tmp_path):
    """The literal text's pixels are a picture whatever the order of tiles."""
    case = next(one for one in kit.cases(Asked(cases=("sii-grid",))))
    step = next(one for one in kit_cases("quick")["sii-grid"]().stages if one.name == "pairs.sum")
    arrays = {name: kit.array(case, name) for name in step.reads}
    right = written(step, arrays)["pairs.sum"]
    tiles = np.zeros_like(right)
    for column in range(0, right.shape[2], 4):
        for row in reversed(range(0, right.shape[1], 4)):
            here = {**arrays, "rsm.visible_triangles": np.full_like(arrays["rsm.visible_triangles"], -1)}
            block = np.s_[row : row + 4, column : column + 4]
            here["rsm.visible_triangles"][block] = arrays["rsm.visible_triangles"][block]
            tiles += written(step, here)["pairs.sum"]
    (tmp_path / case.id).mkdir()
    np.save(tmp_path / case.id / "pairs.sum.npy", tiles)
    assert check_output(kit, tmp_path, Asked(stages=("pairs.sum",), cases=("sii-grid",))).exit_code == ALL_WITHIN


@pytest.mark.parametrize("chained", [False, True])
@pytest.mark.parametrize("name", ["pairs-diffuse", "pairs-glossy"])
def test_subnormal_numbers_read_as_0(kit, tmp_path, name, chained):
    """NVIDIA's float32 arithmetic reads numbers below 2^-126 as 0, and writes 0 for them."""
    save_literal(kit, tmp_path, name, "pairs.pairs", lambda _, array: np.where(np.abs(array) < 2.0**-126, 0, array))
    assert check_output(kit, tmp_path, Asked(chained=chained, cases=(name,))).exit_code == ALL_WITHIN


@pytest.mark.parametrize("stage", ["cluster.mip_means0", "cluster.mip_means1"])
@pytest.mark.parametrize("name", ["val-csm", "val-empty", "val-rim"])
def test_coordinates_of_textures(kit, tmp_path, name, stage):
    """Places on a map as shares of it in float32, and texels' places from them by a fused operation, as GPUs do."""
    side = next(kit.array(one, "cluster.basis").shape[-1] for one in kit.cases(Asked(cases=(name,))))

    def read(array_name, array):
        if not array_name.endswith(".region"):
            return array
        share = single(0.5 * array[:, :2] + 0.5).astype(np.float64)
        place = single(share * side - 0.5)
        return np.concatenate([(place.astype(np.float64) + 0.5) / (0.5 * side) - 1, array[:, 2:]], axis=1)

    save_literal(kit, tmp_path, name, stage, read)
    assert check_output(kit, tmp_path, Asked(stages=(stage,), cases=(name,))).exit_code == ALL_WITHIN


def save_literal(kit, folder, name, stage, read):
    """Write what a stage's literal text makes in float64 of arrays as `read(name, array)` returns them."""
    step = next(one for one in kit_cases("quick")[name]().stages if one.name == stage)
    case = next(one for one in kit.cases(Asked(cases=(name,))) if one.id == name)
    arrays = {one: read(one, array) for one, array in as_read({one: kit.array(case, one) for one in step.reads},
                                                              step.reads, np.float64).items()}
    (folder / name).mkdir()
    for one, array in written(step, arrays).items():
        np.save(folder / name / f"{one}.npy", read(one, array))
