"""Causes of wiring, layouts in memory, tiles and texture formats; causes that another array of the stage refutes."""

import numpy as np
import pytest

from refgi.vectors.cases import kit_cases
from refgi.vectors.causes import FEWEST
from refgi.vectors.check import check_stage
from refgi.vectors.kit import Asked
from refgi.vectors.port import Port as Read
from refgi.vectors.rows import Form
from refgi.vectors.spec import kind_of, outputs_of
from tests.vectors.port import Port


def padded(a):
    """Return the first numbers of vectors that take 16 bytes each."""
    return np.stack([*a, np.zeros_like(a[0])], axis=-1).ravel()[: a.size]


def eleven_bits(a):
    """Return positive numbers with 6 bits after the first one, 5 of blue: R11G11B10F."""
    unit = 2.0 ** np.floor(np.log2(np.maximum(a, 1e-30))) / np.array([64, 64, 32])[:, None, None]
    return np.rint(a / unit) * unit


FLUX = "rsm.reflected_flux0.flux"
BUGS = [
    ("rsm.surface.normal", lambda a: padded(a).reshape(a.shape), "vectors take 4 numbers each, as a vec3"),
    ("rsm.surface.normal", lambda a: padded(a).reshape(-1, 3).T.reshape(a.shape), "read as if they took 3"),
    ("rsm.surface.normal", lambda a: np.rint(255 * np.maximum(a, 0)) / 255, "unorm8, in which what is below 0 is cut"),
    ("rsm.surface.normal", lambda a: np.rint(127 * a) / 127, "stored as snorm8"),
    ("rsm.surface.normal", lambda a: np.rint(255 * (a + 1) / 2) / 255 * 2 - 1, "packed as (x + 1) / 2 in unorm8"),
    (FLUX, eleven_bits, "R11G11B10F"),
    ("pairs.sum", lambda a: np.where(np.arange(a.shape[2]) < a.shape[2] // 16 * 16, a, 0), "beyond whole tiles"),
    ("lights.pixel_lights.flux", lambda a: np.where(np.arange(a.shape[1]) < a.shape[1] // 32 * 32, a, 0),
     "lights beyond whole"),
]


@pytest.mark.parametrize(("array", "bug", "said"), BUGS)
def test_a_layout_or_format_is_named(kit, tmp_path, array, bug, said):
    port = Port(kit, "sii-warp-a", tmp_path)
    with np.errstate(all="ignore"):
        port.write(array, bug(port.arrays[array]))
    assert array in {one.name for one in port.first().arrays if one.verdict == "out"}
    causes = [one.cause for one in port.first().causes]
    assert any(said in one for one in causes), causes


def causes_told(kit, tmp_path, case, stage, right, wrong):
    """Return the causes told of a stage that is rightly computed with `wrong` in the place of its inputs `right`."""
    pairs = [(right, wrong)] if isinstance(right, str) else zip(right, wrong, strict=True)
    port = Port(kit, case, tmp_path)
    step = next(one for one in kit_cases("quick")[case]().stages if one.name == stage)
    known = {name: kit.array(port.case, name) for name in port.case.arrays}
    for name, array in outputs_of(step, known | {one: known[other] for one, other in pairs}, np.float32).items():
        port.write(name, array)
    return [one.cause for one in port.first().causes]


@pytest.mark.parametrize(("case", "stage", "right", "wrong"), [
    ("sii-halton", "pairs.sum", "rsm.surface.normal", "rsm.surface.position"),
    ("sii-halton", "pairs.sum", "lights.pixel_lights.normal", "lights.pixel_lights.flux"),
    ("sii-three-lamps", "rsm.map_triangles0", "rsm.map_triangles0.projection.half",
     "rsm.map_triangles1.projection.half"),
    ("sii-three-lamps", "rsm.map_triangles1", "rsm.map_triangles1.projection.half",
     "rsm.map_triangles0.projection.half")])
def test_a_buffer_in_the_place_of_another_is_named(kit, tmp_path, case, stage, right, wrong):
    """The stage itself with one input for another, as a port binds it: rightly computed, from the wrong buffer."""
    causes = causes_told(kit, tmp_path, case, stage, right, wrong)
    assert any(f"{kind_of(right)} is bound to" in one for one in causes), causes


@pytest.mark.parametrize(("case", "stage", "right", "wrong"), [
    ("hssil-default", "sssil.gather_samples0", "sssil.crown_samples0.weight", "sssil.crown_samples1.weight"),
    ("hssil-temporal", "sssil.reprojection", "rsm.surface0.normal", "rsm.surface1.normal"),
    ("hssil-temporal", "sssil.reprojection", "rsm.surface1.normal", "rsm.surface0.normal")])
def test_one_of_several_of_a_kind_is_named(kit, tmp_path, case, stage, right, wrong):
    """A level that is made later, and which of two frames' surfaces gives way to the other."""
    causes = causes_told(kit, tmp_path, case, stage, right, wrong)
    said = (f"{right} is bound to {wrong}", f"{kind_of(right)} is bound to that of another")
    assert any(one.startswith(said) for one in causes), causes


def test_all_fields_of_another_level_are_named(kit, tmp_path):
    right, wrong = ([f"sssil.crown_samples{level}.{one}" for one in ("offsets", "weight")] for level in (1, 0))
    causes = causes_told(kit, tmp_path, "hssil-default", "sssil.gather_samples1", right, wrong)
    assert "sssil.crown_samples is all bound to that of another lamp, level or round" in causes


def test_a_mask_of_pairs_read_pixel_by_pixel_is_named(kit, tmp_path):
    """(N, h, w) read as (h, w, N): element (k, i, j) is taken from the place (i w + j) N + k; by the literal text."""
    case, right = "sii-range-spot", "sii.kept.diffuse_kept"
    port = Port(kit, case, tmp_path)
    step = next(one for one in kit_cases("quick")[case]().stages if one.name == "sii.range_sum")
    form = next(one for one in step.variants if isinstance(one, Form))
    known = {name: kit.array(port.case, name) for name in port.case.arrays}
    wrong = np.empty_like(known[right])
    for place in np.ndindex(wrong.shape):
        k, i, j = place
        wrong[place] = known[right].flat[(i * wrong.shape[2] + j) * len(wrong) + k]
    for name, array in outputs_of(step, known | {right: wrong}, np.float64, form).items():
        port.write(name, array)
    assert any(one.cause.startswith(f"{right} is read pixel by pixel, (h, w, n)") for one in port.first().causes)


def test_no_wiring_is_told_from_a_single_number(kit):
    for case in kit.cases(Asked()):
        bugs = kit.bugs(case)
        for step in case.stages:
            elements = sum(int(np.prod(case.arrays[name].shape)) for name in step.writes)
            assert elements >= FEWEST or not any(bug.wired for bug in bugs.of(step.name)), (case.id, step.name)


def test_a_wiring_that_changes_less_than_differs_is_not_told(kit, tmp_path):
    """What the kit keeps of it fits, all other elements differ as well."""
    port = Port(kit, "sii-halton", tmp_path)
    name, right = "pairs.sum", port.arrays["pairs.sum"]
    step = next(one for one in port.case.stages if one.name == name)
    wirings = [bug for bug in kit.bugs(port.case).of(name) if bug.wired and bug.arrays]
    lit = np.count_nonzero(right)
    whole = [bug for bug in wirings if 0.96 * lit < bug.arrays[name].differing < 0.8 * right.size][:5]
    assert whole
    for more, told in ((right.max(), False), (0.0, True)):
        for bug in whole:
            wrong = 1.5 * right + more
            places, values, _ = kit.bugs(port.case).told(bug, name, right)
            wrong.reshape(-1)[places] = values
            port.write(name, wrong)
            verdict = check_stage(Read(kit, port.case, port.folder, Asked()), step, dirty=False)
            assert (bug.cause in [one.cause for one in verdict.causes]) == told, bug.cause


def test_wirings_to_darkness_stand_behind_the_bug_that_makes_it(kit, tmp_path):
    """A bias of the wrong sign: each surface hides itself, as many wrong buffers would make it."""
    port = Port(kit, "vpl-maps", tmp_path)
    port.write("vpl.looked_up", np.zeros_like(port.arrays["vpl.looked_up"]))
    first, *_ = port.first().causes
    assert first.cause.startswith("the bias has the wrong sign")


def test_an_array_of_the_stage_that_is_right_refutes_what_would_change_it(kit, tmp_path):
    """A likely bug of several arrays, put into one of them alone, is not what happened."""
    port = Port(kit, "val-single", tmp_path)
    bugs = kit.bugs(port.case)
    several = [(step.name, bug) for step in port.case.stages for bug in bugs.of(step.name)
               if not bug.blind and len(bug.arrays) > 1][:30]
    assert several
    for stage, bug in several:
        name = min(bug.arrays)
        wrong = port.arrays[name].copy()
        places, values, _ = bugs.told(bug, name, wrong)
        wrong.reshape(-1)[places] = values
        port.write(name, wrong)
        assert bug.cause not in [one.cause for one in port.first().causes], (stage, bug.cause)
        port.write(name, port.arrays[name])
