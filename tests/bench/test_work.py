"""What a frame takes beside time: pairs and rays by closed forms, memory by what must be held at least."""

import tracemalloc

import numpy as np
import pytest

from refgi import stages
from refgi.bench import measure
from refgi.bench.grid import Choice
from refgi.bench.measure import cold_seconds, first_frames, work_of, works_of
from refgi.errors import RefgiError
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.methods import METHODS
from refgi.rays import Tracer
from refgi.settings import from_text
from refgi.splat.sii.fragments import fragments
from tests.bench.conftest import SIZE

pytestmark = pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")

LIGHTS = 32


@pytest.fixture(scope="module")
def frame(box):
    return Frame(box, **SIZE)


@pytest.fixture(scope="module")
def shown(frame):
    return np.count_nonzero(frame.gbuffer.covered)


def choice(method, *changes):
    return Choice(method, changes, from_text(METHODS[method].settings(), changes))


LOADED = set()


def taken(box, method, *changes, **options):
    """Kernels are compiled or loaded before: under `tracemalloc` that takes several times as long."""
    one, options = choice(method, *changes), {**SIZE, **options}
    if (method, changes) not in LOADED:
        LOADED.add((method, changes))
        METHODS[method].made(Frame(box, **options), one.settings)
    return work_of(box, one, options)


def recorded(frame, one, stage):
    with stages.observe(record=True) as log:
        METHODS[one.method].function(frame, one.settings)
    return next(run for run in log.runs if run.name == stage)


@pytest.fixture(scope="module")
def shining(frame):
    """Of LIGHTS draws, those that meet a texel with a surface that is lit."""
    return np.count_nonzero(choose_lights(frame, choice("sii", f"lights={LIGHTS}").settings.lights).flux.any(axis=0))


@pytest.mark.parametrize("changes", [("sii", "clamp=none"), ("vpl",)])
def test_pairs_are_lights_times_pixels_with_a_surface(box, shown, shining, changes):
    method, *more = changes
    assert taken(box, method, f"lights={LIGHTS}", *more).pairs == shining * shown
    assert shown < SIZE["width"] * SIZE["height"]


def test_the_samples_that_a_warning_of_lost_light_takes_are_counted(box, shown, shining):
    """Twice all pixels of so small a picture: with the clamp and without."""
    assert taken(box, "sii", f"lights={LIGHTS}").pairs == 3 * shining * shown


def test_rays_are_those_of_pairs_that_face_each_other(box):
    lit = taken(box, "vpl", f"lights={LIGHTS}")
    assert 0.3 * lit.pairs < lit.rays < lit.pairs
    assert taken(box, "sii", f"lights={LIGHTS}").rays == 0


def test_a_ray_without_reach_is_not_traced(box):
    tracer, count = Tracer(box.geometry), 10
    reach = np.where(np.arange(count) < 3, 0, 1).astype(np.float32)
    origins, directions = np.full((count, 3), 0.5, np.float32), np.ones((count, 3), np.float32)
    with stages.observe(counting=True) as log:
        tracer.fill_occluded(origins, directions, reach, np.empty(count, np.bool_))
        tracer.fill_closest(origins, directions, reach, np.empty(count, np.int32), np.empty(count, np.float32))
    assert log.counts == {"rays": 2 * (count - 3)}


def test_a_log_that_does_not_count_holds_no_counts():
    with stages.observe() as log:
        stages.tally("rays", lambda: pytest.fail("counted although nobody asked"))
    assert log.counts is None


def test_a_cut_leaves_out_pairs_as_its_fragments_are_counted(box, frame, shown, shining):
    one = choice("sii", f"lights={LIGHTS}", "clamp=none", "cut=relative", "cut.share=0.5")
    splat = recorded(frame, one, "sii.splat").arguments
    counted = fragments(splat["receivers"], splat["lights"], splat["settings"], splat["footprint"], splat["projection"])
    lost = shining * shown  # of the sample by which the cut's loss is known
    assert taken(box, "sii", *one.changes).pairs - lost == counted.evaluated < 0.5 * shining * shown


@pytest.mark.parametrize(("side", "share"), [(1, 1.0), (2, 0.25)])
def test_interleaved_pixels_sum_their_share_of_the_lights(box, shown, shining, side, share):
    found = taken(box, "val", f"lights={LIGHTS}", "clusters.count=4", "pairs.clamp=none",
                  f"interleaving.block={side}")
    assert found.pairs == pytest.approx(share * shining * shown, rel=0.05 if side > 1 else 0)


