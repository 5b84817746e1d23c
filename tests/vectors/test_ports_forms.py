"""What a GPU gives back: texels, packed floats, stored depth, lists that atomics have put into another order."""

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.vectors.cases import kit_cases
from refgi.vectors.check import ALL_WITHIN, NOT_COMPARABLE, OUT
from refgi.vectors.spec import outputs_of, stored
from refgi.vectors.storage import Depth
from tests.vectors.literal_port import written
from tests.vectors.port import Port


@pytest.fixture
def port(kit, tmp_path):
    return Port(kit, "sii-warp-a", tmp_path)


def texels(planes, alpha):
    """Return planes (c, h, w) as (h, w, 4)."""
    rest = np.full((4 - len(planes), *planes.shape[1:]), alpha)
    return np.moveaxis(np.concatenate([planes, rest]), 0, -1)


def test_readbacks_of_texels_are_taken_where_they_are_asked_for(port):
    for name, array in port.arrays.items():
        if array.ndim == 3:
            port.write(name, texels(array, 1.0))
    result = port.check()
    assert result.exit_code == NOT_COMPARABLE
    (wrong,) = [one for one in port.first().arrays if one.name == "rsm.map_surface0.position"]
    assert wrong.said.endswith("; --layout rgba takes it")
    result = port.check(layout="rgba")
    assert (result.verdict, result.exit_code) == ("exact", ALL_WITHIN)
    read = {array.name: array.read for one in result.stages for array in one.arrays}
    assert read["rsm.surface.normal"] == "read as texels (18, 24, 4), without component 4"
    assert read["rsm.surface.depth"] == ""
    port.write("rsm.reflected_flux0.flux", texels(port.arrays["rsm.reflected_flux0.flux"][::-1], 1.0))
    assert port.check(layout="rgba").first == ("sii-warp-a", "rsm.reflected_flux0")
    assert "order bgr" in port.first(layout="rgba").causes[0].cause


def to_r11g11b10f(colours, rounded=np.floor):
    """Return the numbers of the format below colours, or the nearest: 6, 6 and 5 bits of mantissa."""
    bits = np.array([6, 6, 5]).reshape(3, *[1] * (colours.ndim - 1))
    step = 2.0 ** (np.floor(np.log2(np.maximum(colours, 2.0**-14))) - bits)
    return rounded(colours / step) * step


@pytest.mark.parametrize("tiers", [{"rsm.reflected_flux0.flux": "R11G11B10F"}, {"flux": "R11G11B10F"},
                                   {"": "R11G11B10F"}])
def test_packed_floats_pass_their_tier_and_bugs_do_not(port, tiers):
    flux = port.arrays["rsm.reflected_flux0.flux"]
    port.write("rsm.reflected_flux0.flux", to_r11g11b10f(flux.astype(float)))
    assert port.check().exit_code == OUT
    assert port.check(tiers={"": "T2"}).exit_code == OUT
    assert port.check(tiers=tiers).exit_code == ALL_WITHIN
    for wrong in (1.05 * flux, flux[::-1], flux * (flux < flux.max())):
        port.write("rsm.reflected_flux0.flux", to_r11g11b10f(wrong.astype(float)))
        assert port.check(tiers=tiers).first == ("sii-warp-a", "rsm.reflected_flux0")
    port.write("rsm.reflected_flux0.flux", -flux)
    assert port.check(tiers=tiers).exit_code == OUT


def test_a_shared_exponent_passes_its_tier(port):
    flux = port.arrays["lights.pixel_lights.flux"].astype(float)
    step = 2.0 ** (np.floor(np.log2(np.maximum(flux.max(axis=0), 2.0**-16) * 512 / 511.5)) + 1 - 9)
    port.write("lights.pixel_lights.flux", np.rint(flux / step) * step)
    assert port.check().exit_code == OUT
    assert port.check(tiers={"lights.pixel_lights.flux": "RGB9E5"}).exit_code == ALL_WITHIN
    assert port.check(tiers={"lights.pixel_lights.flux": "R11G11B10F"}).exit_code == OUT  # small beside large
    port.write("lights.pixel_lights.flux", to_r11g11b10f(flux))
    assert port.check(tiers={"lights.pixel_lights.flux": "RGB9E5"}).exit_code == OUT


