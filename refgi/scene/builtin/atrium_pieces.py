"""Pieces of the atrium: one bay of its arcades, and what is soft or small.

Local frame: x along the wall (from the bay's middle), y up, z towards the courtyard. A bay has a wall above the arch,
its underside and the moulding around it. Soft or small are curtains, swags, shrubs and floor tiles.
"""

import numpy as np

from refgi.scene.model import Array

BAY = 3.0  # m from column to column
ARCH_RADIUS = 1.2  # m
WALL_THICKNESS = 0.5  # m


def arch_front(springing: float, top: float, rows: int, columns: int) -> Array:
    """Return the courtyard side of one bay's wall over its arch, from the arch up to `top`.

    `springing`, `top`: heights where the arch begins and the wall ends, m. Returns (rows + 1, columns + 1, 3): in the
    plane z = half the wall's thickness.
    """
    lower = arch_line(springing, columns)
    up = np.linspace(0.0, 1.0, rows + 1)[:, None]
    x = np.broadcast_to(lower[:, 0], (rows + 1, columns + 1))
    y = lower[:, 1] + up * (top - lower[:, 1])
    return np.stack([x, y, np.full_like(y, WALL_THICKNESS / 2)], axis=-1)[::-1]


def arch_back(springing: float, top: float, rows: int, columns: int) -> Array:
    """Return the gallery side of one bay's wall, with its normal away from the courtyard.

    `springing`, `top`: heights where the arch begins and the wall ends, m. Returns (rows + 1, columns + 1, 3): in the
    plane z = minus half the wall's thickness.
    """
    return arch_front(springing, top, rows, columns)[::-1] * (1.0, 1.0, -1.0)


def arch_under(springing: float, rows: int, columns: int) -> Array:
    """Return the underside of one bay's arch.

    `springing`: height where the arch begins, m. `rows`, `columns`: cells across the wall's thickness and along the
    arch. Returns (rows + 1, columns + 1, 3): normals down and inward.
    """
    lower = arch_line(springing, columns)
    depth = np.linspace(-0.5, 0.5, rows + 1)[:, None] * WALL_THICKNESS
    shape = (rows + 1, columns + 1)
    return np.stack([np.broadcast_to(lower[:, 0], shape), np.broadcast_to(lower[:, 1], shape),
                     np.broadcast_to(depth, shape)], axis=-1)[::-1]


def archivolt(springing: float, rows: int, columns: int) -> Array:
    """Return the moulding around an arch, a half-round band on the courtyard side.

    `springing`: height where the arch begins, m. `rows`, `columns`: cells across and along. Returns (rows + 1, columns
    + 1, 3): standing 9 cm proud of the wall.
    """
    around = np.pi * np.linspace(0.0, 1.0, rows + 1)[:, None]
    along = np.pi * np.linspace(0.0, 1.0, columns + 1)
    radius = ARCH_RADIUS + 0.12 - 0.11 * np.cos(around)
    z = WALL_THICKNESS / 2 + 0.09 * np.sin(around)
    return np.stack([-radius * np.cos(along), springing + radius * np.sin(along),
                     np.broadcast_to(z, (rows + 1, columns + 1))], axis=-1)[::-1]


def arch_line(springing: float, columns: int) -> Array:
    """Return the lower edge of one bay's wall: from a column's middle over the arch to the next column's.

    `springing`: height where the arch begins, m. `columns`: cells, at least 3. Returns (columns + 1, 2): x and y, m.
    """
    turn = np.pi * np.linspace(0.0, 1.0, columns - 1)
    x = np.concatenate([[-BAY / 2], -ARCH_RADIUS * np.cos(turn), [BAY / 2]])
    y = np.concatenate([[0.0], ARCH_RADIUS * np.sin(turn), [0.0]])
    return np.stack([x, springing + y], axis=1)


def curtain(folds: int, gathered: float, phase: float, rows: int, columns: int) -> Array:
    """Return a curtain in one bay, hanging in folds from a rod, drawn together at hip height.

    `gathered`: 0 hangs straight, 1 is drawn wholly to its left side at hip height. `phase`: where the folds begin, rad.
    Returns (rows + 1, columns + 1, 3): 2.5 m wide at the rod, 3 m high.
    """
    down = np.linspace(0.0, 1.0, rows + 1)[:, None]
    across = np.linspace(0.0, 1.0, columns + 1)[None, :]
    pinch = gathered * np.exp(-(((down - 0.62) / 0.3) ** 2)) * 0.8
    x = -1.25 + 2.5 * across * (1.0 - pinch)
    turn = 2 * np.pi * folds * (across + 0.012 * np.sin(5.0 * across + 2.0 * down + phase)) + phase
    depth = (0.05 + 0.05 * down) * np.sin(turn) + 0.02 * np.sin(2.7 * turn + 3.0 * down)
    y = 3.02 - 2.97 * down - 0.02 * np.cos(turn) * down + 0.03 * np.cos(2 * turn) * (1 - down) ** 8
    return np.stack(np.broadcast_arrays(x, y, depth * (1.0 + 0.6 * pinch)), axis=-1)


def swag(sag: float, rows: int, columns: int) -> Array:
    """Return a cloth hung between two columns of the upper storey, sagging in the middle.

    `sag`: how far the lower edge hangs below the upper one, m. Returns (rows + 1, columns + 1, 3): upper corners at y =
    0, 2.5 m apart.
    """
    down = np.linspace(0.0, 1.0, rows + 1)[:, None]
    across = np.linspace(-1.0, 1.0, columns + 1)[None, :]
    hang = 1.0 - across**2
    y = -0.35 * np.abs(across) * down - hang * (0.45 + sag * down)
    folds = np.sin(9.0 * down * np.pi + 1.5 * across) * 0.045 * hang
    z = 0.16 + 0.3 * hang * np.sin(np.pi * (0.15 + 0.75 * down)) + folds
    return np.stack(np.broadcast_arrays(1.25 * across, y, z), axis=-1)


def shrub(radius: float, rows: int, columns: int) -> Array:
    """Return a clipped round shrub, a sphere with bumps.

    `radius`: its mean radius, m. Returns (rows + 1, columns, 3): around the origin, closed around; the poles are a
    hand's breadth wide.
    """
    polar = np.linspace(0.06, np.pi - 0.06, rows + 1)[:, None]
    turn = 2 * np.pi * np.arange(columns)[None, :] / columns
    bumps = np.sin(7 * polar) * np.sin(6 * turn) + 0.6 * np.sin(13 * polar + 2) * np.cos(11 * turn)
    reach = radius * (1.0 + 0.05 * bumps)
    return np.stack(np.broadcast_arrays(reach * np.sin(polar) * np.cos(turn), reach * np.cos(polar),
                                        -reach * np.sin(polar) * np.sin(turn)), axis=-1)


def tile(size: float, rows: int, columns: int) -> Array:
    """Return one floor tile: flat, its edges worn down into the joint.

    `size`: length of its sides, m. Returns (rows + 1, columns + 1, 3): normals up; corners 15 mm below the middle.
    """
    u = np.linspace(-1.0, 1.0, rows + 1)[:, None]
    v = np.linspace(-1.0, 1.0, columns + 1)[None, :]
    worn = 1.0 - (1.0 - u**12) * (1.0 - v**12)
    return np.stack(np.broadcast_arrays(v * size / 2, -0.015 * worn, -u * size / 2), axis=-1)[::-1]
