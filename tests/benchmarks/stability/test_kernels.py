"""The oracle ladders: references against closed forms, faults put into kernels that must show, one case again."""

import math

import mpmath
import numpy as np
import pytest

from benchmarks.stability import again, elementary_range, kernels, lobes, pairs, places
from benchmarks.stability import ladder as ladders
from benchmarks.stability.kernels import tasks
from benchmarks.stability.ladder import conditions, errors, inputs_of, measure, rows
from benchmarks.stability.promise import (
    BLOCK,
    DIGITS,
    EXTENDED,
    any_size,
    around,
    block_of,
    directions,
    sizes,
    spacing,
    trusted,
)

pytestmark = pytest.mark.slow  # tests/benchmarks/test_smoke.py runs a task of each part

KNOWN = kernels.ladders()
CASES = 2048  # enough for each fault below; 1e5 in the short form


def formula(name, *numbers):
    return [float(one[0]) for one in KNOWN[name].formula(DIGITS.of(np.array(numbers, float)[:, None]))]


def figure(name, run, real="float32", count=CASES):
    """Return the figure of a kernel that is replaced, over its limit."""
    ladder = KNOWN[name]._replace(run=run)
    return measure(ladder, EXTENDED if ladder.extended else DIGITS, real, 17, count).figure / ladder.limit


def test_references_agree_with_closed_forms():
    assert formula("eq2.term", 0, 0, 2, 0, 0, 1, 0, 0, 1) == [0.25]  # face to face, 1 / r^2
    assert formula("eq2.term", 0, 0, 2, 0, 0, -1, 0, 0, 1) == [0]
    assert formula("eq2.clamped", 0, 0, 2, 0, 0, 1, 0, 0, 1, 16, 0, 1e9) == [1 / 16]  # least distance 4
    assert formula("eq2.clamped", 0, 0, 2, 0, 0, 1, 0, 0, 1, 0, 4, 1e9) == [1 / 8]
    assert formula("eq2.clamped", 0, 0, 2, 0, 0, 1, 0, 0, 1, 0, 0, 0.1) == [0.1]
    assert formula("lobe.gap", 1, 0, 0, 0, 7, 0) == [1]
    assert formula("lobe.gap", 1, 0, 0, -3, 0, 0) == [2]
    assert formula("lobe.power", 0.5, 3) == [0.125]
    assert formula("lobe.norm", 1, 1) == pytest.approx([1 / math.pi])  # K = 1
    assert formula("lobe.norm", 0, 1) == pytest.approx([2 / math.pi])  # K = 1/2
    assert formula("lobe.norm", -0.5, 1) == pytest.approx([4 / math.pi])  # K = (1 + cos) / 2
    disc = (0, 0, 0, 0, 0, 1, 0, 0, 3, 0, 0, 4, 2)  # R^2 = 8 at r = 3
    assert formula("crown.disc", *disc) == pytest.approx([8 / 17])
    assert formula("crown.texel", *disc) == pytest.approx([8 / 13])
    assert formula("crown.point", *disc) == pytest.approx([8 / 9])
    assert formula("crown.area", 2, 0.5, 3) == [24]
    assert formula("spot.edge", 0.5, 1) == [0.5]
    assert formula("spot.falloff", 0, 0, 1, 0, 0, 2, 0.5, 0.2) == [1]
    half = math.acos((math.cos(0.5) + math.cos(0.2)) / 2)
    assert formula("spot.falloff", math.sin(half), 0, math.cos(half), 0, 0, 2, 0.5, 0.2) == pytest.approx([0.5])
    assert formula("solid_angle.texel", 1, 1, 0, 0) == pytest.approx([2 * math.pi / 3])  # a face of a cube
    assert sum(formula("solid_angle.texel", 1, 2, i, j)[0] for i in (0, 1) for j in (0, 1)) == pytest.approx(
        2 * math.pi / 3)
    assert formula("val.step", 0.3, 0.3) == [0.5]
    series = 0.5 + 2 / math.pi * (1 - 1 / 3 + 1 / 5 - 1 / 7)  # Leibniz
    assert formula("val.step", 0, 0.5) == pytest.approx([series])
    assert formula("val.scale", 4, 1, 0.25, 0.9) == pytest.approx([0.5])
    assert formula("val.distance", 0.5, 3, 0.25) == pytest.approx([12])
    assert formula("val.filter_width", 1, 2, 1) == pytest.approx([0.25, math.tan(math.atan(0.5) / 2), 0.25])
    assert formula("map.paraboloid_ray", 1, 0) == [1, 0, 0]
    assert formula("map.cube", 2.0, 0, 0) == [512, 512, 2]
    assert formula("map.barycentric", 0, 0, 0, 0.25, 0.5, 1, 0, 0, 1, 1, 0, 1, 0, 1, 1) == [0.25, 0.5]  # of v1, v2
    assert formula("ray.offset", 1, -2, 4, 1) == [2.0**-19, 4 * 7 * 2.0**-24]
    assert formula("frame.basis", 0, 0, 1) == [1, 0, 0, 0, 1, 0]
    assert formula("val.z_avg", 0.9, *means_of(0.4)) == pytest.approx([0.4])
    assert formula("val.angle", 1, 0, 0, 0, 2, 0) == pytest.approx([math.pi / 2])
    assert formula("val.angle", 1, 0, 0, -1, 0, 0) == pytest.approx([math.pi])
    assert formula("hemisphere.cosine", 0.25, 0.25) == pytest.approx([0, 0.5, math.sqrt(0.75)])
    assert formula("bounds.tangent", 1) == pytest.approx([3**-0.75, 1 - 3**-0.75, 3**-0.25 * math.sqrt(2 / 3)])
    assert formula("bounds.tangent", 2) == pytest.approx([0.5] * 3)  # F^2 = x - x^2, a sphere
    # a floor seen along its normal: beside it 0, before it a / (a + b) = 1.5 / (1.5 + 1), on its normal 1
    floor = (0, 0, -1, 0, 0, 1)
    assert formula("hssil.height", *floor, 1, 0, -1, 0) == [0, 0]
    assert formula("hssil.height", *floor, 1, 0, 0.5, 0) == pytest.approx([0.6] * 2)
    assert formula("hssil.height", *floor, 1e-9, 0, -0.5, 0)[0] == pytest.approx(1)


