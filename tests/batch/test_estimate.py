"""Estimates: of methods whose time is a line of the pixels, by a clock that they move."""

from types import SimpleNamespace

import pytest

from refgi.batch import schedule as module
from refgi.batch.jobs import jobs_of
from refgi.batch.plan import read_plan
from refgi.batch.schedule import estimate
from refgi.batch.shared import Common
from refgi.errors import InputError

PLAN = """
[batch]
scenes = ["cornell_box"]
size = [200, 100]
rounds = 3
path = "way.toml"
frames = 2
truth = {samples = 48}
[sii]
lights = [16, 64]
[gather]
"""
PIXELS = 200 * 100


def test_time_grows_with_the_pixels_and_counts_every_run(tmp_path, monkeypatch):
    (tmp_path / "plan.toml").write_text(PLAN)
    (tmp_path / "way.toml").write_text("[[camera]]\nat = 0.0\neye = [0.278, 0.273, -0.8]\n")
    plan = read_plan(tmp_path / "plan.toml")
    clock = SimpleNamespace(now=0.0)

    def method(fixed, slope):
        def run(frame, _):
            clock.now += fixed + slope * frame.width * frame.height

        return SimpleNamespace(made=run)

    def refusing(*_):
        raise InputError("refused")

    jobs = jobs_of(plan)
    methods = {"sii": method(2.0, 1e-4), "gather": SimpleNamespace(made=refusing), "truth": method(0.5, 1e-3)}
    monkeypatch.setattr(module, "METHODS", methods)
    monkeypatch.setattr(module, "time", SimpleNamespace(perf_counter=lambda: clock.now))
    found = estimate(jobs, Common(tmp_path, tmp_path, plan.truth, 32), lambda *_: None)
    assert found.seconds == pytest.approx(2 * 2 * (3 + 1) * (2.0 + 1e-4 * PIXELS))  # frames, settings, runs
    assert found.truth_seconds == pytest.approx(2 * (0.5 + 1e-3 * PIXELS))
