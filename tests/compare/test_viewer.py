"""The viewer clicked through in a browser, against the comparison that its page was made of."""

import numpy as np
import pytest

from refgi.compare.pages import TIMES
from refgi.compare.pictures import luminance
from refgi.compare.report import page
from refgi.image import tone_map
from tests.compare.browser import clicked
from tests.compare.conftest import make_comparison, make_scene

HALF = 2.0**-11  # rounding of a half float
DIGITS = 5e-4  # of the four that the page writes
RADIANCE = 3 * HALF + DIGITS  # emission and reflectance are half floats as well
AT = (60, 40)  # x, y of the pixel that is read
WIDTH, HEIGHT = 96, 72
NAMES = ["sii", "gather", "vpl", "truth", "unoccluded"]
SCRIPT = """
    const [viewer] = [Viewer.active];
    const view = $(".pair .view");
    const rows = () => $$(".readout tbody tr").map((row) => [...row.cells].map((cell) => cell.textContent));
    const canvases = () => [$(".pair .a"), $(".pair .b")].map((canvas) => pixel(canvas, 60, 40));
    const [u, v] = [60.5 / 96, 40.5 / 72];
    const choose = async (name) => { $(`input[value=${name}]`).click(); await settle(); return canvases(); };
    const set = async (control, value, event) => {
      $(control).value = value;
      $(control).dispatchEvent(new Event(event));
      await settle();
    };
    const slide = (stops) => set(".stops", stops, "input");
    await until(() => viewer.scene.items.every((item) => item.ready));
    point(view, "pointermove", u, v);
    await settle();
    found.width = innerWidth;
    found.overflow = document.scrollingElement.scrollWidth - innerWidth;
    found.where = $(".pixel").textContent;
    found.numbers = rows();
    found.divide = getComputedStyle(viewer.root).getPropertyValue("--divide");
    found.picture = canvases();
    found.outside = pixel($(".pair .a"), 1, 1);
    await slide(1);
    found.brighter = canvases();
    found.indirect = await choose("indirect");
    found.error = await choose("error");
    found.legend = $(".ramp").getAttribute("aria-label");
    found.errorOutside = pixel($(".pair .a"), 1, 1);
    await slide(-12);
    found.steep = canvases();
    await slide(12);
    found.flat = canvases();
    $(".fit").click(); await settle();
    found.fitted = Number($(".stops").value);
    found.relative = await choose("relative");
    found.false = await choose("false");
    await choose("picture");
    await slide(0);

    await set(".judge", "unoccluded", "change");
    found.against = rows();
    await set(".judge", "truth", "change");

    const pair = () => [$("select.left").value, $("select.right").value];
    found.pairs = [pair()];
    for (const key of ["f", "2", ".", ",", ","]) { press(key); found.pairs.push(pair()); }
    press("1");
    press("f", $("select.left"));
    found.pairs.push(pair());
    await settle();

    $("[data-zoom='2']").click();
    const where = () => new Set($$(".view canvas").map((canvas) => getComputedStyle(canvas).transform)
      .map((text) => text.match(/matrix\\(([^,]*)/)[1]));
    found.zoomed = [...where()];
    point(view, "pointermove", 0.5, 0.5); await settle();
    found.centre = $(".pixel").textContent;
    view.focus();
    for (let i = 0; i < 12; i++) press("+", view);
    found.most = [...where()];
    point(view, "pointermove", 0.999, 0.999); await settle();
    found.corner = $(".pixel").textContent;
    press("ArrowRight", view, { shiftKey: true }); await settle();
    found.stepped = $(".pixel").textContent;
    press("0", view);
    found.reset = [...where()];
    view.dispatchEvent(new WheelEvent("wheel", { deltaY: -500, bubbles: true, cancelable: true }));
    found.wheel = [...where()].map(Number);
    $(".crops button").click(); await settle();
    found.crop = [viewer.s, ...viewer.pixel];
    found.crops = $$(".crops button").map((button) => button.getAttribute("aria-label"));
    found.cropPixel = pixel($(".crops canvas.left"), 4, 4);
    found.chosen = $$(".readout .chosen th").map((cell) => cell.textContent);

    const figures = $("table.sortable");
    const names = () => $$("tbody th", figures).map((cell) => cell.textContent);
    const headers = $$("thead button", figures);
    found.sorted = [names()];
    for (const n of [3, 3, 2, 10]) { headers[n].focus(); headers[n].click(); found.sorted.push(names()); }
    found.sortedBy = $$("[aria-sort]", figures).map((cell) => [cell.textContent, cell.getAttribute("aria-sort")]);
"""