@pytest.mark.parametrize("chained", [False, True])
def test_a_stage_that_reads_packed_floats_may_change_as_they_do(port, chained):
    """The sum of the lights whose flux the format has cut; a missing 1/pi shows."""
    flux = port.arrays["lights.pixel_lights.flux"].astype(float)
    packed = to_r11g11b10f(flux)
    share = np.divide(packed, flux, out=np.ones_like(flux), where=flux > 0)
    total = port.arrays["pairs.sum"] * share.min(axis=1)[:, None, None]  # all cut as the worst
    port.write("lights.pixel_lights.flux", packed)
    port.write("pairs.sum", total)
    asked = {"tiers": {"lights.pixel_lights.flux": "R11G11B10F"}, "chained": chained}
    assert share.min() < 0.985
    assert port.check(**asked).exit_code == ALL_WITHIN
    assert port.check(chained=chained).exit_code == OUT
    port.write("pairs.sum", 1.5 * total)
    assert port.check(**asked).first == ("sii-warp-a", "pairs.sum")
    port.write("pairs.sum", port.arrays["pairs.sum"])
    port.write("lights.footprints", 1.001 * port.arrays["lights.footprints"])  # of texels
    tiers = {"rsm.reflected_flux0.lobe_flux": "R11G11B10F"}
    assert port.check(tiers=tiers).first == ("sii-warp-a", "lights.footprints")


def test_a_chain_passes_on_what_packed_floats_move(port):
    """A map that is cut, 0.5 % of its lights and of their sum: isolated that has read the kit's lights."""
    port.write("rsm.reflected_flux0.flux", to_r11g11b10f(port.arrays["rsm.reflected_flux0.flux"].astype(float)))
    for name in ("lights.pixel_lights.flux", "pairs.sum"):
        port.write(name, 0.995 * port.arrays[name])
    tiers = {"rsm.reflected_flux0.flux": "R11G11B10F"}
    assert port.check(chained=True, tiers=tiers).exit_code == ALL_WITHIN
    assert port.check(tiers=tiers).first == ("sii-warp-a", "pairs.sum")


@pytest.mark.parametrize("rounded", [np.floor, np.rint])
def test_decisions_on_packed_floats_may_be_others_and_bugs_show(kit, tmp_path, rounded):
    """Pairs near a threshold, in a chain of the literal text that stores flux in few bits."""
    port, tiers = Port(kit, "sii-range-length", tmp_path), {"flux": "R11G11B10F"}
    known = {name: kit.array(port.case, name) for name in port.case.arrays}
    for step in kit_cases("quick")["sii-range-length"]().stages:
        made = written(step, known) or outputs_of(step, known, np.float64)
        for name, array in made.items():
            packed = name in ("rsm.reflected_flux0.flux", "lights.pixel_lights.flux")
            known[name] = stored(to_r11g11b10f(array, rounded) if packed else array)
            port.write(name, known[name])
    kept, strength = "sii.kept.diffuse_kept", known["sii.strengths.diffuse_strength"]
    moved = known[kept] != port.arrays[kept]
    assert 0 < moved.mean() < 0.01
    assert port.check(chained=True).exit_code == OUT
    assert port.check(chained=True, tiers=tiers).exit_code == ALL_WITHIN
    for share in (0.5, 0.8, 1.25):
        port.write(kept, (strength >= share * known["sii.low_irradiance"]) & (strength > 0))
        assert port.check(chained=True, tiers=tiers).first == ("sii-range-length", "sii.kept")


def test_a_light_whose_flux_is_stored_as_0_may_be_absent(kit, tmp_path):
    """One below the least number of the format is none; what a chain makes of the rest goes another way."""
    port, tiers = Port(kit, "val-csm", tmp_path), {"flux": "R11G11B10F"}
    maps = [to_r11g11b10f(port.arrays[f"rsm.reflected_flux{k}.flux"].astype(float)) for k in (0, 1)]
    for k, packed in enumerate(maps):
        port.write(f"rsm.reflected_flux{k}.flux", packed)
    own, texel, index = (port.arrays[f"lights.pixel_lights.{key}"] for key in ("flux", "texel", "map_index"))
    dark = np.array([not maps[k].reshape(3, -1)[:, at].any() for at, k in zip(texel, index, strict=True)])
    assert 0 < dark.sum() < 4

    def without(lights):
        for name, array in port.arrays.items():
            if name.startswith("lights.pixel_lights.") or name in ("lights.footprints", "cluster.kmeans_assign0.of"):
                port.write(name, array[..., ~lights])

    def verdicts(**asked):
        return {one.stage: one.verdict for one in port.check(chained=True, **asked).stages}

    without(dark)
    assert verdicts()["lights.pixel_lights"] == "invalid"
    found = verdicts(tiers=tiers)
    assert (found["lights.pixel_lights"], found["cluster.kmeans_assign0"]) == ("exact", "not-judged")
    assert port.check(chained=True, tiers=tiers).exit_code == ALL_WITHIN
    without(np.arange(dark.size) == own.sum(axis=0).argmax())
    assert verdicts(tiers=tiers)["lights.pixel_lights"] == "out"
    without(dark | (np.arange(dark.size) % 2 == 0))
    assert verdicts(tiers=tiers)["lights.pixel_lights"] == "invalid"
    without(dark)
    port.write("lights.pixel_lights.normal", np.ones((4, dark.size - 1)))
    assert verdicts(tiers=tiers)["lights.pixel_lights"] == "invalid"


