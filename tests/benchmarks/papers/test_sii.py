"""Every figure of the 2006 paper, made tiny: what it holds, and that the printed numbers are the paper's."""

import math

import numpy as np
import pytest

from benchmarks.papers.sii.lights import _blocks
from benchmarks.papers.sii.subjects import BOX, reference_length
from benchmarks.papers.workbench import Workbench, errors_of
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.lights.settings import LightSettings
from refgi.scene import load_scene
from refgi.settings import of
from tests.benchmarks.papers.conftest import SMALL, table

pytestmark = pytest.mark.slow  # the whole paper is made

AT_THE_RIM = 1e-4  # of the pairs: kernels decide in float32


@pytest.fixture
def figures(reproduced):
    return reproduced("sii")[1]


def ratios(figure):
    return {bar.label: bar.paper for one in figure.ratios for bar in one.bars}


# as printed: frames per second of Figures 4, 11 and 12 and Table 3, milliseconds of Tables 1 and 2
@pytest.mark.parametrize(("key", "label", "ratio"), [
    ("fig4", "glass ball, back faces alone", 150 / 95), ("fig11", "5 %", 54 / 14), ("fig11", "7 %", 74 / 14),
    ("fig12", "RSM, 308 samples", 44 / 14), ("fig12", "RSM, 156 samples", 82 / 14),
    ("fig12", "SII, 768 lights, 5 %", 48 / 14), ("fig12", "SII, 768 lights, 10 %", 83 / 14),
    ("fig12", "SII, 108 lights, 5 %", 254 / 14),
    ("table1", "dynamic light, static camera", 10.8 / 10.4), ("table1", "static light, dynamic camera", 9.3 / 10.4),
    ("table1", "static scene, just render", 6.9 / 10.4),
    ("table2", "A, 4096 samples, 4 levels", 3.484 / 0.123), ("table2", "B, 1024 samples, 1 level", 0.111 / 0.123),
    ("table3", "full resolution", 37 / 27), ("table3", "half resolution", 85 / 63),
])
def test_the_papers_ratios_are_the_printed_ones(figures, key, label, ratio):
    assert ratios(figures[key])[label] == pytest.approx(ratio, rel=1e-12)


@pytest.mark.parametrize(("key", "is_speed"), [("fig4", True), ("fig12", True), ("table1", False)])
def test_ratios_here_are_those_of_the_times_in_the_table(figures, key, is_speed):
    milliseconds = [row[1] for row in figures[key].tables[0].rows]
    for bar, own in zip(figures[key].ratios[0].bars, milliseconds, strict=True):
        assert bar.here == pytest.approx(milliseconds[0] / own if is_speed else own / milliseconds[0])


def test_errors_are_shares_of_the_references_mean():
    reference = np.zeros((3, 2, 2))
    reference[:, 0] = (1.0, 3.0)  # mean 2 over the covered row
    covered = np.array([[True, True], [False, False]])
    assert errors_of(reference + 0.2, reference, covered) == pytest.approx((10.0, 10.0, -10.0))
    assert errors_of(reference * (1, 0), reference, covered) == pytest.approx((100 * math.sqrt(4.5) / 2, 75.0, 75.0))
    assert all(map(math.isnan, errors_of(reference, 0 * reference, covered)))


def test_the_overdraw_is_that_of_figure_8(figures):
    rows = {name: (here, paper) for name, here, paper in figures["fig8"].tables[0].rows}
    assert rows["fragments a light"][1] == pytest.approx(42667, abs=1)  # 512^2 * 125 / 768
    here, paper = rows["mean overdraw"]
    assert here == pytest.approx(paper, rel=0.1)  # the reference length is sought on 64 x 64 pixels


@pytest.mark.feature("SII-24")
def test_the_counters_are_those_of_an_independent_count(figures, evidence):
    """Sec. 6: P O 72 bits of splats and P S 112 of a gather, with P and O counted pair by pair in float64."""
    frame = Frame(load_scene(BOX), width=SMALL.size, height=SMALL.size, rsm_resolution=SMALL.rsm_resolution)
    lights, pixels = choose_lights(frame, of(LightSettings, count=768)), np.count_nonzero(frame.gbuffer.covered)
    length = reference_length(Workbench(SMALL), BOX)
    count = pairs_within(frame, lights, 0.05 * lights.flux.max() / math.pi / length**2)
    byte = 1 / (8 * 2**20)
    expected = {
        "mean overdraw": (count / pixels, 125), "share of the lights": (count / pixels / 768, 125 / 768),
        "fragments a light": (count / 768, 512**2 * 125 / 768), "bits read a fragment": (72, 72),
        "bits read a sample of gathering": (112, 112),
        "MB read by the splats": (72 * count * byte, 72 * 512**2 * 125 * byte),
        "MB read by 308 samples at every pixel": (112 * pixels * 308 * byte, 112 * 512**2 * 308 * byte)}
    found = {name: (here, paper) for name, here, paper in figures["fig8"].tables[0].rows}
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        assert found[name] == pytest.approx(values, rel=AT_THE_RIM), name
    evidence(f"Figure 8 at {SMALL.size}^2: {count} fragments counted pair by pair are {72 * count * byte:.2f} MB, "
             f"printed {found['MB read by the splats'][0]:.2f}; gathering {found[name][0]:.2f} MB")


