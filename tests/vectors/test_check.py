"""The checker: verdicts, the first wrong stage, tiers, chains, exit codes, damaged files."""

import json
import shutil

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.vectors.check import ALL_WITHIN, DAMAGED, NOT_COMPARABLE, OUT, DamagedError, Kit, stage_of_array
from tests.vectors.port import Port


@pytest.fixture
def port(kit, tmp_path):
    return Port(kit, "sii-warp-a", tmp_path)


def test_what_the_kit_expects_is_exact(port):
    result = port.check()
    assert (result.verdict, result.exit_code, result.first) == ("exact", ALL_WITHIN, None)
    assert {one.verdict for one in result.stages} == {"exact"}


def test_rounding_is_within(port):
    rng = np.random.default_rng(0)
    for name, array in port.arrays.items():
        if array.dtype.kind == "f":
            port.write(name, array * (1 + 2.0**-24 * rng.uniform(-1, 1, array.shape)))  # float64
    result = port.check()
    assert (result.verdict, result.exit_code) == ("within", ALL_WITHIN)


def test_the_first_wrong_stage_is_named_with_its_worst_element(port):
    flux, total = port.arrays["rsm.reflected_flux0.flux"].copy(), port.arrays["pairs.sum"]
    flux[1, 7, 4] *= 1.5
    port.write("rsm.reflected_flux0.flux", flux)
    port.write("pairs.sum", 2 * total)
    result = port.check()
    assert result.exit_code == OUT
    assert result.first == ("sii-warp-a", "rsm.reflected_flux0")
    (wrong,) = [one for one in port.first().arrays if one.verdict == "out"]
    assert (wrong.name, wrong.element, wrong.outside) == ("rsm.reflected_flux0.flux", (1, 7, 4), 1)
    assert wrong.expected == port.arrays["rsm.reflected_flux0.flux"][1, 7, 4]
    assert wrong.got == flux[1, 7, 4]


def test_an_id_that_differs_is_out_and_one_on_an_edge_is_not(kit, tmp_path):
    port = Port(kit, "sii-three-lamps", tmp_path)
    entry = port.case.arrays["rsm.map_triangles1"]
    masked = kit.extra(port.case, entry.masked)
    ids = port.arrays["rsm.map_triangles1"]
    port.write("rsm.map_triangles1", np.where(masked, ids + 1, ids))
    (verdict,) = [one for one in port.check().stages if one.stage == "rsm.map_triangles1"]
    assert (verdict.verdict, verdict.arrays[0].masked) == ("within", masked.sum())
    assert masked.sum() == entry.masked_count > 0
    port.write("rsm.map_triangles1", np.where(masked, ids, ids + 1))
    assert port.first().stage == "rsm.map_triangles1"


@pytest.mark.parametrize(("array", "change", "said"), [
    ("rsm.reflected_flux0.flux", lambda a: np.moveaxis(a, 0, -1), "the axes are in another order"),
    ("rsm.reflected_flux0.flux", lambda a: a.ravel(), "as many elements, in another shape"),
    ("rsm.reflected_flux0.flux", lambda a: a[:, :-1], "1 fewer along row"),
    ("rsm.reflected_flux0.flux", lambda a: a[0], "expected shape (3, 16, 16)"),
    ("rsm.reflected_flux0.flux", lambda a: a.astype(np.int32), "expected floats (<f4), got int32"),
    ("lights.texels0.texel", lambda a: a.astype(np.float32), "expected whole numbers (<i4), got float32"),
    ("rsm.reflected_flux0.flux", lambda a: a.astype(np.complex64), "expected floats (<f4), got complex64"),
])
def test_what_cannot_be_compared_is_said_in_plain_words(port, array, change, said):
    port.write(array, change(port.arrays[array]))
    result, first = port.check(), port.first()
    assert result.exit_code == NOT_COMPARABLE
    (wrong,) = [one for one in first.arrays if one.verdict == "invalid"]
    assert (wrong.name, first.verdict) == (array, "invalid")
    assert said in wrong.said