@pytest.fixture(scope="module")
def comparison():
    return make_comparison(make_scene(), HEIGHT, WIDTH)


@pytest.fixture(scope="module")
def found(comparison, tmp_path_factory):
    return clicked(page(comparison), SCRIPT, tmp_path_factory.mktemp("viewer"))


def made(comparison):
    return [*comparison.results.values(), *comparison.references.values()]


def shown(text):
    return float(text.replace("\N{MINUS SIGN}", "-").strip("±+ %"))


def near(colour, expected, steps):
    return np.abs(np.array(colour, int) - np.array(expected, int)).max() <= steps


def at(values):
    return values[..., AT[1], AT[0]]


def test_nothing_fails(found):
    assert found["faults"] == []


def test_the_numbers_at_the_pixel_are_those_of_the_arrays(found, comparison):
    truth = luminance(comparison.truth.irradiance)
    assert found["where"] == f"Pixel {AT[0]}, {AT[1]}"
    for row, one in zip(found["numbers"], made(comparison), strict=True):
        numbers = [shown(text) for text in row[1:]]
        assert numbers[:3] == pytest.approx(at(one.irradiance), rel=HALF + DIGITS)
        assert numbers[3:6] == pytest.approx(at(one.radiance), rel=RADIANCE)
        if hasattr(one, "variance"):
            error, over = at(luminance(np.sqrt(one.variance))), at(luminance(one.irradiance))
        else:
            error, over = at(luminance(one.irradiance) - truth), at(truth)
        rounding = 2 * HALF * at(truth) * 1.7
        assert numbers[6] == pytest.approx(error, abs=rounding, rel=DIGITS)
        assert numbers[7] == pytest.approx(100 * error / over, abs=100 * rounding / over, rel=DIGITS)
        assert row[7].startswith("±") == hasattr(one, "variance")


def test_the_error_is_against_the_chosen_reference_where_the_method_knows_no_visibility(found, comparison):
    by_truth, by_other = ([shown(row[7]) for row in found[key]] for key in ("numbers", "against"))
    lums = {one.name: at(luminance(one.irradiance)) for one in made(comparison)}
    for i, name in enumerate(("sii", "gather")):
        assert by_other[i] == pytest.approx(lums[name] - lums["unoccluded"], abs=4 * HALF * lums[name])
        assert by_other[i] != by_truth[i]
    assert by_other[2:] == by_truth[2:]


def test_pictures_are_toned_as_the_png_is_at_any_exposure(found, comparison):
    sii, truth = comparison.results["sii"], comparison.truth
    for key, exposure in (("picture", 1.0), ("brighter", 2.0)):
        for colour, one in zip(found[key], (sii, truth), strict=True):
            assert near(colour, tone_map(at(one.radiance), exposure * comparison.scene.exposure), 1)
    assert found["picture"] != found["brighter"]
    assert found["outside"] == [0, 0, 0]


def test_indirect_light_has_an_exposure_of_its_own(found, comparison):
    bright = np.percentile(luminance(comparison.truth.irradiance)[comparison.covered], 99)
    assert near(found["indirect"][1], tone_map(at(comparison.truth.irradiance), 0.9 / bright), 1)


def test_errors_are_red_where_too_bright_and_their_range_can_be_set(found):
    red, grey = found["error"][0], found["errorOutside"]
    assert red[0] > red[2] + 20
    assert grey == [128, 128, 128]
    assert near(found["steep"][0], (103, 0, 31), 2)  # the last colour of RdBu reversed
    assert near(found["flat"][0], (247, 247, 247), 2)  # its middle
    assert "W/m²" in found["legend"]
    assert found["relative"][0][0] > found["relative"][0][2]
    assert found["false"][0] != found["false"][1]