def test_gathering_takes_its_samples_at_each_pixel(box, shown):
    assert taken(box, "gather", "samples=25", "interpolation=none").pairs == 25 * shown


def test_levels_take_their_samples_at_each_texel(box):
    found = taken(box, "hssil", "samples=16", "levels=2", "start=full", "pattern=pixel", "inner_samples=4")
    assert found.pairs == 40 * 36 * (16 + 4) + 20 * 18 * 16
    assert taken(box, "hssil", "samples=16", "levels=1", "start=full").pairs == 40 * 36 * 16


def test_subsplats_take_each_light(box, frame):
    one = choice("multires", f"lights={LIGHTS}", "clamp=none")
    inputs = recorded(frame, one, "multires.evaluate").arguments
    expected = inputs["points"].shape[1] * np.count_nonzero(inputs["lights"].flux.any(axis=0))
    assert taken(box, "multires", *one.changes).pairs == expected


def test_pairs_of_an_error_target_are_those_it_states(box, frame):
    one = choice("multires", f"lights={LIGHTS}", "clamp=none", "subsplats=error", "subsplats.target=0.05")
    assert taken(box, "multires", *one.changes).pairs == recorded(frame, one, "error_target.error_driven").output.pairs


def test_each_pass_more_takes_as_many_rays(box):
    """Beside those of the pilot, which is there once."""
    few, more, many = (taken(box, "truth", f"samples={count}", width=16, height=12) for count in (48, 96, 192))
    assert many.rays - more.rays == pytest.approx(2 * (more.rays - few.rays), rel=0.02)
    assert few.pairs == 0


def test_bytes_of_stages_grow_with_the_pixels(box):
    """Each pixel has at least its id, position and normal, 28 bytes, and no more than some planes beside them.

    A texel of a shadow map has its id and depth, 8 bytes: the rest is known where lights are drawn alone.
    """
    small, large = (taken(box, "sii", f"lights={LIGHTS}", width=side, height=side).bytes for side in (64, 128))
    assert 28 <= (large - small) / (128**2 - 64**2) < 200
    more = taken(box, "sii", f"lights={LIGHTS}", width=64, height=64, rsm_resolution=128).bytes
    assert 8 <= (more - small) / (128**2 - 64**2) < 28


def test_memory_holds_the_frame_s_buffers_and_not_the_scene(box):
    small, large = (taken(box, "sii", f"lights={LIGHTS}", width=size, height=size) for size in (128, 256))
    held = 256 * 256 * (3 + 3 + 3) * 4  # position, normal, irradiance
    assert held < large.peak_bytes < 12 * held
    assert large.peak_bytes - small.peak_bytes == pytest.approx(0.75 * large.peak_bytes, rel=0.3)
    tracemalloc.start()
    kept = np.ones(1 << 20)  # of others
    assert taken(box, "sii", f"lights={LIGHTS}", width=128, height=128).peak_bytes == pytest.approx(
        small.peak_bytes, rel=0.02)
    tracemalloc.stop()
    assert kept.all()


def test_choices_without_a_picture_are_left_out(box):
    told = []
    choices = [choice("sii", f"lights={LIGHTS}"), Choice("sii", (), None)._replace(settings=Failing())]
    assert list(works_of(box, dict(enumerate(choices)), SIZE, lambda *said: told.append(said))) == [0]
    assert len(told) == 2


class Failing:
    """Settings that any method refuses."""

    def __getattr__(self, name):
        raise RefgiError(name)


def test_a_new_process_takes_time_of_its_own_and_says_why_it_fails(tmp_path, monkeypatch):
    assert 0.2 < cold_seconds("cornell_box", "sii", SIZE) < 600
    monkeypatch.setattr(measure, "FIRST_FRAME", "import sys; sys.exit(f'first\\nno such file: {sys.argv[1]}')")
    why = r"sii: a new process gave no frame of .*nothing\.json: no such file: .*nothing\.json"
    with pytest.raises(RefgiError, match=why) as caught:
        cold_seconds(str(tmp_path / "nothing.json"), "sii", SIZE)

    def seconds(source, name, options):
        if name == "sii":
            raise caught.value
        return (source, options)

    monkeypatch.setattr(measure, "cold_seconds", seconds)
    assert first_frames("box", ["sii", "vpl"], SIZE, lambda *_: None) == {"vpl": ("box", SIZE)}
