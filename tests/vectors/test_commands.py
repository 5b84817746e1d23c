"""`refgi vectors` and `refgi check` from the shell: output, exit codes, files."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from refgi.cli.group import VerbGroup
from refgi.image import read_exr, write_exr
from refgi.vectors.manifest import Result
from tests.vectors.port import Port


@pytest.fixture
def port(kit, tmp_path):
    return Port(kit, "sii-halton", tmp_path)


def refgi(*arguments):
    return CliRunner().invoke(VerbGroup.refgi(), list(arguments))


def check(port, *options):
    return refgi("vectors", "check", str(port.kit.folder), str(port.folder), *options)


def test_right_and_wrong_output(port, tmp_path):
    assert check(port).exit_code == 0
    port.write("rsm.reflected_flux0.flux", port.arrays["rsm.reflected_flux0.flux"] / np.pi)
    done = check(port, "--json", str(tmp_path / "result.json"), "--html", str(tmp_path / "report.html"))
    assert done.exit_code == 1
    assert "first wrong stage: rsm.reflected_flux0 of sii-halton" in done.stdout
    assert "likely: flux is divided by pi" in done.stdout
    result = Result.model_validate_json((tmp_path / "result.json").read_text())
    assert result.first == ("sii-halton", "rsm.reflected_flux0")
    page = (tmp_path / "report.html").read_text()
    data = json.loads(page.partition('id="data">')[2].partition("</script>")[0])
    assert data["first"] == "sii-halton/rsm.reflected_flux0"
    (array,) = [one for one in data["stages"][data["first"]]["arrays"] if one["verdict"] == "out"]
    assert array["name"] == "rsm.reflected_flux0.flux"
    assert "http" not in page.replace("http://www.w3.org", "")


def test_what_cannot_be_compared_is_4_and_damage_is_5(port, tmp_path):
    port.write("rsm.reflected_flux0.flux", port.arrays["rsm.reflected_flux0.flux"][0])
    done = check(port)
    assert done.exit_code == 4
    assert "expected shape (3, 13, 13) (rgb, row, column), got (13, 13)" in done.stdout
    (port.folder / "sii-halton" / "rsm.reflected_flux0.flux.npy").write_bytes(b"")
    assert check(port).exit_code == 5
    done = refgi("vectors", "check", str(tmp_path), str(port.folder))
    assert done.exit_code == 5
    assert "kit.json: cannot be read" in done.stderr


def test_options_narrow_and_loosen(port):
    port.write("pairs.sum", port.arrays["pairs.sum"].astype(np.float16))
    assert check(port).exit_code == 1
    assert check(port, "--stage", "rsm").exit_code == 0
    assert check(port, "--tier", "sum=T2").exit_code == 0
    assert check(port, "--tier", "T2").exit_code == 0
    assert check(port, "--tier", "sum=T7").exit_code == 2
    assert check(port, "--stage", "pairs.summ").exit_code == 2


def test_export_of_one_case(tmp_path):
    done = refgi("vectors", "export", "--case", "sii-one-texel", "--out", str(tmp_path / "kit"))
    assert done.exit_code == 0
    assert "sii-one-texel" in done.stdout
    assert (tmp_path / "kit" / "cases" / "sii-one-texel" / "manifest.json").is_file()


def test_a_finished_picture(tmp_path):
    """By the method itself it is the same; encoded, flipped or scaled it is not, and the cause is named."""
    made, wrong = str(tmp_path / "made.exr"), str(tmp_path / "wrong.exr")
    assert refgi("render", "cornell_box", "--method", "sii", "--size", "48x36", "--out", made).exit_code == 0
    against = ("--against", "cornell_box", "--method", "sii")
    assert refgi("check", made, *against).exit_code == 0
    planes = {key: plane for key, plane in read_exr(made)[0].items() if key.startswith("irradiance")}
    for change, said in ((lambda a: a * np.pi, "pi times"), (lambda a: a[::-1], "rows run upwards")):
        write_exr(wrong, {key: np.ascontiguousarray(change(plane), np.float32) for key, plane in planes.items()})
        done = refgi("check", wrong, *against)
        assert done.exit_code == 1
        assert said in done.stdout
    assert refgi("check", made, *against, "--size", "50x36").exit_code == 2
    write_exr(wrong, {"Y": np.zeros((4, 4), np.float32)})
    done = refgi("check", wrong, *against)
    assert done.exit_code == 2
    assert "expected channels" in done.stderr
