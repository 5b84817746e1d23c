"""`refgi render --engine literal`: the literal text in place of kernels, in a picture."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from refgi.cli.group import VerbGroup
from refgi.image import read_exr
from refgi.literal import direct, pairs
from refgi.vectors.rows import edited

SMALL = ["cornell_box", "--size", "20x15", "--rsm-resolution", "24", "--set"]
SETTINGS = {"sii": ["lights=40"], "hssil": ["samples=12"]}


def rendered(tmp_path, method, engine):
    out = tmp_path / f"{method}-{engine}.exr"
    done = CliRunner().invoke(VerbGroup.refgi(), [
        "render", *SMALL, *SETTINGS[method], "--method", method, "--engine", engine, "--json", "--out", str(out)])
    assert done.exit_code == 0, done.output
    return read_exr(out)[0], json.loads(done.stdout), out


@pytest.mark.parametrize(("method", "stages"), [
    ("sii", {"pairs.sum", "rsm.direct_irradiance"}), ("hssil", {"sssil.blur", "sssil.upsample"})])
def test_the_picture_is_that_of_the_kernels(tmp_path, method, stages):
    expected, plain, _ = rendered(tmp_path, method, "kernels")
    found, said, _ = rendered(tmp_path, method, "literal")
    assert "literal" not in plain
    assert stages <= {one["stage"] for one in said["literal"]}
    assert all(one["literal"] > 0 for one in said["literal"])
    assert min(expected[name].max() for name in ("R", "irradiance.R")) > 0
    for name, plane in expected.items():
        assert np.abs(found[name] - plane).max() <= 2e-6 * np.abs(plane).max(), name


def test_it_is_the_literal_text_that_ran(tmp_path, monkeypatch):
    right, _, _ = rendered(tmp_path, "sii", "literal")
    doubled = edited(pairs.irradiance, (("flux / np.pi * term", "2 * flux / np.pi * term"),))
    monkeypatch.setattr(pairs, "irradiance", doubled)
    dark = edited(direct.direct_irradiance, (("strength.reshape(3, 1, 1) *", "0 * strength.reshape(3, 1, 1) *"),))
    monkeypatch.setattr(direct, "direct_irradiance", dark)
    wrong, _, _ = rendered(tmp_path, "sii", "literal")
    np.testing.assert_allclose(wrong["irradiance.G"], 2 * right["irradiance.G"], rtol=1e-6)
    direct_light = right["G"] - wrong["G"] / 2
    assert direct_light.max() > 0.1 * right["G"].max()


def test_such_a_picture_is_not_made_again(tmp_path):
    _, _, out = rendered(tmp_path, "sii", "literal")
    done = CliRunner().invoke(VerbGroup.refgi(), ["render", "--again", str(out)])
    assert done.exit_code == 2
    assert "made by the literal engine" in done.output
