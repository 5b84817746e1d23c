"""`refgi explain`: what runs, is reused and skipped; with --measure tables of skips, data, exit codes."""

import json

import numpy as np
import pytest

from refgi.bench.skips import DimLights, MeasuredSkip, SkipReport, Trade, Unmeasured
from refgi.cli import view
from refgi.cli.explain import measured_text
from refgi.pairs import irradiance as pairs
from tests.cli.command import TINY, invoke

SMALL = ("--rsm-resolution", "64", "--threads", "1", "--rounds", "2")


def run(*arguments, size="24x18"):
    return invoke("explain", *arguments, "--size", size, *SMALL)


def skip(name="pairs.pixels", *, same_bits=True):
    return MeasuredSkip(name=name, meaning="pixels without surface", unit="pixels", left_out=1200, of=4800,
                        times=(0.01, 0.03, 0.012), times_without=(0.015, 0.033, 0.019), same_bits=same_bits)


def report(*found, **others):
    parts = {"scene": "room", "method": "sii", "width": 80, "height": 60, "times": (0.01, 0.03, 0.012), "skips": found,
             "trades": (), "dim_lights": None, "unmeasured": ()} | others
    return SkipReport(**parts)


def test_the_table_has_medians_and_what_was_saved_round_by_round():
    """5, 3 and 7 ms by round, which is 5: not the difference of the medians, 19 - 12."""
    text = measured_text(report(skip()))
    assert "room does not need at 80 x 60: a frame takes 12 ms, median of 3" in text
    row, = (line for line in text.splitlines() if line.startswith("pairs.pixels"))
    assert row.split()[:11] == ["pairs.pixels", "1,200", "of", "4,800", "pixels", "12", "19", "5", "3", "7", "yes"]
    assert row.endswith("pixels without surface")


def test_a_skip_that_changes_bits_is_told_by_name():
    text = measured_text(report(skip(), skip("sii.bounds", same_bits=False)))
    assert "sii.bounds changes bits of the picture" in text
    assert [line.split()[0] for line in text.splitlines() if " NO " in line] == ["sii.bounds"]


def test_lights_trades_and_reasons_have_their_lines():
    text = measured_text(report(
        dim_lights=DimLights(lights=768, carrying=700, count=900, share=0.999, times=(0.02,), times_carrying=(0.018,),
                             error=0.0042),
        trades=(Trade(meaning="half of it", changes=("a=1", "b.c=x"), times=(0.012,), times_changed=(2.5,),
                      difference=0.0123),
                Trade(meaning="none of it", changes=("d=1",), times=(0.012,), times_changed=(0.001,), difference=None)),
        unmeasured=(Unmeasured(meaning="this", reason="that"),)))
    assert "No skip has anything to leave out here." in text
    assert "700 of 768 pixel lights carry 99.9% of the light" in text
    assert "takes 20 ms" in text
    assert "18 ms, with an error of 0.42% of the mean" in text
    rows = {line.split("  ")[0]: line.split() for line in text.splitlines()}
    assert rows["half of it"][3:] == ["12", "2500", "1.23%", "--set", "a=1", "--set", "b.c=x"]
    assert rows["none of it"][3:] == ["12", "1", "-", "--set", "d=1"]
    assert rows["this"] == ["this", "that"]


def test_nothing_measured_says_nothing():
    assert measured_text(None) == ""
    assert measured_text(report(times=())) == (
        "\n\nWhat room does not need at 80 x 60\n\nNo skip has anything to leave out here.")


def test_skips_are_measured_at_the_picture_s_own_size_where_asked_for():
    done = run("wedge", "--method", "sii", "--set", "lights=16", "--measure", "--json", "--clock", "processor",
               size="60x40")
    assert done.exit_code == 0, done.output
    found = SkipReport.model_validate(json.loads(done.stdout)["measured"])
    assert (found.width, found.height) == (60, 40)
    assert {len(skip.times_without) for skip in found.skips} == {2}
    assert min(found.times) > 0
    assert {skip.name for skip in found.skips} >= {"pairs.pixels", "pairs.lobes", "rsm.texels"}
    assert found.same_bits
    assert "measured" not in json.loads(run("wedge", "--set", "lights=16", "--json").stdout)


