"""The part `rays`: its meshes are closed, its rays lie inside, and faults of a tracer show."""

import numpy as np
import pytest

from benchmarks.stability import again, rays
from benchmarks.stability.meshes import MESHES, WITHIN, aimed_rays, places_upon, random_rays
from refgi.rays import watertight

pytestmark = pytest.mark.slow  # tests/benchmarks/test_smoke.py runs a task of each part

COUNT = 2000


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("size", [1e-6, 1e8])
def test_meshes_are_closed_hold_the_ball_and_face_outwards(name, size):
    mesh = MESHES[name](size)
    edges = np.concatenate([mesh.geometry.faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    assert len(np.unique(edges, axis=0)) == len(edges)
    np.testing.assert_array_equal(np.unique(edges, axis=0), np.unique(edges[:, ::-1], axis=0))
    normal = np.cross(mesh.corners[:, 1] - mesh.corners[:, 0], mesh.corners[:, 2] - mesh.corners[:, 0])
    height = (normal * mesh.corners[:, 0]).sum(axis=1) / np.linalg.norm(normal, axis=1)
    assert height.min() > 0  # seen whole from the origin
    if mesh.convex:
        assert height.min() > 1.001 * WITHIN * size
    else:  # the ball lies within the star: its base does
        assert np.linalg.norm(mesh.corners, axis=2).min() > 1.5 * WITHIN * size


@pytest.mark.parametrize("name", MESHES)
def test_rays_start_inside_and_are_aimed(name):
    mesh, rng = MESHES[name](1.0), np.random.default_rng(1)
    for drawn in (random_rays(mesh, 1.0, rng, COUNT), aimed_rays(mesh, 1.0, rng, COUNT)):
        assert np.linalg.norm(drawn.origins, axis=1).max() <= WITHIN * (1 + 1e-6)
        for k in range(0, COUNT, 200):
            assert rays.brute(mesh, drawn.origins[k].astype(float), drawn.directions[k].astype(float))[1] >= 0 or (
                drawn.own[k] == -1)
    at = places_upon(mesh, rng, COUNT)
    corner = mesh.corners[at.face]
    assert np.abs(((at.points - corner[:, 0]) * at.normals).sum(axis=1)).max() < 1e-9


def test_brute_force_finds_the_nearest_face():
    mesh = MESHES["sphere"](1.0)
    middle = mesh.corners[7].mean(axis=0)
    assert rays.brute(mesh, np.zeros(3), middle) == (pytest.approx(1.0), 7)
    assert rays.brute(mesh, 3 * middle, middle)[1] == -1


@pytest.mark.parametrize("way", rays.DOORS)
def test_short_rows_hold(way):
    found = [row for kind in rays.KINDS for row in rays.rows("sphere", way, kind, COUNT)]
    assert len(found) == 8
    assert all(row.passed for row in found)
    assert {row.cases for row in found} == {COUNT}
    assert next(row for row in found if row.property == "slips of the bare path, aimed").figure > 0


def test_the_doors_open_different_ways(monkeypatch):
    monkeypatch.setenv("REFGI_EMBREE", "address")
    rays.tracer_of.cache_clear()
    kinds = {type(rays.tracer_of("star", 1.0, way)[1]._backend).__name__ for way in rays.DOORS}
    assert kinds == {"AddressBackend", "RunBackend"}


def without_retracing(monkeypatch):
    monkeypatch.setattr("refgi.rays.tracer.Tracer._slipped", lambda *_: [])


def with_a_short_shift(monkeypatch):
    monkeypatch.setattr("refgi.rays.tracer.RELATIVE_SHIFT", 1e-9)


@pytest.mark.parametrize("fault", [without_retracing, with_a_short_shift])
def test_a_tracer_that_does_not_look_again_shows(fault, monkeypatch):
    fault(monkeypatch)
    assert rays.measure("sphere", "address", "aimed", 5 * COUNT).checked > 0


@pytest.mark.parametrize("factor", [0.0, 1e-2])
def test_offsets_that_are_too_small_show(factor, monkeypatch):
    from refgi.rays import Tracer

    plain = Tracer.offsets
    monkeypatch.setattr(Tracer, "offsets", lambda self, points: factor * plain(self, points))
    assert rays.measure("sphere", "address", "leaving", 5 * COUNT).bare > 0
    assert rays.measure("sphere", "address", "between", 5 * COUNT).checked > 0


def test_a_wrong_distance_shows(monkeypatch):
    def off(*arguments):
        face, distance = plain(*arguments)
        return face, 1.001 * distance

    plain = watertight.closest_around
    monkeypatch.setattr("refgi.rays.tracer.closest_around", off)
    found = {row.property: row for row in rays.rows("sphere", "address", "aimed", 5 * COUNT)}
    assert not found["distance of what is aimed at"].passed


def test_bare_slips_are_rare_and_counted(monkeypatch):
    def leaky(tracer, drawn):
        face, blocked = plain(tracer, drawn)
        face[::100] = -1
        return face, blocked

    plain = rays.bare
    monkeypatch.setattr(rays, "bare", leaky)
    found = {row.property: row for row in rays.rows("sphere", "address", "random", COUNT)}
    row = found["slips of the bare path, random"]
    assert row.figure == pytest.approx(0.01)
    assert not row.passed
    assert found["slips of the checked path, random"].passed


def test_a_ray_comes_again(capsys):
    assert again.main(["rays", "star.address.aimed", "17", "40"]) == 0
    lines = capsys.readouterr().out.splitlines()
    nearest = [line.split()[2].rstrip(",") for line in lines if line.split()[0] in ("checked", "float64")]
    assert nearest[0] == nearest[1]
    assert again.main(["rays", "star.window.aimed", "17", "40"]) == 2
    assert "sphere" in capsys.readouterr().err
    assert again.main(["rays", "needles.run.between", "17", "3"]) == 0
    assert "blocked   False" in capsys.readouterr().out


def test_chunks_do_not_depend_on_how_many_are_asked():
    _, _, whole = rays.chunk_of("sphere", "address", "aimed", 17, 3)
    _, _, some = rays.chunk_of("sphere", "address", "aimed", 17, 3, 5, 9)
    np.testing.assert_array_equal(whole.directions[5:9], some.directions)


def test_each_mesh_and_door_has_its_tasks():
    names = [task.name for task in rays.tasks(short=False)]
    assert len(names) == len(set(names)) == 22 + len(rays.promises())
    counted = rays.COUNTS["random", "address"][0]
    assert 2 * counted + counted // rays.SLOWER["random"] > 100_000_000
