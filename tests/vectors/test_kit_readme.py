"""Code of the kit's README runs: readers and writers in C, C++ and JavaScript, against NumPy's files."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

README = (Path(__file__).parents[2] / "refgi/vectors/files/README.md").read_text(encoding="utf-8")


def code(language):
    return "\n".join(re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL))


@pytest.fixture(scope="module")
def node():
    program = shutil.which("node")
    if program is None:
        pytest.skip("no node")
    return program


def run(node, tmp_path, text):
    """Run the README's JavaScript and more; return what it printed."""
    (tmp_path / "run.mjs").write_text(f'import fs from "node:fs";\n{code("js")}\n{text}\n')
    done = subprocess.run([node, "run.mjs"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
@pytest.mark.parametrize("kind", ["<f4", "<f8", "<i4", "<u4", "<i2", "|u1", "|b1"])
def test_javascript_reads_each_version_and_writes_what_numpy_reads(node, tmp_path, version, kind):
    array = np.arange(24).reshape(2, 3, 4).astype(kind)
    with (tmp_path / "in.npy").open("wb") as file:
        np.lib.format.write_array(file, array, version=version)
    said = run(node, tmp_path, """
const array = await readNpy(fs.readFileSync("in.npy"));
console.log(array.shape.join(), Array.from(array).join());
fs.writeFileSync("out.npy", writeNpy(array, array.shape));""")
    assert said == ["2,3,4 " + ",".join(str(int(one)) for one in array.ravel())]
    made = np.load(tmp_path / "out.npy")
    np.testing.assert_array_equal(made, array)
    assert made.dtype == np.dtype("|u1" if kind == "|b1" else kind)


@pytest.mark.parametrize("shape", [(), (5,), (0,), (1, 1, 1, 7), (123456, 2)])
def test_javascript_writes_any_shape_at_a_multiple_of_64(node, tmp_path, shape):
    np.save(tmp_path / "in.npy", np.full(shape, 2.5, np.float32))
    run(node, tmp_path, """
const array = await readNpy(fs.readFileSync("in.npy"));
fs.writeFileSync("o.npy", writeNpy(array, array.shape));""")
    made = np.load(tmp_path / "o.npy")
    assert (made.shape, made.dtype) == (shape, np.float32)
    assert (made == 2.5).all()
    assert ((tmp_path / "o.npy").stat().st_size - made.nbytes) % 64 == 0


@pytest.mark.parametrize(("language", "compiler", "source", "main"), [
    ("c", ("cc", "-std=c99"), "a.c", """int main(void) {
    size_t count; float *data = read_npy("in.npy", &count);
    return !(data && write_npy("o.npy", data, count, "(3, 4, 5)")); }"""),
    ("cpp", ("c++", "-std=c++17"), "a.cpp", """#include <cstdio>
int main() { for (float one : read_npy<float>("in.npy")) std::printf("%g ", one); }"""),
])
def test_c_and_cpp_read_and_write(tmp_path, language, compiler, source, main):
    if shutil.which(compiler[0]) is None:
        pytest.skip(f"no {compiler[0]}")
    blocks = re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
    text = "\n".join(one for one in blocks if "npy" in one)
    (tmp_path / source).write_text(f"{text}\n{main}\n")
    subprocess.run([*compiler, "-Wall", "-Wextra", "-Werror", "-o", "a", source], cwd=tmp_path, check=True)
    array = np.arange(60, dtype=np.float32).reshape(3, 4, 5)
    np.save(tmp_path / "in.npy", array)
    done = subprocess.run([tmp_path / "a"], cwd=tmp_path, check=True, capture_output=True, text=True)
    made = np.load(tmp_path / "o.npy") if language == "c" else np.float32(done.stdout.split()).reshape(3, 4, 5)
    np.testing.assert_array_equal(made, array)


def npy(array, **how):
    def write(file):
        with file.open("wb") as stream:
            np.lib.format.write_array(stream, array, **how)
    return write


@pytest.mark.parametrize(("write", "said"), [
    (npy(np.zeros(3, ">f4")), "expected elements of <f4, <f8, <i4, <u4, <i2, <u2, |i1, |u1, |b1, got >f4"),
    (npy(np.zeros(3, np.complex64)), "got <c8"),
    (npy(np.zeros(2, [("a", "<f4")])), "got {'descr': [('a', '<f4')]"),
    (npy(np.zeros((2, 3), order="F")), "expected C order, got Fortran order"),
    (lambda file: file.write_bytes(b"\x93NUMPY\x04\x00" + bytes(80)), "expected .npy of version 1, 2 or 3, got 4"),
    (lambda file: file.write_bytes(b"P6 2 2"), "expected an .npy file, got one without its header"),
    (lambda file: (np.save(file, np.zeros(3)), file.write_bytes(file.read_bytes()[:-4])),
     "expected 3 elements of <f8, got 20 bytes"),
])
def test_javascript_says_what_it_cannot_read(node, tmp_path, write, said):
    write(tmp_path / "in.npy")
    printed, = run(node, tmp_path, """
try { await readNpy(fs.readFileSync("in.npy")); console.log("read"); } catch (error) { console.log(error.message); }""")
    assert said in printed


def test_javascript_says_what_it_cannot_write(node, tmp_path):
    assert run(node, tmp_path, """
for (const [data, shape] of [[[1, 2], [2]], [new BigInt64Array(2), [2]], [new Float32Array(5), [2, 3]]])
  try { writeNpy(data, shape); console.log("written"); } catch (error) { console.log(error.message); }""") == [
        "expected a typed array of <f4, <f8, <i4, <u4, <i2, <u2, |i1, |u1, |b1, got Array",
        "expected a typed array of <f4, <f8, <i4, <u4, <i2, <u2, |i1, |u1, |b1, got BigInt64Array",
        "expected elements of shape [2,3], got 5"]