def test_fit_brings_the_errors_in_sight_onto_the_scale(found, comparison):
    error = luminance(comparison.results["sii"].irradiance) - luminance(comparison.truth.irradiance)
    reach = np.percentile(np.abs(error[comparison.covered]), 95)
    high = float(found["legend"].split(" to ")[1].split(",")[0])
    assert found["fitted"] == pytest.approx(np.log2(reach / high), abs=0.13)


def test_keys_flip_and_step_but_not_in_a_list(found):
    named = [[one.removeprefix("scene-") for one in pair] for pair in found["pairs"]]
    assert named == [["sii", "truth"], ["truth", "sii"], ["gather", "sii"], ["vpl", "sii"], ["gather", "sii"],
                     ["sii", "sii"], ["sii", "sii"]]
    assert found["divide"] == f"{100 * 60.5 / 96:.0f}%"


def test_all_pictures_zoom_together_down_to_pixels(found):
    assert found["zoomed"] == ["2"]
    assert found["centre"] == f"Pixel {WIDTH // 2}, {HEIGHT // 2}"
    assert found["most"] == ["64"]
    x, y = map(int, found["corner"].removeprefix("Pixel ").split(" ·")[0].split(", "))
    assert (x, y) == (WIDTH // 2, HEIGHT // 2)  # one pixel and a half are in sight
    assert found["stepped"].startswith(f"Pixel {WIDTH // 2 + 1}, ")
    assert found["reset"] == ["1"]
    assert found["wheel"] == [pytest.approx(np.exp(1), rel=1e-3)]


def test_worst_places_lead_there(found, comparison):
    error = (luminance(comparison.results["sii"].irradiance) - luminance(comparison.truth.irradiance)) ** 2
    error[~comparison.covered] = 0
    side = min(WIDTH, HEIGHT) // 8
    windows = np.lib.stride_tricks.sliding_window_view(error, (side, side)).sum((2, 3))
    y, x = np.unravel_index(windows.argmax(), windows.shape)
    share = round(100 * windows.max() / error.sum())
    assert found["crops"][0] == f"Show {share} % of the squared error in {side} {TIMES} {side} pixels at {x}, {y}"
    assert found["crop"][1:] == [x + side // 2, y + side // 2]
    assert found["crop"][0] > 2
    right = tone_map(comparison.results["sii"].radiance[:, y + 4, x + 4], comparison.scene.exposure)
    assert near(found["cropPixel"], right, 1)
    assert found["chosen"] == ["sii"]


def test_tables_sort_by_numbers_either_way_and_keep_the_unknown_last(found, comparison):
    rows = [(one.name, measured.figures["relmse"].value, one.seconds, one.flip.mean if judge == "truth" else np.nan)
            for one in comparison.results.values() for judge, measured in one.against.items()]
    assert found["sorted"][0] == [row[0] for row in rows]
    ascending = [row[0] for row in sorted(rows, key=lambda row: row[1])]
    assert found["sorted"][1] == ascending
    assert found["sorted"][2] == ascending[::-1]
    assert found["sorted"][3] == [row[0] for row in sorted(rows, key=lambda row: row[2])]
    assert found["sorted"][4][:2] == ["vpl", "sii"]
    assert found["sortedBy"] == [["FLIP", "ascending"]]


def test_a_phone_shows_it_without_sideways_scrolling(comparison, tmp_path):
    script = """
    await until(() => Viewer.active.scene.items.every((item) => item.ready));
    found.width = innerWidth;
    found.overflow = document.scrollingElement.scrollWidth - document.documentElement.clientWidth;
    found.view = $(".pair .view").getBoundingClientRect().width;
"""
    found = clicked(page(comparison), script, tmp_path, width=390)
    assert found["faults"] == []
    assert found["width"] <= 500
    assert found["overflow"] <= 0
    assert found["view"] > 0.8 * found["width"]
