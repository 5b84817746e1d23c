"""Skips by name: on unless switched off, counted where asked; each fires on some scene and changes no bit there."""

import dataclasses
import hashlib
import importlib
import math
import re
from pathlib import Path
from threading import Thread
from types import SimpleNamespace

import numpy as np
import pytest

from refgi import rays, skips
from refgi.errors import InputError
from refgi.jit import threads
from refgi.methods import METHODS, render
from refgi.scene import DirectionalLight, PointLight, SpotLight, load_scene
from refgi.settings import from_text
from refgi.skips import SKIPS, Count, count_skips, left_out, without_skip


def uncounted():
    raise AssertionError("counted though nobody asked")


def test_the_page_lists_every_skip_with_its_meaning():
    page = (Path(__file__).parents[1] / "docs" / "skips.md").read_text("utf-8")
    listed = re.findall(r"^\| `([a-z_]+\.[a-z_]+)` \| (.*) \|$", page, re.MULTILINE)
    assert listed[: len(SKIPS)] == [(name, skip.meaning) for name, skip in SKIPS.items()]


def test_all_skips_are_on_and_count_nothing():
    assert SKIPS
    assert all(left_out(name, uncounted) for name in SKIPS)


def test_blocks_switch_off_what_they_name_and_nest():
    one, two, three = list(SKIPS)[:3]

    def on():
        return [left_out(name, uncounted) for name in (one, two, three)]

    with without_skip(one):
        assert on() == [False, True, True]
        with without_skip(two, three):
            assert on() == [False, False, False]
        assert on() == [False, True, True]
    assert on() == [True, True, True]
    with pytest.raises(ZeroDivisionError), without_skip(one):
        1 / 0  # noqa: B018
    assert on() == [True, True, True]


def test_another_thread_keeps_its_skips():
    name, seen = next(iter(SKIPS)), []
    with without_skip(name):
        thread = Thread(target=lambda: seen.append(left_out(name, uncounted)))
        thread.start()
        thread.join()
    assert seen == [True]


def test_a_name_that_there_is_not_is_refused():
    with pytest.raises(InputError, match=r"skip: expected one of frame\.buffers, .*, got 'frame\.bufers'"), \
            without_skip("frame.bufers"):
        pass


def test_counts_add_up_whether_a_skip_is_on_or_off():
    one, two = list(SKIPS)[:2]
    with count_skips() as outer:
        assert left_out(one, lambda: (2, 5))
        with count_skips() as inner, without_skip(one):
            assert not left_out(one, lambda: (7, 7))
        assert left_out(one, lambda: (1, 4))
    assert (outer, inner) == ({one: Count(3, 9)}, {one: Count(7, 7)})
    assert two not in outer
    assert left_out(one, uncounted)


pytestmark = pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")

