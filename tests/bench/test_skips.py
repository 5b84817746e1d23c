"""Skips: each fires on some scene and changes no bit there; what is measured of them is what there is."""

import hashlib
import warnings

import numpy as np
import pytest

from refgi import skips
from refgi.bench import dim_lights as dim
from refgi.bench.skips import measure_skips
from refgi.errors import InputError, RefgiWarning
from refgi.frame import Frame
from refgi.methods import METHODS, render
from refgi.pairs import irradiance as pairs
from refgi.scene import load_scene
from refgi.settings import from_text

OPTIONS = {"width": 24, "height": 18, "rsm_resolution": 64}
# of every skip: scenes, methods and settings with which it has something to leave out
CASES = {
    "frame.buffers": [("cornell_box", "gather", "disc.samples=8")],
    "rsm.channels": [("cornell_box", "sii", "lights=16")],
    "rsm.texels": [("cornell_box", "sii", "lights=16")],
    "lights.refraction": [("cornell_box", "sii", "lights=16"),
                          ("cornell_box", "sii", "lights=16", "lights.source.refraction=two_interface")],
    "pairs.pixels": [("wedge", "sii", "lights=70"), ("wedge", "val", "lights=32", "clusters=3"),
                     ("wedge", "gather", "disc.samples=8"), ("wedge", "gather", "disc.samples=8", "interpolation.grid=4")],
    "pairs.tiles": [("cornell_sphere:faces=80", "sii", "lights=200"),
                    ("cornell_sphere:faces=80", "val", "lights=200", "clusters=3"),
                    ("cornell_sphere:faces=80", "multires", "lights=196")],
    "pairs.lobes": [("cornell_box", method, "lights=64") for method in ("sii", "multires", "val", "vpl")],
    "pairs.lobe_tiles": [("ring:faces=320", "sii", "lights=128")],
    "pairs.shadow_rays": [("cornell_box", "vpl", "lights=32"), ("ring:faces=320", "vpl", "lights=32")],
    "sii.bounds": [("cornell_box", "sii", "lights=64", "reach.cut=relative", "reach.cut.share=0.2", f"reach.bound={bound}")
                   for bound in ("tangent", "quad")],
    "cluster.distances": [("cornell_box", "val", "lights=128", "clusters=12")],
    "cluster.maps": [("wedge", "val", "lights=32", "clusters=3", f"visibility={kind}")
                     for kind in ("csm", "pcss", "pcf", "hard")],
    "cluster.subsets": [("cornell_box", "val", "lights=64", "clusters=8", "interleaving.block=4")],
    "cluster.facing": [("cornell_box", "val", "lights=64", "clusters=4")],
    "cluster.receivers": [("cornell_box", "val", "lights=32", "clusters=3", "visibility=rays_rectangle")],
    "sssil.levels": [("cornell_box", "hssil", "sampling.levels=6", "sampling.radius=9")],
    "sssil.senders": [("cornell_box", "hssil")],
    "truth.photons": [("cornell_box", "truth", "samples=24", "photons=64")],
}


def settings_of(method, changes):
    return from_text(METHODS[method].settings(), changes)


def digest(scene, method, settings, *off):
    with skips.without_skip(*off):
        made = render(scene, method, settings, **OPTIONS)
    return hashlib.sha256(made.irradiance.tobytes() + made.radiance.tobytes()).hexdigest()


def test_every_skip_has_a_case():
    assert set(CASES) == set(skips.SKIPS)


@pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")
@pytest.mark.parametrize(("name", "case"), [(name, case) for name, cases in CASES.items() for case in cases],
                         ids=lambda value: value if isinstance(value, str) else "-".join(value))
def test_a_skip_fires_and_changes_no_bit(name, case, evidence):
    place, method, *changes = case
    scene, settings = load_scene(place), settings_of(method, changes)
    with skips.count_skips() as counts:
        made = digest(scene, method, settings)
    assert 0 < counts[name].left_out <= counts[name].of
    assert digest(scene, method, settings, name) == made
    evidence(f"{name} on {place}, {method}: {counts[name].left_out} of {counts[name].of} left out, the same bits")