def means_of(z):
    """Return the means over a filter all of whose texels are at z; with f(0.9 - 0.4) = 0 the mean is z."""
    c = [(2 * k - 1) * math.pi for k in (1, 2, 3, 4)]
    return [*(math.sin(a * z) for a in c), *(math.cos(a * z) for a in c), *(z * math.sin(a * z) for a in c),
            *(z * math.cos(a * z) for a in c), z]


def test_extended_numbers_have_their_bits():
    assert trusted()
    assert mpmath.mp.dps == 15  # the 50 digits are a context of their own
    assert np.sqrt(DIGITS.of(np.array([2.0])))[0] ** 2 - 2 < 1e-49
    x = np.array([0.0, 1.0, 1.5, 2.0, 3e38, 1e-40, -4.0])
    np.testing.assert_array_equal(spacing(x, np.float32), np.abs(np.spacing(x.astype(np.float32))).astype(float))


@pytest.mark.parametrize("name", [name for name, one in KNOWN.items() if one.extended and name != "val.z_avg"])
def test_both_references_agree(name):
    """Apart by a tenth at most of what one ULP of an input makes in float64."""
    ladder = KNOWN[name]
    x = inputs_of(ladder, 3, 0, "float64", 40)
    wide, exact = (ladder.formula(precision.of(x)) for precision in (EXTENDED, DIGITS))
    _, unit = errors(ladder, DIGITS, "float64", x, np.zeros((len(exact), 40)))
    condition = np.ones_like(unit) if not ladder.conditioned else conditions(ladder, DIGITS, "float64", x, unit)
    for k, (a, b) in enumerate(zip(wide, exact, strict=True)):
        apart = np.array([abs(float(DIGITS.of(float(p)) + DIGITS.of(float(p - np.longdouble(float(p)))) - q))
                          for p, q in zip(a, b, strict=True)])
        assert (apart <= 0.1 * (unit[k] * condition[k]).astype(float)).all()