OPTIONS = {"width": 24, "height": 18, "rsm_resolution": 64}
LARGER = {"width": 96, "height": 72, "rsm_resolution": 64}  # tiles of 16 x 16 pixels that hold one surface alone
SPHERE, RING, BOX, WEDGE = "cornell_sphere:faces=320", "ring:faces=320", "cornell_box", "wedge"
CUT = ("lights=64", "reach.cut=relative", "reach.cut.share=0.2")
# of every skip: scenes, methods and settings with which it has something to leave out
CASES = {
    "frame.buffers": [(BOX, "gather", "disc.samples=8")],
    "frame.lobes": [(BOX, "sii", "lights=16"), (BOX, "sii", "lights=16", "reach.cut=relative"),
                    (BOX, "multires", "lights=16"), (BOX, "multires", "lights=4", "subsplats=irradiance"),
                    (BOX, "val", "lights=16", "clusters=3"), (BOX, "hssil"), (BOX, "hssil", "visibility=rays"),
                    (BOX, "hssil", "visibility=bitmask"), (BOX, "gather", "disc.samples=8"), (BOX, "vpl", "lights=16")],
    "rsm.channels": [(BOX, "sii", "lights=16")],
    "rsm.texels": [(BOX, "sii", "lights=16")],
    "rsm.clusters": [("cornell_sphere:faces=5000", "sii", "lights=16")],
    "lights.refraction": [(BOX, "sii", "lights=16"), (BOX, "sii", "lights=16", "source.refraction=two_interface")],
    "pairs.pixels": [(WEDGE, "sii", "lights=70"), (BOX, "sii", "lights=70", "pairs.clamp=sphere"),
                     (WEDGE, "val", "lights=32", "clusters=3"), (BOX, "val", "lights=16", "pairs.clamp=sphere"),
                     (WEDGE, "gather", "disc.samples=8"), (WEDGE, "gather", "disc.samples=8", "interpolation.grid=4")],
    "pairs.tiles": [(SPHERE, "sii", "lights=100"), (SPHERE, "val", "lights=100", "clusters=3", "pairs.clamp=none"),
                    (SPHERE, "multires", "lights=100")],
    "pairs.lobes": [(BOX, method, "lights=64") for method in ("sii", "multires", "val", "vpl")],
    "pairs.lobe_tiles": [(RING, "sii", "lights=64")],
    "pairs.receiver_lobes": [(RING, "sii", "lights=64"), (RING, "sii", *CUT)],
    "pairs.shadow_rays": [(BOX, "vpl", "lights=32"), (RING, "vpl", "lights=32")],
    "sii.bounds": [(BOX, "sii", *CUT, f"reach.bound={bound}") for bound in ("tangent", "quad")],
    "cluster.distances": [(BOX, "val", "lights=128", "clusters=12")],
    "cluster.maps": [(BOX, "val", "lights=128", "maps.resolution=32"),
                     *((WEDGE, "val", "lights=32", "clusters=3", f"visibility={kind}")
                       for kind in ("csm", "pcss", "hard"))],
    "cluster.subsets": [(BOX, "val", "lights=64", "clusters=8", "interleaving.block=4")],
    "cluster.facing": [(BOX, "val", "lights=64", "clusters=4")],
    "cluster.casters": [(SPHERE, "val", "lights=32", "clusters=3", f"visibility={kind}") for kind in ("pcf", "pcss")],
    "cluster.receivers": [(BOX, "val", "lights=32", "clusters=3", "visibility=rays_rectangle")],
    "sssil.levels": [(BOX, "hssil", "sampling.levels=6", "sampling.radius=9")],
    "sssil.senders": [(BOX, "hssil"), (BOX, "hssil", "sampling.pattern=fixed")],
    "truth.photons": [(BOX, "truth", "samples=24", "photons=64")],
}


# of every skip: functions that see more work with it off, and what of their arguments shows that
WORK = {
    "frame.buffers": {"frame._tracer": None},
    "frame.lobes": {"rsm.buffers.leaving.direct_lobes": None},
    "rsm.channels": {"rsm.buffers.gbuffer._planes": lambda names, *_: len(names)},
    "rsm.texels": {"rsm.buffers.gbuffer._planes": lambda _, shape, *__: math.prod(shape)},
    "rsm.clusters": {"rsm.raster.visibility_buffer._draw_bands": lambda *arguments: not arguments[5]},
    "lights.refraction": {"lights.refraction._refracted": None},
    "pairs.pixels": {"pairs.irradiance.taken": lambda _, places: len(places),
                     "cluster.clustered.scatter_pixels": lambda values, *_: values.shape[1],
                     "splat.gather.gather.gather_irradiance": lambda receivers, *_: receivers.covered.sum()},
    "pairs.tiles": {"pairs.irradiance.sum_pairs": lambda *arguments: not arguments[4],
                    "cluster.clustered.add_shadowed": lambda tiles, *_: tiles.high.sum(dtype=float),
                    "cluster.clustered.add_unshadowed": lambda tiles, *_: tiles.high.sum(dtype=float)},
    "pairs.lobes": {"pairs.irradiance.add_lobes": None,
                    "pairs.shadow_rays.fill_shadow_rays": lambda *arguments: len(arguments[2].lobe_exponent)},
    "pairs.lobe_tiles": {"pairs.irradiance.add_lobes": lambda *arguments: arguments[6] is not None},
    "pairs.receiver_lobes": {"pairs.irradiance.add_diffuse_lights": lambda *arguments: not arguments[8].off_lobes},
    "pairs.shadow_rays": {"rays.Tracer.fill_occluded": lambda *arguments: np.count_nonzero(arguments[3])},
    "sii.bounds": {"splat.sii.sii.sum_pairs_in_range": lambda *arguments: np.count_nonzero(arguments[5])},
    "cluster.distances": {"cluster.kmeans.iterate": lambda _, metric, *__: metric.slack},
    "cluster.maps": {"cluster.clustered.add_shadowed": None},
    "cluster.subsets": {name: lambda tiles, *_: tiles.tiles.shape[1] for name in (
        "cluster.clustered.add_shadowed", "cluster.clustered.add_unshadowed")},
    "cluster.facing": {"cluster.clustered.gather_pixels": None},
    "cluster.casters": {"cluster.clustered.add_shadowed": lambda *arguments: -arguments[4].casters.sum()},
    "cluster.receivers": {"cluster.reference.free_share": lambda _, points, *__: points.shape[1]},
    "sssil.levels": {"sssil.hssil.gather_level": None},
    "sssil.senders": {"sssil.crown._gather_shared": lambda *arguments: not arguments[6]},
    "truth.photons": {"truth.passes.photon_pass": None},
}


