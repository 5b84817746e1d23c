"""How far the filters are from the mean over the disc: on a straight edge, and on maps of real scenes (VAL-16)."""

import numpy as np
import pytest

from refgi.literal.val_maps import map_depths
from refgi.literal.val_series import shade, weights
from refgi.rsm.raster.paraboloid import paraboloid_depth_maps
from refgi.scene import load_scene
from tests.cluster.filters import reads

ROUNDED = 1e-12  # sums of 64^2 texels
EDGE = 1 / 16  # of a mip map: an edge where texels of the level meet is off by this part of its height at most
BIAS = 0.0763  # b* of four terms
TERMS = 4


@pytest.mark.feature("VAL-16")
def test_mip_has_steps_where_boxes_and_discs_have_none(evidence):
    """A disc whose middle lies on a straight edge sees half of either side, wherever the edge lies."""
    n, worst = 64, {}
    for edge in range(16, 48):
        depth = np.full((n, n), 1.0)
        depth[:, edge:] = 3.0
        radii = np.array([0.1, 0.25, 0.5])
        discs = np.full(3, 2 * edge / n - 1), np.zeros(3), radii
        for kind, options in (("mip", {}), ("mip", {"shift": -1.0}), ("sat", {}), ("brute", {})):
            found = reads.means(getattr(reads, kind)(depth, 1, **options), discs, 1)[4] / (reads.MOST / 4)
            name = kind + str(options.get("shift", ""))
            worst[name] = max(worst.get(name, 0.0), float(np.abs(found - 2).max()) / 2)
    assert worst["sat"] < ROUNDED
    assert worst["brute"] < ROUNDED
    for name in ("mip", "mip-1.0"):
        assert 0.5 * EDGE < worst[name] <= EDGE + ROUNDED
    evidence(f"disc on a straight edge, off by: mip {worst['mip']:.4f} of the edge, box {worst['sat']:.0e}, "
             f"disc {worst['brute']:.0e}")


def seen(means, d):
    """V of each disc, cut to [0, 1]."""
    means = means[None, : 2 * TERMS, None].astype(float)
    return np.clip(0.5 + shade(means, d[None, None], 0, weights(TERMS, 0.0))[0, 0], 0, 1)


def maps_of(geometry, count, rng):
    """Depth maps from points of the surface, and the depth of the series per metre."""
    corners = geometry.vertices[geometry.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    face = rng.choice(len(area), count, p=area / area.sum())
    center, normal = corners[face].mean(axis=1), cross[face] / area[face, None]
    depth = paraboloid_depth_maps(geometry, center + 1e-4 * normal, normal, 256, np.float32)
    return depth, (1 - 2 * BIAS) / geometry.diagonal


def receivers(t, count, rng):
    """Discs within the hemisphere, and depths of receivers: half of them on the nearest surface, half behind it."""
    rho, angle = np.sqrt(rng.uniform(0, 0.98, count)), rng.uniform(0, 2 * np.pi, count)
    s, v = (rho * np.cos(angle)).astype(np.float32), (rho * np.sin(angle)).astype(np.float32)
    radius = np.exp(rng.uniform(np.log(0.01), np.log(0.4), count)).astype(np.float32)
    d = t[((v + 1) * 128).astype(int), ((s + 1) * 128).astype(int)].astype(float)
    behind = rng.uniform(size=count) * (rng.uniform(size=count) < 0.5)
    return (s, v, radius), d + behind * (1 - 2 * BIAS - d) - BIAS


KINDS = {"mip": ("mip", {}), "mip, level - 1": ("mip", {"shift": -1.0}), "sat": ("sat", {}),
         "mip, level - 1, mirrored": ("mip", {"shift": -1.0, "mirrored": True}),
         "sat, mirrored": ("sat", {"mirrored": True})}


@pytest.mark.feature("VAL-16")
@pytest.mark.parametrize("name", ["cornell_horse", "kitchen"])
def test_error_against_the_disc_on_real_maps(name, data_dir, evidence):
    rng = np.random.default_rng(7)
    depth, per_metre = maps_of(load_scene(data_dir / f"{name}.json").geometry, 6, rng)
    squares = {kind: [] for kind in KINDS}
    for one in depth[np.isfinite(depth).any(axis=(1, 2))]:
        disc = reads.brute(one, TERMS, per_metre)
        discs, d = receivers(disc.depth, 1500, rng)
        truth = seen(reads.means(disc, discs, TERMS), d)
        for kind, (filters, options) in KINDS.items():
            found = seen(reads.means(getattr(reads, filters)(one, TERMS, per_metre, **options), discs, TERMS), d)
            squares[kind].append(np.mean((found - truth) ** 2))
    rms = {kind: float(np.sqrt(np.mean(values))) for kind, values in squares.items()}
    assert rms["sat"] < rms["mip"]
    assert rms["mip, level - 1"] < 0.75 * rms["mip"]  # a read between texels is twice as wide as they are
    assert rms["mip, level - 1, mirrored"] < 0.7 * rms["mip, level - 1"]  # the rest leaks in over the rim
    assert rms["sat, mirrored"] < 0.7 * rms["sat"]
    evidence(f"{name}: RMSE of V against the disc: " + ", ".join(f"{kind} {value:.4f}" for kind, value in rms.items()))


@pytest.mark.feature("VAL-16")
@pytest.mark.parametrize("n", [1, 4, 7, 16, 33])
def test_the_square_beyond_the_disc_mirrors_it(n):
    depth = reads.random_map(n, np.float64)
    scale = np.zeros(1), np.array([reads.MOST / 4]), np.array([reads.MOST])
    expected, plain = (map_depths(depth[None], *scale, False, mirrored)[0] for mirrored in (True, False))
    for kind in ("mip", "sat", "brute"):
        assert np.abs(getattr(reads, kind)(depth, 1, mirrored=True).depth - expected).max() < ROUNDED
    squares = ((np.arange(n) + 0.5) * 2 / n - 1) ** 2
    assert ((expected == plain) | (np.add.outer(squares, squares) > 1)).all()
