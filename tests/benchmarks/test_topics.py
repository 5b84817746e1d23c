"""The topics of `python -m benchmarks`: pages name those that there are, and what is timed gives the same numbers."""

import math
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks import eq2, peers
from benchmarks.__main__ import COMMANDS, topics
from benchmarks.harness import Row, ratio
from refgi.pairs.lobe_sum import add_lobes
from refgi.pairs.pair_sum import Clamp, sum_pairs
from refgi.scene import load_scene
from refgi.settings.text import from_text
from refgi.splat.sii import SiiSettings
from refgi.vectors.recorded import recorded_case
from refgi.vectors.spec import expected_of

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "Makefile", *(ROOT / "docs").rglob("*.md")]
ASKED = re.compile(r"-m benchmarks ([a-z][\w-]*)")
QUICK = ("startup", "truth_mitsuba")  # that take seconds and need no scene of REFGI_DATA


def test_pages_ask_for_topics_and_commands_that_there_are():
    asked = {word for page in PAGES if "_build" not in page.parts for word in ASKED.findall(page.read_text("utf-8"))}
    assert len(asked) > 10
    assert asked <= {*topics(), *COMMANDS}


def test_every_topic_has_a_page_or_a_reason():
    text = " ".join(page.read_text("utf-8") for page in PAGES if "_build" not in page.parts)
    silent = {name for name in topics() if not re.search(rf"\b{name}\b", text)}
    assert silent <= {"eq2", "startup", "truth"}  # aims of the project, shown by `make bench`


def test_a_yardstick_sums_what_the_strict_kernel_does():
    position, normal, packed = eq2.room(64, 48, np.float32)
    strict, free = np.zeros_like(position), np.zeros_like(position)
    sum_pairs(position, normal, packed, None, True, strict)
    eq2.sum_pairs_freely(position, normal, packed, free)
    np.testing.assert_allclose(free, strict, rtol=2e-5, atol=1e-5 * strict.max())
    lobes = np.concatenate([packed[:6], packed[3:6], np.full((1, 48), 20, np.float32), packed[6:]])
    clamp = Clamp(np.float32(0), np.zeros(48, np.float32), np.float32(np.inf))
    strict[:] = 0
    add_lobes(position, normal, lobes, clamp, None, None, None, strict)
    eq2.lobes_freely(eq2.power_in_lanes())(position, normal, lobes, free)
    np.testing.assert_allclose(free, strict, rtol=1e-4, atol=1e-5 * strict.max())


def test_a_peer_does_the_same_work_or_is_refused():
    case = recorded_case("peers", load_scene("cornell_box"), "sii", from_text(SiiSettings(), ["lights=16"]),
                         only="pairs.sum", width=16, height=12)
    known, (step,) = expected_of(case), case.stages
    result = np.empty_like(known["pairs.sum"])
    numba = partial(peers.sum_plainly, *(known[name] for name in step.reads), result.reshape(3, -1))
    peers.expect_same({"plain Numba": numba}, step, known, result)
    with pytest.raises(AssertionError, match="plain Numba: off by"):
        peers.expect_same({"plain Numba": lambda: known["pairs.sum"] * 1.01}, step, known, result)


def test_aims_are_met_or_not_and_ratios_are_of_pairs():
    assert [Row("a", 1.0, "", aim).meets_aim for aim in ("", "<= 1", ">= 1.1")] == [None, True, False]
    assert ratio(lambda: sum(range(20_000)), lambda: None, 3).low > 1


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_a_topic_runs(name):
    module = __import__(f"benchmarks.{name}", fromlist=["rows"])
    assert all(math.isfinite(row.value) for row in module.rows(True))