@pytest.mark.parametrize("encoding", ["linear", "ndc", "gl", "reversed"])
def test_stored_depth_is_judged_in_metres(port, encoding):
    near, far = 0.1, 100.0
    z = port.arrays["rsm.surface.depth"].astype(float)
    with np.errstate(invalid="ignore"):
        d = {"linear": (z - near) / (far - near), "reversed": near * (far - z) / (z * (far - near))}.get(
            encoding, far * (z - near) / (z * (far - near)))
    d = np.where(np.isinf(z), 0.0 if encoding == "reversed" else 1.0, d)
    kept = np.round(d * (2**24 - 1)) / (2**24 - 1)
    port.write("rsm.surface.depth", 2 * kept - 1 if encoding == "gl" else kept)
    assert port.check().first == ("sii-warp-a", "rsm.surface")
    assert any(one.said == "a depth buffer? --depth says how it is stored" for one in port.first().arrays)
    asked = {"depth": {"rsm.surface.depth": Depth(encoding, near, far)}}
    assert port.check(**asked).exit_code == ALL_WITHIN
    read = {one.name: one.read for stage in port.check(**asked).stages for one in stage.arrays}
    assert read["rsm.surface.depth"] == f"from {encoding} depth"
    assert port.check(depth={"rsm.surface.depth": Depth(encoding, near, 2 * far)}).exit_code == OUT
    port.write("rsm.surface.depth", kept[::-1])
    assert port.check(**asked).exit_code == OUT


LIST = tuple(f"lights.pixel_lights.{name}" for name in (
    "position", "normal", "flux", "lobe_flux", "lobe_axis", "lobe_exponent", "texel", "map_index"))


def shuffled(port, names, seed=5):
    order = np.random.default_rng(seed).permutation(port.arrays["lights.pixel_lights.texel"].size)
    for name in names:
        port.write(name, port.arrays[name][..., order])
    return order


def test_a_list_in_another_order_is_matched_by_its_texels(port):
    shuffled(port, LIST)
    assert port.check().first == ("sii-warp-a", "lights.pixel_lights")
    result = port.check(unordered=("pixel_lights",))
    assert (result.verdict, result.exit_code) == ("exact", ALL_WITHIN)  # areas of the kit's lights, in their order
    (read,) = {array.read for one in result.stages for array in one.arrays if one.stage == "lights.pixel_lights"}
    assert read == "its elements matched with those of the kit, as --unordered says"


@pytest.mark.parametrize("chained", [False, True])
def test_what_a_list_indexes_is_matched_with_it(port, chained):
    order = shuffled(port, (*LIST, "lights.footprints"))
    assert port.check(unordered=("pixel_lights",), chained=chained).verdict == "exact"
    port.write("lights.footprints", port.arrays["lights.footprints"])  # as if the port had read the kit's lights
    assert (port.check(unordered=("pixel_lights",), chained=chained).exit_code == OUT) == chained
    port.write("lights.footprints", 1.5 * port.arrays["lights.footprints"][order])
    assert port.check(unordered=("pixel_lights",), chained=chained).first == ("sii-warp-a", "lights.footprints")


