"""Slow literal twin of how a count of lights is shared out among lamps by their flux."""

from fractions import Fraction

import numpy as np

from tests.naive.draws import draw


def shares_of(count, flux):
    """Return whole numbers that sum to the count, none for a dark lamp and at least one for any other.

    A lamp whose part would be less than one light gets that one before the others share the rest. Parts are rounded
    down, and what is left over goes to the largest remainders; of equal ones to the first lamp.
    """
    exact = [Fraction(np.float32(one).item()) for one in flux]  # so coarse that equal lamps are equal
    poor = set()
    while True:
        rich = [k for k, one in enumerate(exact) if one > 0 and k not in poor]
        left = count - len(poor)
        parts = {k: left * exact[k] / sum(exact[other] for other in rich) for k in rich}
        below = {k for k, part in parts.items() if part < 1}
        if not below:
            break
        poor |= below
    whole = {k: int(part) for k, part in parts.items()}
    for k in sorted(rich, key=lambda k: (whole[k] - parts[k], k))[: left - sum(whole.values())]:
        whole[k] += 1
    return [1 if k in poor else whole.get(k, 0) for k in range(len(exact))]


def nearest_grid(share, faces):
    """Return the k n^2 nearest to a share, n x n cells on each of k faces; of two the smaller; 0 for none."""
    if share == 0:
        return 0
    return min((faces * n * n for n in range(1, share + 2)), key=lambda cells: (abs(cells - share), cells))


def trial_flux(walked):
    """Return the flux that vertices of paths reflect, all channels, diffuse and lobe."""
    return sum(float(np.sum(diffuse) + np.sum(glossy)) for _, _, diffuse, glossy, _, _ in walked)


def shift_of(seed, use, count, part):
    """Return the numbers of a part of a use of the random streams."""
    return [draw(seed, use + 256 * part, c) for c in range(count)]
