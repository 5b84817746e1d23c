"""One bay of the atrium's arcades: wall above the arch, its underside, and the moulding around it.

Local frame: x along the wall from the bay's middle, y up, z towards the courtyard.
"""

import numpy as np

from refgi.scene.model import Array

BAY = 3.0  # m from column to column
ARCH_RADIUS = 1.2  # m
WALL_THICKNESS = 0.5  # m


def arch_front(springing: float, top: float, rows: int, columns: int) -> Array:
    """Return the courtyard side of one bay's wall over its arch, from the arch up to `top`.

    Parameters
    ----------
    springing, top : float
        Heights where the arch begins and the wall ends, m.
    rows, columns : int
        Cells.

    Returns
    -------
    (rows + 1, columns + 1, 3) ndarray
        In the plane z = half the wall's thickness.
    """
    lower = arch_line(springing, columns)
    up = np.linspace(0.0, 1.0, rows + 1)[:, None]
    x = np.broadcast_to(lower[:, 0], (rows + 1, columns + 1))
    y = lower[:, 1] + up * (top - lower[:, 1])
    return np.stack([x, y, np.full_like(y, WALL_THICKNESS / 2)], axis=-1)[::-1]


def arch_back(springing: float, top: float, rows: int, columns: int) -> Array:
    """Return the gallery side of one bay's wall, with its normal away from the courtyard.

    Parameters
    ----------
    springing, top : float
        Heights where the arch begins and the wall ends, m.
    rows, columns : int
        Cells.

    Returns
    -------
    (rows + 1, columns + 1, 3) ndarray
        In the plane z = minus half the wall's thickness.
    """
    return arch_front(springing, top, rows, columns)[::-1] * (1.0, 1.0, -1.0)


def arch_under(springing: float, rows: int, columns: int) -> Array:
    """Return the underside of one bay's arch.

    Parameters
    ----------
    springing : float
        Height where the arch begins, m.
    rows, columns : int
        Cells across the wall's thickness and along the arch.

    Returns
    -------
    (rows + 1, columns + 1, 3) ndarray
        Normals down and inward.
    """
    lower = arch_line(springing, columns)
    depth = np.linspace(-0.5, 0.5, rows + 1)[:, None] * WALL_THICKNESS
    shape = (rows + 1, columns + 1)
    return np.stack([np.broadcast_to(lower[:, 0], shape), np.broadcast_to(lower[:, 1], shape),
                     np.broadcast_to(depth, shape)], axis=-1)[::-1]


def archivolt(springing: float, rows: int, columns: int) -> Array:
    """Return the moulding around an arch, a half-round band on the courtyard side.

    Parameters
    ----------
    springing : float
        Height where the arch begins, m.
    rows, columns : int
        Cells across and along.

    Returns
    -------
    (rows + 1, columns + 1, 3) ndarray
        Standing 9 cm proud of the wall.
    """
    around = np.pi * np.linspace(0.0, 1.0, rows + 1)[:, None]
    along = np.pi * np.linspace(0.0, 1.0, columns + 1)
    radius = ARCH_RADIUS + 0.12 - 0.11 * np.cos(around)
    z = WALL_THICKNESS / 2 + 0.09 * np.sin(around)
    return np.stack([-radius * np.cos(along), springing + radius * np.sin(along),
                     np.broadcast_to(z, (rows + 1, columns + 1))], axis=-1)[::-1]


def arch_line(springing: float, columns: int) -> Array:
    """Return the lower edge of one bay's wall: from a column's middle over the arch to the next column's.

    Parameters
    ----------
    springing : float
        Height where the arch begins, m.
    columns : int
        Cells, at least 3.

    Returns
    -------
    (columns + 1, 2) ndarray
        x and y, m.
    """
    turn = np.pi * np.linspace(0.0, 1.0, columns - 1)
    x = np.concatenate([[-BAY / 2], -ARCH_RADIUS * np.cos(turn), [BAY / 2]])
    y = np.concatenate([[0.0], ARCH_RADIUS * np.sin(turn), [0.0]])
    return np.stack([x, springing + y], axis=1)