def test_a_lobe_s_bound_has_its_digits_where_the_lobe_is_dark():
    """Senders seen from behind their axis: h = 2, where log(1 - h) is of no number."""
    x = np.array([0, 0, 2, 0, 0, 1, 0, 0, -1, 0, 0, 1, 3.0])[:, None]
    wide, exact = (lobes.term_bound(precision.of(x), np.float32) for precision in (EXTENDED, DIGITS))
    assert float(wide[0]) == pytest.approx(float(exact[0]), rel=1e-12)


def scaled(ladder, factor):
    return lambda x: ladder.run(x) * x.dtype.type(factor)


@pytest.mark.parametrize("name", sorted(set(KNOWN) - {"lobe.norm64", "spot.falloff32", "solid_angle.texel",
                                                      "map.barycentric"}))
def test_a_relative_fault_of_1e_5_shows_in_each_kernel(name):
    real = KNOWN[name].reals[0]
    count = CASES if KNOWN[name].extended else 100
    assert figure(name, KNOWN[name].run, real, count) <= 1
    assert figure(name, scaled(KNOWN[name], 1 + 1e-5), real, count) > 1


@pytest.mark.parametrize("name", ["lobe.norm64", "spot.falloff32", "solid_angle.texel", "map.barycentric"])
def test_a_relative_fault_of_1e_5_shows_in_float64(name):
    assert figure(name, KNOWN[name].run, "float64", 100) <= 1
    assert figure(name, scaled(KNOWN[name], 1 + 1e-5), "float64", 100) > 1


def pair(x, *, guard=True, once=True, single=np.float32):
    """Return Eq. 2 as plain NumPy, with faults."""
    d, light, receiver = x[:3], x[3:6], x[6:9]
    square = (d * d).sum(axis=0)
    with np.errstate(all="ignore"):
        if guard:
            square = np.maximum(square, single(1e-30))
        cl, cx = (np.maximum((d * n).sum(axis=0), 0) for n in (light, receiver))
        return (cl / square * (cx / square) if once else cl * cx / (square * square))[None]


def test_lost_guards_and_ranges_show():
    assert figure("eq2.term", pair) <= 1
    unguarded = KNOWN["eq2.term"]._replace(run=lambda x: pair(x, guard=False))
    assert measure(unguarded, EXTENDED, "float32", 17, CASES).bad > 0
    assert np.isnan(measure(unguarded, EXTENDED, "float32", 17, CASES).figure)
    assert not figure("eq2.term", lambda x: pair(x, once=False)) <= 1  # r^4 leaves the range of float32


def test_a_clamp_after_the_division_shows():
    def late(x):
        plain = KNOWN["eq2.term"].run(x[:9])
        return np.minimum(plain, x[11] + x[9] * 0)

    assert not figure("eq2.clamped", late) <= 1


def test_narrow_numbers_in_a_wide_kernel_show():
    for name in ("eq2.term", "crown.disc", "map.perspective", "val.step", "spot.falloff", "lobe.power"):
        count = CASES if KNOWN[name].extended else 100
        run = KNOWN[name].run
        assert figure(name, lambda x, run=run: run(x).astype(np.float32).astype(float), "float64", count) > 1


def test_cancellation_that_a_kernel_avoids_shows():
    def gap(x):
        w = x[3:6] / np.sqrt((x[3:6] ** 2).sum(axis=0))
        return (1 - (x[:3] * w).sum(axis=0))[None]

    assert figure("lobe.gap", gap) > 1
    with np.errstate(all="ignore"):
        assert figure("lobe.power", lambda x: np.exp2(x[1] * np.log2(np.maximum(1 - x[0], 1e-30)))[None]) > 1


def squares(x):
    """Heights with y from the root of d^2 - x^2."""
    p, n, s, thickness = x[:3], x[3:6], x[6:9], x[9]
    d, length = s - p, np.sqrt((p * p).sum(axis=0))
    facing, out = -(n * p).sum(axis=0) / length, []
    for share in (0 * thickness, thickness / np.sqrt((s * s).sum(axis=0))):
        back = d + share * s
        along, up = -(p * back).sum(axis=0) / length, (n * back).sum(axis=0)
        y = np.sqrt(np.maximum((back * back).sum(axis=0) - along * along, 0))
        a, b = np.maximum(up, 0) * y, facing * (along * along + y * y) - up * along
        part = a / np.maximum(a + abs(b), 1e-37)
        out.append(np.where((b < 0) & (a > 0), 2 - part, part))
    return np.stack(out).astype(x.dtype)