def test_numbers_that_are_none_are_out(port):
    for value in (np.nan, np.inf):
        flux = port.arrays["rsm.reflected_flux0.flux"].copy()
        flux[0, 5, 5] = value
        port.write("rsm.reflected_flux0.flux", flux)
        assert port.check().exit_code == OUT
        assert "1 element is" in port.first().causes[0].cause


def test_stages_that_did_not_run_do_not_count_unless_asked_for(port):
    for name in port.arrays:
        if name != "pairs.sum":
            port.remove(name)
    assert port.check().exit_code == ALL_WITHIN
    assert port.check(stages=("rsm",)).exit_code == NOT_COMPARABLE
    port.remove("pairs.sum")
    assert port.check().exit_code == NOT_COMPARABLE


def test_a_missing_array_of_a_stage_is_not_comparable(port):
    port.remove("lights.pixel_lights.normal")
    result = port.check()
    assert (result.exit_code, result.first) == (NOT_COMPARABLE, ("sii-warp-a", "lights.pixel_lights"))


def test_half_floats_pass_the_second_tier_alone(port):
    for name, array in port.arrays.items():
        if array.dtype.kind == "f":
            port.write(name, array.astype(np.float16))
    assert port.check().exit_code == OUT
    assert port.check(tiers={"": "T2"}).exit_code == ALL_WITHIN
    assert port.check(tiers={"rsm": "T2"}).first[1] == "lights.importance0"


def test_colours_in_8_bits_pass_their_tier_and_wrong_ones_do_not(port):
    albedo = port.arrays["rsm.surface.albedo"]
    port.write("rsm.surface.albedo", np.rint(255 * albedo) / 255)
    assert port.check().exit_code == OUT
    assert port.check(tiers={"": "T2B"}).exit_code == ALL_WITHIN
    for wrong in (np.rint(15 * albedo) / 15, 0.9 * albedo, albedo[::-1]):
        port.write("rsm.surface.albedo", wrong)
        assert port.check(tiers={"": "T2B"}).exit_code == OUT


def test_the_strictest_tier_wants_equal_floats(port):
    port.write("rsm.reflected_flux0.flux", np.nextafter(port.arrays["rsm.reflected_flux0.flux"], np.float32(1)))
    assert port.check().exit_code == ALL_WITHIN
    assert port.check(tiers={"": "T1", "rsm": "T0"}).first[1] == "rsm.reflected_flux0"


def test_isolated_stages_are_each_explained(port):
    """A stage that read the kit's arrays is wrong by itself, whatever is wrong before it."""
    port.write("rsm.reflected_flux0.flux", np.pi * port.arrays["rsm.reflected_flux0.flux"])
    port.write("pairs.sum", 2 * port.arrays["pairs.sum"])
    wrong = {one.stage: one for one in port.check().stages if one.verdict == "out"}
    assert {one.upstream for one in wrong.values()} == {"isolated"}
    assert {stage: "times what it should be" in one.causes[0].cause for stage, one in wrong.items()} == {
        "rsm.reflected_flux0": True, "pairs.sum": True}
    causes = {one.stage: one.causes for one in port.check(chained=True).stages if one.verdict == "out"}
    assert [bool(causes[stage]) for stage in ("rsm.reflected_flux0", "pairs.sum")] == [True, False]


def test_a_tier_is_asked_for_by_any_part_of_a_stages_name(port):
    port.write("lights.warp0.density_weight", port.arrays["lights.warp0.density_weight"].astype(np.float16))
    assert port.check().exit_code == OUT
    for name in ("lights.warp0", "lights", "warp"):
        assert port.check(tiers={name: "T2"}).exit_code == ALL_WITHIN, name
    assert port.check(tiers={"warp": "T2", "lights.warp0": "T1"}).exit_code == OUT