def pairs_within(frame, lights, low):
    """Count pairs of diffuse light and pixel with Phi / pi cos / r^2 >= I_low."""
    x, count = frame.gbuffer.position[:, frame.gbuffer.covered].astype(float), 0
    for p, n, flux in zip(*(part.T.astype(float) for part in lights[:3]), strict=True):
        away = x - p[:, None]
        count += np.count_nonzero(flux.max() / math.pi * (n @ away) >= low * (away**2).sum(axis=0) ** 1.5)
    return count


def test_gathering_has_the_right_mean_and_gets_worse_with_fewer_samples(figures):
    """Within 0.3 of the map most light is missing, however many samples; over the whole map errors are of noise."""
    mae = {name: row["MAE to every texel"] for name, row in table(figures["fig12"]).items()}
    assert mae["RSM, 1020 samples"] < mae["RSM, 308 samples"] < mae["RSM, 156 samples"] < 30
    assert mae["RSM, 1020 samples within 0.3 of the map"] > 60


def test_widening_smooths_the_ring(figures):
    rows = table(figures["fig4"])
    plain, wide = (row["RMSE to path tracing"] for name, row in rows.items() if name.startswith("metal ring"))
    assert wide < plain


def test_blocks_are_means_of_eight_by_eight():
    image = np.arange(3 * 16 * 24.0).reshape(3, 16, 24)
    assert _blocks(image)[1, 1, 2] == image[1, 8:, 16:].mean()


def test_ellipses_are_those_of_the_appendix(figures):
    """E-SII-12 and 13: c of Eq. 8, volumes 1.080, 1.240 and 1.328 times the region's, nothing outside."""
    rows = table(figures["fig9"])
    assert [row["centre c"] for row in rows.values()] == pytest.approx([0.438691, 0.578704, 0.604], abs=5e-4)
    assert [row["volume"] for row in rows.values()] == pytest.approx([1.080, 1.240, 1.328], abs=5e-4)
    for row in rows.values():
        assert row["outside by"] < 1e-12
        assert row["height"] == pytest.approx(row["region's height"], abs=1e-5)  # angles are 2 mrad apart
    assert len(figures["fig10"].tables[0].rows) == 2


def test_the_fitted_reach_stands_beside_others(figures):
    """The row that was fitted is the figure's own, and longer rays leave more lights as bright as they were."""
    scaled = table(figures["table3"])["scaled, full resolution"]
    reach = table(figures["table3"], 1)
    assert list(reach) == ["0.1", "0.25", "0.5", "1"]
    assert reach["0.25"]["fragments, share"] == scaled["fragments, share"]
    assert reach["0.25"]["energy lost, %"] == pytest.approx(scaled["energy lost, %"])
    lost = [row["energy lost, %"] for row in reach.values()]
    assert lost == sorted(set(lost), reverse=True)
    darker = table(figures["fig13"])["scaled, full resolution"]["darker by"]
    assert darker == pytest.approx(scaled["energy lost, %"])


def test_a_larger_cut_loses_more(figures):
    lost = [row[-1] for row in figures["fig11"].tables[0].rows]
    drawn = [row[4] for row in figures["fig11"].tables[0].rows]
    assert lost[0] == 0
    assert lost == sorted(lost)
    assert drawn == sorted(drawn, reverse=True)


@pytest.mark.feature("SII-29")
def test_what_rests_is_not_drawn_again(figures, evidence):
    """Table 1: which stages a frame runs is checked, how long they take is only told."""
    rows = {row[0]: row for row in figures["table1"].tables[0].rows}
    reused = {title: set(row[-1].split(", ")) for title, row in rows.items()}
    light, camera = "rsm.reflective_shadow_map", "rsm.gbuffer"
    both, moving_light, moving_camera, still = rows
    assert not {light, camera} & reused[both]
    assert camera in reused[moving_light]
    assert light not in reused[moving_light]
    assert {light, "lights.warp"} & reused[moving_camera]
    assert camera not in reused[moving_camera]
    assert {light, camera} <= reused[still]
    evidence("Table 1 at 32 x 32: " + ", ".join(f"{title} {row[1]:.0f} ms" for title, row in rows.items()))


@pytest.mark.feature("SII-29")
def test_what_rests_saves_work_in_the_order_of_the_table(figures, evidence):
    """Table 1 counted by what is kept, not by the clock: all of it moving keeps least, all of it resting most."""
    no_buffer = {"nothing", "rsm.solid_angles"}  # the latter is asked for only where a map is drawn anew
    both, light, camera, still = (set(row[-1].split(", ")) - no_buffer for row in figures["table1"].tables[0].rows)
    assert both < light < still
    assert both < camera < still
    evidence("Table 1, stages kept with light and camera, light, camera, nothing moving: "
             f"{len(both)}, {len(light)}, {len(camera)}, {len(still)}; paper 10.4, 10.8, 9.3, 6.9 ms")


@pytest.mark.feature("SII-29")
def test_warps_are_timed_by_method_samples_and_level(figures, evidence):
    rows = figures["table2"].tables[0].rows
    assert [row[0][:1] for row in rows[:4]] == ["A", "A", "B", "B"]
    assert all(cell > 0 for row in rows[:4] for cell in row[1:5])
    evidence("Table 2, levels 1 and 4: " + ", ".join(f"{row[0]} {row[1]:.2f} and {row[4]:.2f} ms" for row in rows[:4]))