@pytest.fixture(autouse=True)
def _one_thread():
    """Pictures are small: waking other threads costs more than it brings."""
    with threads(1):
        yield


def settings_of(method, *changes):
    return from_text(METHODS[method].settings(), changes)


def blue(scene):
    """Return a scene in light that a look at red or green alone takes for none."""
    power = {DirectionalLight: "irradiance", PointLight: "intensity", SpotLight: "intensity"}
    return scene.with_lights(*(dataclasses.replace(one, **{name: (0.0, 0.0, getattr(one, name)[2])})
                               for one in scene.lights for name in [power[type(one)]]))


def digest(scene, method, settings, options, *off):
    with skips.without_skip(*off):
        made = render(scene, method, settings, **options)
    return hashlib.sha256(made.irradiance.tobytes() + made.radiance.tobytes()).hexdigest()


def test_every_skip_has_a_case():
    assert set(CASES) == set(WORK) == set(skips.SKIPS)


@pytest.fixture
def work(monkeypatch):
    """Return a function that says how much work of a skip there was since it was last asked."""
    total = [0.0]

    def counting(function, weight):
        def counted(*arguments, **named):
            total[0] += 1.0 if weight is None else float(weight(*arguments))
            return function(*arguments, **named)
        return counted

    def watch(name):
        for target, weight in WORK[name].items():
            place, _, attribute = target.rpartition(".")
            owner = rays.Tracer if place == "rays.Tracer" else importlib.import_module(f"refgi.{place}")
            monkeypatch.setattr(owner, attribute, counting(getattr(owner, attribute), weight))

    def done():
        found, total[0] = total[0], 0.0
        return found

    return SimpleNamespace(watch=watch, done=done)


@pytest.mark.feature("REF-19")
@pytest.mark.parametrize(("name", "case"), [(name, case) for name, cases in CASES.items() for case in cases],
                         ids=lambda value: value if isinstance(value, str) else "-".join(value))
def test_a_skip_fires_and_changes_no_bit(name, case, work, evidence):
    """The work is done with the skip off, the bits are the same, of lamps whose light one channel alone has."""
    place, method, *changes = case
    scene, settings = blue(load_scene(place)), settings_of(method, *changes)
    by_tiles = "pairs.tiles", "pairs.lobe_tiles", "pairs.receiver_lobes", "sssil.senders", "rsm.clusters"
    options = LARGER if name in by_tiles else OPTIONS
    with skips.count_skips() as counts:
        digest(scene, method, settings, options)
    assert 0 < counts[name].left_out <= counts[name].of
    work.watch(name)
    made, least = digest(scene, method, settings, options), work.done()
    assert digest(scene, method, settings, options, name) == made
    assert work.done() > least
    evidence(f"{name} on {place}, {method}: {counts[name].left_out} of {counts[name].of} left out, the same bits")
