"""What is soft or small in the atrium: curtains, swags, shrubs, floor tiles.

Local frame: x along the wall, y up, z towards the courtyard.
"""

import numpy as np

from refgi.scene.model import Array


def curtain(folds: int, gathered: float, phase: float, rows: int, columns: int) -> Array:
    """Return a curtain in one bay, hanging in folds from a rod, drawn together at hip height.

    Parameters
    ----------
    folds : int
        Number of folds.
    gathered : float
        0 hangs straight, 1 is drawn wholly to its left side at hip height.
    phase : float
        Where the folds begin, rad.
    rows, columns : int
        Cells.

    Returns
    -------
    (rows + 1, columns + 1, 3) ndarray
        2.5 m wide at the rod, 3 m high.
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

    Parameters
    ----------
    sag : float
        How far the lower edge hangs below the upper one, m.
    rows, columns : int
        Cells.

    Returns
    -------
    (rows + 1, columns + 1, 3) ndarray
        Upper corners at y = 0, 2.5 m apart.
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

    Parameters
    ----------
    radius : float
        Its mean radius, m.
    rows, columns : int
        Cells.

    Returns
    -------
    (rows + 1, columns, 3) ndarray
        Around the origin, closed around; the poles are a hand's breadth wide.
    """
    polar = np.linspace(0.06, np.pi - 0.06, rows + 1)[:, None]
    turn = 2 * np.pi * np.arange(columns)[None, :] / columns
    bumps = np.sin(7 * polar) * np.sin(6 * turn) + 0.6 * np.sin(13 * polar + 2) * np.cos(11 * turn)
    reach = radius * (1.0 + 0.05 * bumps)
    return np.stack(np.broadcast_arrays(reach * np.sin(polar) * np.cos(turn), reach * np.cos(polar),
                                        -reach * np.sin(polar) * np.sin(turn)), axis=-1)


def tile(size: float, rows: int, columns: int) -> Array:
    """Return one floor tile: flat, its edges worn down into the joint.

    Parameters
    ----------
    size : float
        Length of its sides, m.
    rows, columns : int
        Cells.

    Returns
    -------
    (rows + 1, columns + 1, 3) ndarray
        Normals up; corners 15 mm below the middle.
    """
    u = np.linspace(-1.0, 1.0, rows + 1)[:, None]
    v = np.linspace(-1.0, 1.0, columns + 1)[None, :]
    worn = 1.0 - (1.0 - u**12) * (1.0 - v**12)
    return np.stack(np.broadcast_arrays(v * size / 2, -0.015 * worn, -u * size / 2), axis=-1)[::-1]
