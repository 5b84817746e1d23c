"""A small bench of the Cornell box that several tests look at, run once in a process."""

import warnings

import pytest

from refgi.bench.grid import Choice, Grid
from refgi.bench.measure import bench_scene
from refgi.bench.pictures import Place
from refgi.errors import RefgiWarning
from refgi.methods import METHODS
from refgi.scene import load_scene
from refgi.settings import of
from refgi.truth import TruthSettings

ROUNDS = 2
SIZE = {"width": 40, "height": 36, "rsm_resolution": 64, "shadows": "exact"}


def choice(method, **changes):
    made = of(METHODS[method].settings, **changes)
    return Choice(method, tuple(f"{key}={value}" for key, value in changes.items()), made)


GRID = Grid((choice("sii", lights=32), choice("sii", lights=256), choice("vpl", lights=32), choice("gather")), (2, 4))


@pytest.fixture(scope="session")
def box():
    return load_scene("cornell_box")


@pytest.fixture(scope="session")
def benched(box, tmp_path_factory):
    """The folder with its pictures, and what was found."""
    out = tmp_path_factory.mktemp("bench")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)
        found = bench_scene(box, GRID, rounds=ROUNDS, truth=TruthSettings(samples=96),
                            place=Place(out, "pictures/box"), **SIZE)
    return out, found


@pytest.fixture(scope="session")
def bench(benched):
    return benched[1]
