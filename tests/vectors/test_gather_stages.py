"""Stages of `gather` in the kit: the production method at their end, the literal twin as a port, bugs.

The twin chooses its own samples and texels; here it is given the kit's. It has no depth on the map and no place on it
for points on a lamp's axis behind it: both are written out.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.rsm.buffers.light_projection import light_projection
from refgi.splat.gather import gather
from refgi.vectors.cases.gather import FULL, FULL_PLANS, QUICK, QUICK_PLANS, SQUARE, settings_of
from refgi.vectors.cases.scenes import room
from tests.naive import gather as twin
from tests.vectors.splat_ports import LARGEST_MASK, expect_within, made, masked_shares, stages_of

PLANS = QUICK_PLANS | FULL_PLANS
ALL = [*QUICK, *FULL]
STORED = 5e-6  # of the largest value: places in float32, whose rounding near texels magnify

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")


def arrays(id, *names):
    known = made(id)[1]
    return [known[name].astype(np.float64) if known[name].dtype.kind == "f" else known[name] for name in names]


def covered(id):
    return made(id)[1]["gbuffer.triangle_id"] >= 0


def lamps(id):
    return (SQUARE,) if id == "gather-border" else PLANS[id]().scene.lights


def view_of(id, index):
    """Return the map of a lamp whose planes are the stored ones."""
    scene, facts = room(SQUARE) if id == "gather-border" else PLANS[id]().scene, made(id)[0].facts[f"rsm{index}"]
    maps = light_projection(lamps(id)[index], scene.geometry, facts["columns"])
    origin, frame, half = arrays(id, *(f"rsm{index}.{key}" for key in ("origin", "frame", "half")))
    return maps._replace(origin=origin, frame=frame, half=half)


@pytest.mark.parametrize("id", PLANS)
def test_the_last_array_is_the_picture_of_the_method(id):
    plan = PLANS[id]()
    frame = Frame(plan.scene, width=plan.size[0], height=plan.size[1], dtype=np.float64, rsm_resolution=plan.maps)
    expected = gather(frame, settings_of(plan))
    case, known = made(id)
    got = known[case.stages[-1].writes[-1]]
    np.testing.assert_allclose(got, expected, rtol=0, atol=STORED * expected.max())
    assert (got.max() > 0) != (id == "gather-no-flux")


def pattern(id):
    facts = made(id)[0].facts["gather"]
    xi, turn = arrays(id, "gather.xi")[0].T
    if id != "gather-border":  # whose first samples are in the middle
        disc = settings_of(PLANS[id]()).disc
        down, right, weight = twin.disc_pattern(disc).T
        return {"gather.offset": np.stack([down, right], axis=1) / disc.radius, "gather.weight": 2 * np.pi * weight}
    assert not facts["weights_squared"]
    return {"gather.offset": np.stack([xi * np.cos(2 * np.pi * turn), xi * np.sin(2 * np.pi * turn)], axis=1),
            "gather.weight": 2 * np.pi * xi}


def center(id, index):
    maps, position, here = view_of(id, index), arrays(id, "gbuffer.position")[0], covered(id)
    places, depth = np.zeros((2, *here.shape)), np.full(here.shape, np.inf)
    for i, j in np.argwhere(here):
        x = position[:, i, j]
        local = [frame @ (x - origin) for frame, origin in zip(maps.frame, maps.origin, strict=True)]
        if maps.kind == twin.PERSPECTIVE and maps.maps == 1 and not local[0][:2].any():
            places[:, i, j] = maps.height / 2, maps.width / 2
        else:
            places[:, i, j] = twin.place(maps, x)
        right, down, ahead = max(local, key=lambda one: one[2])
        reach = ahead if maps.kind == twin.PERSPECTIVE else 1.0
        if ahead > 0 and abs(right) <= maps.half[0] * reach and abs(down) <= maps.half[1] * reach:
            depth[i, j] = ahead
    return {f"gather{index}.center": places, f"gather{index}.depth": depth}


def texels(id, index):
    maps, facts = view_of(id, index), made(id)[0].facts["gather"]
    places, offset = arrays(id, f"gather{index}.center", "gather.offset")
    row, column = (np.floor(places[k] + facts["radius"] * size * offset[:, k, None, None]).astype(int)
                   for k, size in enumerate((maps.height, maps.width)))
    inside = (row >= 0) & (row < maps.shape[0]) & (column >= 0) & (column < maps.shape[1]) & covered(id)
    return {f"gather{index}.texel": np.where(inside, row * maps.shape[1] + column, -1)}


def disc_sum(id, index):
    maps, facts = view_of(id, index), made(id)[0].facts["gather"]
    x, n, weight = arrays(id, "gbuffer.position", "gbuffer.normal", "gather.weight")
    p, normal, flux = (one.reshape(3, -1) for one in arrays(id, *(f"rsm{index}.{key}" for key in (
        "position", "normal", "flux"))))
    texel, light = made(id)[1][f"gather{index}.texel"], np.zeros_like(x)
    scale = facts["radius"] ** 2 * maps.height * maps.width / len(weight)
    for i, j in np.argwhere(covered(id)):
        used = (texel[:, i, j] >= 0) & (p[:, texel[:, i, j]] != x[:, i, j, None]).any(axis=0)
        at = texel[used, i, j]
        if len(at):
            terms = twin.pair(x[:, i, j], n[:, i, j], p[:, at] - facts["offset"] * normal[:, at], normal[:, at])
            light[:, i, j] = scale * (flux[:, at] * terms) @ weight[used]
    return {f"gather{index}.irradiance": light}


def total(id):
    return {"gather.sum": sum(arrays(id, *(f"gather{index}.irradiance" for index in range(len(lamps(id))))))}


def interpolated(id):
    settings, here, known = settings_of(PLANS[id]()).interpolation, covered(id), made(id)[1]
    position, normal, sums = arrays(id, "gbuffer.position", "gbuffer.normal", "gather.sum")
    frame = SimpleNamespace(gbuffer=SimpleNamespace(position=position, normal=normal, covered=here))
    rows, columns = (twin.middles(size, settings.grid) for size in here.shape)
    light, chosen = np.array(sums), np.zeros(here.shape, bool)
    for i, j in np.argwhere(here):
        mean = sums[:, i, j] if i in rows and j in columns else twin.interpolated(frame, settings, sums, rows, columns,
                                                                                 i, j)
        if mean is not None:
            light[:, i, j], chosen[i, j] = mean, True
    assert 0.1 < chosen.mean() < 0.9, known["gather.interpolated"].mean()
    return {"gather.irradiance": light, "gather.interpolated": chosen}


@pytest.mark.parametrize("id", ALL)
def test_the_literal_twin_as_a_port_is_within_bounds(id):
    port = {"center": center, "texels": texels, "sum": disc_sum}
    whole = {"gather.pattern": pattern, "gather.sum": total, "gather.interpolate": interpolated}
    for name in stages_of(id, "gather"):
        if name in whole:
            expect_within(id, name, whole[name](id))
        elif name != "gbuffer":
            map_name, key = name.split(".")
            expect_within(id, name, port[key](id, int(map_name.removeprefix("gather"))))


@pytest.mark.parametrize("id", ALL)
def test_rounding_decides_few_elements(id):
    assert max(masked_shares(id, "gather").values()) < LARGEST_MASK