def test_wrong_elements_of_a_list_in_another_order_are_out(port):
    order = shuffled(port, LIST)
    flux = port.arrays["lights.pixel_lights.flux"].copy()
    lit = int(np.flatnonzero(flux.all(axis=0))[7])
    flux[:, lit] *= 2
    port.write("lights.pixel_lights.flux", flux[:, order])
    wrong = next(one for one in port.first(unordered=("pixel_lights",)).arrays if one.verdict == "out")
    assert (wrong.name, wrong.outside, wrong.element[1]) == ("lights.pixel_lights.flux", 3, lit)
    texel = port.arrays["lights.pixel_lights.texel"].copy()
    texel[4] += 1000
    port.write("lights.pixel_lights.texel", texel[order])
    wrong = next(one for one in port.first(unordered=("pixel_lights",)).arrays if one.name.endswith(".texel"))
    assert (wrong.outside, wrong.element) == (1, (4,))


def test_a_list_without_numbers_is_matched_by_the_nearest_position(port):
    rng = np.random.default_rng(2)
    shuffled(port, LIST)
    for name in ("lights.pixel_lights.texel", "lights.pixel_lights.map_index"):
        port.remove(name)
    stage = port.first(unordered=("pixel_lights",))
    assert {one.name: one.verdict for one in stage.arrays} == {name: "exact" for name in LIST} | {
        "lights.pixel_lights.texel": "invalid", "lights.pixel_lights.map_index": "invalid"}  # missing
    order = rng.permutation(57)
    for name in LIST[:6]:
        array = port.arrays[name]
        port.write(name, (array * (1 + 2.0**-24 * rng.uniform(-1, 1, array.shape)))[..., order])
    assert {one.verdict for one in port.first(unordered=("pixel_lights",)).arrays} <= {"exact", "within", "invalid"}


def test_a_wrong_value_does_not_move_an_element_of_a_list_without_numbers(port):
    order = shuffled(port, LIST)
    flux = port.arrays["lights.pixel_lights.flux"].copy()
    flux[:, 7] += 1e6
    port.write("lights.pixel_lights.flux", flux[:, order])
    for name in ("lights.pixel_lights.texel", "lights.pixel_lights.map_index"):
        port.remove(name)
    verdicts = {one.name: (one.verdict, one.outside) for one in port.first(unordered=("pixel_lights",)).arrays}
    assert verdicts["lights.pixel_lights.flux"] == ("out", 3)
    assert verdicts["lights.pixel_lights.position"] == verdicts["lights.pixel_lights.normal"] == ("exact", 0)


def test_inputs_that_must_be_exact_widen_nothing(port):
    step = next(one for one in port.case.stages if one.name == "pairs.sum")
    assert "lights.pixel_lights.position" in step.exact
    port.write("pairs.sum", 1.001 * port.arrays["pairs.sum"])
    assert port.check(tiers={"lights.pixel_lights.position": "RGB9E5"}).first == ("sii-warp-a", "pairs.sum")


def test_subsplats_in_another_order_and_all_made_of_them(kit, tmp_path):
    port = Port(kit, "multires-edge", tmp_path)
    order = np.random.default_rng(1).permutation(port.arrays["multires.subsplats.level"].size)
    names = (*(f"multires.subsplats.{name}" for name in ("level", "row", "column", "pixel")), "multires.points.point",
             "multires.points.normal", "multires.subsplat_irradiance")
    for name in names:
        port.write(name, port.arrays[name][..., order])
    assert port.check().exit_code == OUT
    for chained in (False, True):
        assert port.check(unordered=("subsplats",), chained=chained).verdict == "exact"


def test_a_list_of_another_length_is_told_as_before(port):
    for name in LIST:
        port.write(name, port.arrays[name][..., 1:])
    assert "1 fewer along light" in port.first(unordered=("pixel_lights",)).arrays[0].said


@pytest.mark.parametrize(("asked", "said"), [
    ({"tiers": {"rsm.surface.depth": "RGB9E5"}}, "--tier: expected the start of the name of an array of three floats"),
    ({"tiers": {"lights.pixel_lights.fluxx": "T2"}}, "--tier: .*did you mean 'lights.pixel_lights.flux'"),
    ({"depth": {"rsm.surface.dept h": Depth("ndc", 0.1, 10.0)}}, "--depth: .*did you mean 'rsm.surface.depth'"),
    ({"unordered": ("rsm.surface",)}, "--unordered: expected the start of the name of a stage that writes a list"),
])
def test_names_that_nothing_has_are_refused(port, asked, said):
    with pytest.raises(InputError, match=said):
        port.check(**asked)


def test_an_empty_list_has_no_order(kit, tmp_path):
    port = Port(kit, "vpl-no-flux", tmp_path)
    assert port.arrays["lights.pixel_lights.position"].size == 0
    assert port.check(unordered=("pixel_lights",)).verdict == "exact"