def short_series(x):
    turn = 4 * x[1]
    t = math.pi / 2 * (turn - np.floor(turn + 0.5))
    square = t * t
    cosine = 1 - square / 2 * (1 - square / 12 * (1 - square / 30))
    sine = np.sqrt(1 - cosine * cosine) * np.sign(t)
    c, s = (np.choose(np.floor(turn + 0.5).astype(int) % 4, choices)
            for choices in ([cosine, -sine, -cosine, sine], [sine, cosine, -sine, -cosine]))
    return np.sqrt(x[0]) * np.stack([c, s, np.zeros_like(s)]) + np.stack([0 * c, 0 * c, np.sqrt(1 - x[0])])


def cancelling(x):
    n = np.maximum(x[0], 2.0)
    below = -4 / (n + 2)
    power = below * math.log(0.71)
    slope = 1 - (1 + below) * np.exp(power)
    half = (0.71 + 0.71 * np.expm1(power) / slope) / 2
    out = np.stack([half, half, half * np.sqrt(np.maximum(slope, 0))])
    return np.where(x[0] < 2, places.ellipsoid_of(x), out)


def test_a_way_that_loses_digits_shows():
    with np.errstate(all="ignore"):
        assert figure("hssil.height", squares) > 1
        assert not figure("bounds.tangent", cancelling, "float64", 60) <= 1  # it ends in NaN
    assert figure("hemisphere.cosine", short_series, "float64") > 1
    assert figure("val.angle", lambda x: np.arccos(np.clip((x[:3] * x[3:]).sum(axis=0), -1, 1))[None], "float64") > 1


def test_a_negative_answer_is_counted():
    ladder = KNOWN["eq2.term"]._replace(run=lambda x: KNOWN["eq2.term"].run(x) - x.dtype.type(1e-3))
    found = [row for row in rows(ladder._replace(extended=CASES, exact=0), True) if row.property.startswith("NaN")]
    assert found[0].figure > 0
    assert not found[0].passed


def test_the_worst_of_the_screened_cases_is_the_worst_of_all():
    ladder = KNOWN["eq2.term"]
    x = inputs_of(ladder, 5, 0, "float32", 1000)
    got = ladder.run(x)
    error, unit = errors(ladder, EXTENDED, "float32", x, got)
    all_of_them = (error / unit / conditions(ladder, EXTENDED, "float32", x, unit)).max()
    assert ladders.worst_of_block(ladder, EXTENDED, "float32", x, got)[0] == pytest.approx(float(all_of_them))


def test_conditions_are_those_of_calculus():
    """x^3 as a kernel: one ULP of x moves 3 ULP of itself; the difference x - y of near numbers its size over it."""
    ladder = KNOWN["eq2.term"]._replace(formula=lambda x: [x[0] ** 3], smooth=None)
    unit = spacing(np.array([[1.25**3]]), np.float64)
    assert float(conditions(ladder, EXTENDED, "float64", np.array([[1.25]]), unit)[0, 0]) == pytest.approx(
        3 * 1.25**2 * 2.0**-52 / unit[0, 0].astype(float))
    ladder = ladder._replace(formula=lambda x: [x[0] - x[1]])
    unit = spacing(np.array([[2.0**-20]]), np.float64)
    near = np.array([[1.0], [1 - 2.0**-20]])
    assert float(conditions(ladder, EXTENDED, "float64", near, unit)[0, 0]) == 2.0**20


