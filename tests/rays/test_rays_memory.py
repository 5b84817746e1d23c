"""Embree without memory: an error of Python's, never the end of the process and never a scene that lets rays pass."""

import subprocess
import sys
import textwrap
from types import SimpleNamespace

import pytest

from refgi.rays import embree

CHILD = textwrap.dedent("""\
    import resource
    import sys

    import numpy as np
    from refgi.rays import Tracer
    from refgi.scene import Geometry

    def grid(n):
        x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
        vertices = np.stack([x, y, 0.1 * np.sin(9 * x * y)], axis=-1).reshape(-1, 3)
        first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1)
        faces = np.concatenate([np.stack([first, first + 1, first + n + 2], axis=1),
                                np.stack([first, first + n + 2, first + n + 1], axis=1)])
        return Geometry(vertices, faces.astype(np.int32), np.zeros(2 * n * n, np.int32))

    down = np.array([[0.5, 0.5, 1.0]]), np.array([[0.0, 0.0, -1.0]])
    Tracer(grid(4)).closest(*down)  # everything is loaded
    tracer = Tracer(grid(500))
    used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + int(sys.argv[1]) * 2**20,) * 2)
    try:
        print("hit" if tracer.closest(*down).triangle_id[0] >= 0 else "missed")
    except MemoryError as error:
        print("MemoryError", error)
    """)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="RLIMIT_AS and /proc are Linux's")
@pytest.mark.parametrize("megabytes", [4, 20, 30, 40, 50])
def test_a_process_without_memory_ends_with_a_memory_error(megabytes):
    child = subprocess.run([sys.executable, "-c", CHILD, str(megabytes)], capture_output=True, text=True, timeout=300,
                           check=False)
    assert child.returncode == 0, child.stderr[-400:]  # not by a signal
    assert child.stdout.startswith("MemoryError") or child.stdout == "hit\n"
    if megabytes in (20, 30):
        assert "Embree's tree over 500,000 triangles does not fit" in child.stdout


class Failing:
    """Embree's functions, of which one fails: handles are numbers, failures are counted as Embree does."""

    def __init__(self, name, error, handle=1):
        self.name, self.error, self.handle, self.last, self.released = name, error, handle, 0, []

    def __getattr__(self, name):
        def call(*_):
            if name == "rtcGetDeviceError":
                error, self.last = self.last, 0
                return error
            if name.startswith("rtcRelease"):
                self.released.append(name)
            if name == self.name:
                self.last = self.error
                return self.handle
            return 1

        return call


CALLS = ["rtcNewDevice", "rtcNewScene", "rtcNewGeometry", "rtcSetSharedGeometryBuffer", "rtcSetGeometryUserData",
         "rtcSetGeometryIntersectFilterFunction", "rtcSetGeometryOccludedFilterFunction", "rtcCommitGeometry",
         "rtcAttachGeometry", "rtcCommitScene"]


def build(library):
    vertices, faces = embree._padded(embree.np.zeros((3, 3)), "f4"), embree._padded(embree.np.arange(3), "u4")
    cut = SimpleNamespace(record=1, function=2)
    return embree._build(library, vertices, 3, [embree._Mesh(faces, 1, cut)])


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize(("error", "kind"), [(4, MemoryError), (2, RuntimeError)])
def test_each_call_is_asked_for_its_error(name, error, kind):
    library = Failing(name, error)
    with pytest.raises(kind, match="over 1 triangles"):
        build(library)
    made = CALLS.index(name)
    assert ("rtcReleaseGeometry" in library.released) == (made > 2)
    assert ("rtcReleaseScene" in library.released) == (made > 1)
    assert "rtcReleaseDevice" in library.released


@pytest.mark.parametrize("name", CALLS[:3])
def test_a_handle_that_is_missing_is_memory_that_is_missing(name):
    with pytest.raises(MemoryError):
        build(Failing(name, 0, None))


def test_a_build_that_works_keeps_its_scene():
    library = Failing("", 0)
    assert build(library) == (1, 1)
    assert library.released == ["rtcReleaseGeometry"]
