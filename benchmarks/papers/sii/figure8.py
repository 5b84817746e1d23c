"""Figure 8 and Section 6: how many of 768 splats count at each pixel, and the memory traffic that makes."""

from typing import TYPE_CHECKING

from benchmarks.papers import pictures
from benchmarks.papers.records import Cell, Figure, Table
from benchmarks.papers.sii.subjects import BOX, counted, full_sum, reference_length, splats
from refgi.compare.maps import Scale
from refgi.splat import sii
from refgi.splat.reach.fragments import FRAGMENT_BITS, SAMPLE_BITS, Fragments, gather_bits
from refgi.splat.reach.reference_length import PAPER_LIGHTS, PAPER_OVERDRAW

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

PAPER_PIXELS = 512 * 512
SAMPLES = 308  # of the gathering that Section 6 is about
MEGABYTE = 8 * 2**20  # bits
GREYS = Scale(0.0, 256.0, "gray", "splats")
BOUNDS = {"full": "none", "quad": "screen quad", "ellipsoid": "ellipsoid of the appendix",
          "tangent": "tangent-family ellipsoid"}


def figure8(bench: "Workbench") -> Figure:
    """Make Figure 8 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and frames.

    Returns
    -------
    Figure
        The overdraw map, the counters of Section 6 and what each bound makes the kernels look at.
    """
    frame, covered = bench.frame(BOX), bench.frame(BOX).gbuffer.covered
    settings = {bound: splats(bench, BOX, bound=bound) for bound in BOUNDS}
    drawn = {bound: counted(bench, BOX, one) for bound, one in settings.items()}
    fragments, pixels = drawn["ellipsoid"], int(covered.sum())
    mean, most = fragments.total / pixels, fragments.overdraw.max()
    shown = (
        pictures.mapped("overdraw", "overdraw", f"mean {mean:.0f}, most {most}; white: 256 and more",
                        fragments.overdraw, covered, GREYS),
        pictures.indirect("picture", "indirect light", "768 lights cut at 5 %", sii(frame, settings["ellipsoid"]),
                          pictures.exposure_of(full_sum(bench, BOX), covered), settings["ellipsoid"]))
    bounds = tuple((title, drawn[bound].evaluated / pixels, drawn[bound].evaluated / fragments.total)
                   for bound, title in BOUNDS.items())
    wasted = drawn["tangent"].evaluated / fragments.total
    return Figure(
        shows="The overdraw of 768 splats: 125 on average, white stands for 256; 42 600 fragments a light.",
        facts=(BOX, f"{PAPER_LIGHTS} lights, 5 %", f"reference length {reference_length(bench, BOX):.3g} m"),
        pictures=shown,
        tables=(Table("Counters", ("", "here", "paper"), _counters(fragments, pixels), frozenset({2})),
                Table("Pairs that the kernels look at, by bound: the picture is the same to the bit",
                      ("bound", "a pixel", "a fragment"), bounds)),
        notes=("The paper counts what its meshes cover, this count is of pairs with B ≥ I_low, which the meshes "
               "enclose. The mean is no finding: the reference length was chosen for it. The spread is: on the "
               f"ball, which stands within reach of most lights, {most} of {PAPER_LIGHTS} count at one pixel.",
               f"Lights are listed for tiles of 8 by 8 pixels, which costs {wasted:.2f} pairs a fragment with the "
               "tangent-family ellipsoid. A tile reads its receivers once for all of its lights, so the traffic of "
               "Section 6 is the graphics hardware's and not this program's."))


def _counters(fragments: Fragments, pixels: int) -> tuple[tuple[Cell, ...], ...]:
    paper = PAPER_PIXELS * PAPER_OVERDRAW
    return (
        ("mean overdraw", fragments.total / pixels, PAPER_OVERDRAW),
        ("share of the lights", fragments.total / pixels / PAPER_LIGHTS, PAPER_OVERDRAW / PAPER_LIGHTS),
        ("fragments a light", fragments.total / PAPER_LIGHTS, paper / PAPER_LIGHTS),
        ("bits read a fragment", float(FRAGMENT_BITS), 72.0),
        ("bits read a sample of gathering", float(SAMPLE_BITS), 112.0),
        ("MB read by the splats", fragments.bits / MEGABYTE, 72 * paper / MEGABYTE),
        (f"MB read by {SAMPLES} samples at every pixel", gather_bits(pixels, SAMPLES) / MEGABYTE,
         112 * PAPER_PIXELS * SAMPLES / MEGABYTE))
