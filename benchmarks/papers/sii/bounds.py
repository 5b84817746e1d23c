"""Where a pixel light is significant, and the ellipses that bound it (appendix, Figures 9 and 10)."""

import numpy as np

from benchmarks.papers.records import Figure, Plot, Table
from benchmarks.papers.workbench import Workbench
from refgi.compare.plot import Axes, Curve, curves_plot
from refgi.splat.sii.bounds import appendix_ellipsoid

ANGLES = np.linspace(0.0, np.pi / 2, 721)


def isosurfaces(_: Workbench, exponents: tuple[int, ...], *, bounded: bool) -> Figure:
    """Draw r = cos^(n/2) of Figure 9 as x along the light's axis and F(x) across it, in R_0; Figure 10: with ellipses.

    The volume of r^2 <= cos^n turned about the axis is 4 pi / (3 (3 n + 2)); an ellipsoid's is 4 pi w h^2 / 3.
    """
    curves, rows = [], []
    for n in exponents:
        r = np.cos(ANGLES) ** (n / 2)
        x, across = r * np.cos(ANGLES), r * np.sin(ANGLES)
        center, half_width, height = (float(part) for part in appendix_ellipsoid(float(n)))
        beyond = float(np.max((across / height) ** 2 + ((x - center) / half_width) ** 2)) - 1
        curves.append(Curve(f"n = {n}", x.tolist(), across.tolist()))
        if bounded:
            turn = 2 * ANGLES
            curves.append(Curve(f"ellipse, n = {n}", (center + half_width * np.cos(turn)).tolist(),
                                (height * np.sin(turn)).tolist(), dashed=True))
        rows.append((f"n = {n}", float(across.max()), center, half_width, height, beyond,
                     half_width * height**2 * (3 * n + 2)))
    closest = max(row[5] for row in rows)
    return Figure(
        facts=("I_0 = 1, I_low = 1", "lengths in R_0, the range along the axis"),
        tables=[Table("Ellipses of Eq. 7 and 8: centre, half axes, the region's farthest point outside (square of its "
                      "distance in half axes, less 1) and their volume over the region's",
                      ("", "region's height", "centre c", "half width", "height", "outside by", "volume"), rows)],
        plots=[Plot(curves_plot(curves, Axes("x, along the light's axis", "F(x), across it")),
                    "The upper half of sections along the axis.")],
        notes=("As high as the region where it is highest and wide enough for [0, 1], no ellipse leaves any of it out: "
               f"the farthest point lies {closest:.1g} of a squared half axis outside, rounding. They hold "
               + ", ".join(f"{row[6]:.2f}" for row in rows) + " times the region's volume; the paper gives no figure.",
               "Eq. 8 is read with its exponent (n + 2) / 4, which print shows as a factor."))
