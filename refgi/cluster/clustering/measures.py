"""What a clustering is worth: how much normals differ in a cluster (Fig. 6), how many clusters are in use (Fig. 8)."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.clustering.kmeans import Clusters

Array = npt.NDArray[Any]


def mean_angle(normal: Array, clusters: Clusters) -> float:
    """Return the mean over lights of the angle between a light's normal and its cluster's.

    Parameters
    ----------
    normal : (3, N) ndarray
        Unit normals of the lights.
    clusters : Clusters
        Their clusters.

    Returns
    -------
    float
        Radians; 0 without lights.
    """
    if normal.shape[1] == 0:
        return 0.0
    ours, own = np.asarray(normal, np.float64), clusters.normal[:, clusters.of]
    across, along = np.linalg.norm(np.cross(ours, own, axis=0), axis=0), (ours * own).sum(axis=0)
    return float(np.arctan2(across, along).mean())


def in_use(clusters: Clusters) -> int:
    """Return how many clusters have lights.

    Parameters
    ----------
    clusters : Clusters
        The clusters.

    Returns
    -------
    int
        0 to M.
    """
    return int(np.count_nonzero(clusters.members))