def test_a_chain_says_what_was_made_from_wrong_inputs(port):
    port.write("rsm.reflected_flux0.flux", 2 * port.arrays["rsm.reflected_flux0.flux"])
    port.write("lights.importance0", 2 * port.arrays["lights.importance0"])
    port.write("lights.pixel_lights.flux", 2 * port.arrays["lights.pixel_lights.flux"])
    verdicts = {one.stage: one for one in port.check(chained=True).stages}
    assert (verdicts["rsm.map_surface0"].upstream, verdicts["rsm.reflected_flux0"].upstream) == ("clean", "clean")
    assert verdicts["rsm.reflected_flux0"].verdict == verdicts["lights.importance0"].verdict == "out"
    for stage in ("lights.importance0", "lights.warp0", "lights.texels0", "lights.pixel_lights", "pairs.sum"):
        assert verdicts[stage].upstream == "dirty", stage
    assert verdicts["rsm.reflected_flux1"].upstream == "clean"
    assert port.check(chained=True).first == ("sii-warp-a", "rsm.reflected_flux0")


def test_damaged_kits_and_outputs_are_told(kit, port, tmp_path):
    copy = tmp_path / "kit"
    shutil.copytree(kit.folder, copy)
    file = copy / "cases" / "sii-warp-a" / "out" / "rsm.reflected_flux0.flux.npy"
    content = bytearray(file.read_bytes())
    content[-3] ^= 1
    file.write_bytes(bytes(content))
    port.kit = Kit(copy)
    with pytest.raises(DamagedError, match=r"rsm\.reflected_flux0\.flux\.npy: expected the bytes"):
        port.check()
    manifest = copy / "cases" / "sii-warp-a" / "manifest.json"
    manifest.write_text(manifest.read_text().replace("W/m^2", "W"))
    with pytest.raises(DamagedError, match="manifest"):
        port.check()
    (copy / "kit.json").write_text(json.dumps({"kit": "quick", "strange": 1}))
    with pytest.raises(DamagedError, match="strange"):
        Kit(copy)
    port.kit = kit
    file = port.folder / "sii-warp-a" / "rsm.reflected_flux0.flux.npy"
    whole = file.read_bytes()
    for content, said in ((b"no array", "without its header"), (whole[:-5], "bytes that its header says, got"),
                          (b"", "without its header"), (whole + b"more", "bytes that its header says, got")):
        file.write_bytes(content)
        result = port.check()
        assert (result.exit_code, result.first) == (DAMAGED, ("sii-warp-a", "rsm.reflected_flux0"))
        assert said in port.first().arrays[1].said
        assert {one.verdict for one in result.stages if one.stage != "rsm.reflected_flux0"} == {"exact"}


def test_unknown_names_are_refused(kit, port, tmp_path):
    for asked, said in (({"stages": ("rms",)}, r"--stage: .*did you mean 'rsm"),
                        ({"tiers": {"pairs.summ": "T2"}}, r"--tier: .*did you mean 'pairs.sum'")):
        with pytest.raises(InputError, match=said):
            port.check(**asked)
    assert {one.stage for one in port.check(stages=("warp",)).stages} == {"lights.warp0", "lights.warp1"}
    port.write("rsm.reflected_flux0.fluxx", port.arrays["rsm.reflected_flux0.flux"])
    (port.folder / "sii-warp-aa").mkdir()
    assert port.check().unknown == (
        "sii-warp-aa: no such case; did you mean 'sii-warp-a'?",
        "sii-warp-a/rsm.reflected_flux0.fluxx.npy: no array of this case; did you mean 'rsm.reflected_flux0.flux'?")
    port.folder = tmp_path / "nowhere"
    with pytest.raises(InputError, match="expected a folder"):
        port.check()
    for case, array, tier in (("sii-warp-c", "pairs.sum", "T1"), ("sii-warp-a", "pairs.summ", "T1"),
                              ("sii-warp-a", "pairs.sum", "T9")):
        with pytest.raises(InputError, match="expected one of"):
            stage_of_array(kit, case, array, port.arrays["pairs.sum"], tier)