def test_a_wrong_skip_is_exit_code_1(monkeypatch):
    careful = pairs.receiving

    def receiving(covered):
        shown = careful(covered)
        return shown if shown is not covered else np.where(np.arange(len(covered))[:, None] == 9, False, covered)

    monkeypatch.setattr(pairs, "receiving", receiving)
    done = run("wedge", "--method", "sii", "--set", "lights=16", "--measure")
    assert done.exit_code == 1, done.output
    assert "pairs.pixels changes bits of the picture" in done.stdout
    assert "SII Table 1" in done.stdout


@pytest.mark.parametrize("rounds", ["0", "x"])
def test_rounds_are_whole_numbers_from_1_on(rounds):
    done = invoke("explain", "wedge", "--measure", "--rounds", rounds)
    assert done.exit_code == 2


@pytest.fixture(scope="module")
def explained():
    """The same as JSON values and as text."""
    options = ("explain", "cornell_box", *TINY, "--set", "lights=16")
    return json.loads(invoke(*options, "--json").stdout), invoke(*options).stdout


def test_explain_shows_the_four_rows_of_table_1(explained, evidence):
    """SII Table 1: what stays the same is reused."""
    rows = explained[0]["animation"]
    assert {word.split(" x")[0] for word in rows["light and camera still"].values()} <= {"reused", "skipped"}
    assert rows["light and camera still"]["pairs.sum"] == "reused"
    assert rows["camera moves"]["rsm.reflective_shadow_map"] == "reused"
    assert rows["camera moves"]["pairs.sum"] == "runs"
    assert rows["light moves"]["rsm.gbuffer"] == "reused"
    assert rows["light moves"]["rsm.reflective_shadow_map"] == "runs"
    assert {rows["light and camera move"][stage] for stage in ("rsm.gbuffer", "rsm.reflective_shadow_map")} == {"runs"}
    evidence("; ".join(f"{row}: {sum(v == 'reused' for v in stages.values())} stages reused"
                       for row, stages in rows.items()))


def test_explain_says_what_is_skipped_and_why(explained):
    told, text = explained
    skipped = [line for line in told["stages"] if line["skipped"]]
    assert skipped
    assert all(line["reason"] for line in skipped)
    assert skipped[0]["reason"] in text
    assert "SII Table 1" in text


def test_explain_warns_of_the_frame_asked_for_alone(tmp_path):
    """The camera and light that it moves take other shares of the light by the gathering radius."""
    options = ["cornell_box", "--size", "16x12", "--rsm-resolution", "64", "--method", "gather"]
    result = invoke("explain", *options, "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["ledger"] is None
    rendered = invoke("render", *options, "--out", tmp_path / "a.exr")
    assert "takes" in rendered.stderr
    assert result.stderr == rendered.stderr


def test_explain_refuses_maps_that_do_not_fit(monkeypatch):
    monkeypatch.setattr(view, "available_bytes", lambda: 10**9)
    told = invoke("explain", "cornell_box", *TINY, "--method", "val", "--set", "maps.resolution=4096")
    assert told.exit_code == 2
    assert "for the settings of val" in told.stderr


@pytest.mark.feature("REF-04")
def test_explain_tells_where_the_power_goes(explained, evidence):
    ledger, text = explained[0]["ledger"], explained[1]
    parts = np.sum([ledger["rows"][name] for name in ledger["parts"]], axis=0)
    assert parts == pytest.approx(ledger["rows"]["emitted"], rel=1e-5)
    table = text[text.index("Where the power of the lights goes"):]
    for name in ("emitted", "reflected", "clamped", "cut", "behind", "off screen", "difference"):
        assert name in table
    evidence(f"sii on the Cornell box: {len(ledger['parts'])} lines sum to what is emitted to 1e-5")
