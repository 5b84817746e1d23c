"""Rays from receivers to points on lights, many for each receiver, and what share of them arrives."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from refgi.rays import Tracer

Array = npt.NDArray[Any]

RAYS_AT_ONCE = 1 << 18
SHORTEST = 1e-6  # of a ray: a reach of 0 would count as blocked


class Ball(NamedTuple):
    """Where nothing blocks."""

    center: Array  # (3,) m
    radius: float  # m


def free_share(
    tracer: "Tracer", points: Array, facing: Array, targets: Array, upward: Array,
    worth: Callable[[Array, Array], Array] | None, grain: float, ball: Ball | None = None,
) -> Array:
    """Return the share of each receiver's rays that arrives, each ray after its worth.

    Parameters
    ----------
    tracer : Tracer
        What blocks.
    points, facing : (3, n) ndarray
        Receivers (m) and the unit normals of their surfaces, off which rays start.
    targets : (3, k) ndarray
        Points on lights, m.
    upward : (3, k) or (3, 1) ndarray
        Unit normals at the targets, on the side that rays come from.
    worth : callable or None
        Given vectors (n, k, 3) from some receivers to the targets and their normals (n, 3), the weight (n, k) of each
        ray, 0 or more; None: all the same. Rays of no worth, and those to targets below a receiver's surface, are
        not traced.
    grain : float
        The scene tracer's: how far above their surfaces rays start and end, as `ray_offset` has it, m.
    ball : Ball, optional
        Rays end where they enter it.

    Returns
    -------
    (n,) ndarray
        In the dtype of the points, 0 to 1; 1 where no ray is of any worth.
    """
    from refgi.rays import STEPS

    visible = np.ones(points.shape[1], points.dtype)
    step = max(1, RAYS_AT_ONCE // max(1, targets.shape[1]))
    for first in range(0, len(visible), step):
        part = slice(first, first + step)
        at, up = points[:, part].T.astype(np.float64), facing[:, part].T.astype(np.float64)
        toward = targets.T[None] - at[:, None]
        above = np.einsum("nkc,nc->nk", toward, up) > 0
        weight = np.where(above, 1.0 if worth is None else worth(toward, up), 0.0)
        reach = np.where(weight > 0, _way_to(ball, at, toward), 0.0)
        starts = at + STEPS * (np.abs(at).sum(axis=1, keepdims=True) + grain) * up
        lift = STEPS * (np.abs(targets).sum(axis=0) + grain + np.abs(toward).sum(axis=2))
        arrives = ~_blocked(tracer, starts, targets.T + lift[..., None] * upward.T, reach)
        whole = weight.sum(axis=1)
        share = np.divide((weight * arrives).sum(axis=1), whole, out=np.ones_like(whole), where=whole > 0)
        visible[part] = np.minimum(share, 1.0)
    return visible


def _blocked(tracer: "Tracer", origins: Array, ends: Array, reach: Array) -> Array:
    """Return which of the rays from each origin (n, 3) to its ends (n, k, 3) are blocked, (n, k) bool."""
    shape = (*reach.shape, 3)
    starts = np.broadcast_to(origins[:, None], shape)
    directions = (ends - starts).astype(np.float32).reshape(-1, 3)
    blocked = np.zeros(reach.size, np.bool_)
    tracer.fill_occluded(np.ascontiguousarray(starts, np.float32).reshape(-1, 3), directions,
                         reach.reshape(-1).astype(np.float32), blocked)
    return blocked.reshape(reach.shape)


def _way_to(ball: Ball | None, at: Array, toward: Array) -> Any:
    """Return the share of each way `toward` (n, k, 3) that lies before the ball, (n, k); 1 where it misses it."""
    if ball is None or ball.radius == 0:
        return 1.0
    start = at - ball.center
    square, half = np.einsum("nkc,nkc->nk", toward, toward), np.einsum("nkc,nc->nk", toward, start)
    root = half**2 - square * (np.einsum("nc,nc->n", start, start) - ball.radius**2)[:, None]
    share = np.divide(-half - np.sqrt(np.maximum(root, 0)), square, out=np.ones_like(square), where=square > 0)
    return np.where(root > 0, np.clip(share, SHORTEST, 1.0), 1.0)