def test_inputs_are_hostile_and_come_again():
    for name in ("eq2.term", "crown.disc", "val.step"):
        np.testing.assert_array_equal(inputs_of(KNOWN[name], 17, 2, "float32"),
                                      inputs_of(KNOWN[name], 17, 2, "float32"))
    x = inputs_of(KNOWN["eq2.term"], 17, 0, "float32").astype(float)
    r = np.sqrt((x[:3] ** 2).sum(axis=0))
    assert (r == 0).any()
    assert r[r > 0].min() < 1.1e-15
    assert r.max() > 9e8
    w = x[:3] / np.where(r > 0, r, 1)
    cosine = (w * x[3:6]).sum(axis=0)
    assert (np.abs(cosine[r > 0]) < 1e-7).any()
    assert (cosine < -0.999999).any()
    values = any_size(block_of(1, 0), np.float32)
    assert {0.0, 2.0**-149, 1e30} <= set(values.tolist())
    assert sizes(block_of(1, 0), 1e-3, 10.0).min() == 1e-3
    v = directions(block_of(2, 0))
    np.testing.assert_allclose((v * v).sum(axis=0), 1)
    assert ((v == 0).sum(axis=0) == 2).any()
    beside = around(block_of(3, 0), v, np.float32)
    assert (np.abs(np.linalg.norm(beside, axis=0) - 1) < 1e-6).all()
    assert (beside == v).all(axis=0).any()


@pytest.mark.parametrize("name", ["exp2", "log2", "log2p1"])
def test_all_of_float32_catches_a_fault_in_one_pattern(name):
    def wrong(x, out):
        elementary_range.FILL[name](x, out)
        out[0, x[0] == np.float32(0.75)] *= np.float32(1 + 4e-7)

    def without_special(x, out):
        elementary_range.FILL[name](x, out)
        out[~np.isfinite(out)] = 1
        out[(out == 0) & (x != 0)] = 1

    bits = np.arange(0x3F3FFFF0, 0x3F400010, dtype=np.uint32)  # around 0.75
    promised = elementary_range.PROMISED[name]
    assert elementary_range.of_patterns(name, bits).ulp <= promised
    worst = elementary_range.of_patterns(name, bits, wrong)
    assert worst.ulp > promised
    assert worst.bits == 0x3F400000
    ends = np.array([0, 0x80000000, 0x7F800000, 0xFF800000, 0x7FC00000, 0xC3200000, 0x43200000], np.uint32)
    assert elementary_range.of_patterns(name, ends).wrong == 0
    assert elementary_range.of_patterns(name, ends, without_special).wrong > 0 or name == "log2p1"
    assert elementary_range.whole_range(name, 1 << 16).cases >= 1 << 15


def test_a_unit_that_is_no_power_of_two_shows(monkeypatch):
    assert all(row.passed for row in pairs.unit_rows(short=True))
    first = pairs.FORMS["point"][0]
    monkeypatch.setattr(pairs, "FORMS", {"": (lambda x: first(x * x.dtype.type(1.1)), None)})
    monkeypatch.setattr(pairs, "length_scale", lambda depth: 1 / depth.min())
    found = list(pairs.unit_rows(short=True))
    assert found[0].passed  # any factor before a power of 2
    assert not found[1].passed
    monkeypatch.setattr(pairs, "FORMS", {"": (lambda x: first(x + x.dtype.type(1e-5)), None)})
    assert not next(iter(pairs.unit_rows(short=True))).passed


def test_tasks_are_of_one_name_each_and_rows_tell_how_to_see_them():
    names = [task.name for task in tasks(short=True)]
    assert len(set(names)) == len(names) == len(KNOWN) + len(kernels.promises()) + 4
    assert {"eq2.term", "crown.disc", "val.z_avg", "spot.falloff", "exp2.all"} <= set(names)
    found = list(rows(KNOWN["eq2.term"]._replace(extended=CASES, exact=20), True))
    assert all(row.passed for row in found)
    assert [row.cases for row in found] == [CASES + 20, CASES + 20, 2 * (CASES + 20)]
    assert found[0].reproduce.startswith("python -m benchmarks.stability.again kernels eq2.term ")


def test_a_case_comes_again(capsys):
    worst = measure(KNOWN["eq2.term"], EXTENDED, "float32", 17, BLOCK + 100)
    assert again.main(["kernels", "eq2.term", "17", str(worst.case)]) == 0
    shown = capsys.readouterr().out
    assert f"figure {worst.figure:.4g}, limit 14" in shown
    assert again.main(["kernels", "exp2.all", "0", str(0x3F800000)]) == 0
    assert "got        np.float32(2.0)" in capsys.readouterr().out
    assert again.main(["kernels", "nothing", "1", "2"]) == 2
    assert "eq2.term" in capsys.readouterr().err
    assert again.main(["kernels"]) == 2
