"""Named skips: what a scene does not need and refgi leaves out, each of which can be switched off.

Code that leaves something out asks `left_out` by the skip's name, and does it after all where the answer is no. A skip
is exact: the picture has the same bits with it and without. A method that runs inside `without_skip` shows what a skip
saves, one inside `count_skips` how much there is of it; elsewhere all skips are on. Both hold for the thread that opens
the block alone, and a `refgi.stages.Memory` gives its results back whichever skips are on.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from types import MappingProxyType
from typing import NamedTuple, SupportsInt

from refgi.errors import expect

__all__ = ["SKIPS", "Count", "Skip", "count_skips", "left_out", "without_skip"]


class Skip(NamedTuple):
    """What is left out."""

    meaning: str
    unit: str  # what is counted


SKIPS: Mapping[str, Skip] = MappingProxyType({
    "frame.buffers": Skip("buffers that the method never asks for", "of G-buffer, RSM and ray structure"),
    "frame.lobes": Skip("the lobes of receivers, where no visible surface is glossy", "pixels"),
    "rsm.channels": Skip("channels of a G-buffer that nothing reads yet", "channels, summed over passes"),
    "rsm.texels": Skip("channels of an RSM's texels that are no pixel light", "texels, once a look-up"),
    "rsm.clusters": Skip("clusters of triangles that lie behind others", "clusters, once a band of rows"),
    "lights.refraction": Skip("the search for glass in maps, where no material is glass", "texels, once a search"),
    "pairs.pixels": Skip("pixels without surface", "pixels"),
    "pairs.tiles": Skip("diffuse lights that all receivers of a tile lie behind, or that lie behind all of these",
                        "pairs of light and tile"),
    "pairs.lobes": Skip("the sum over lobes, where no light is glossy", "lights, once a sum"),
    "pairs.lobe_tiles": Skip("glossy lights whose lobe misses a tile", "pairs of light and tile"),
    "pairs.receiver_lobes": Skip("pixel lights that lie in no receiver's lobe of a tile", "pairs of light and tile"),
    "pairs.shadow_rays": Skip("shadow rays of pairs that face away from each other or give no light", "rays"),
    "sii.bounds": Skip("pairs outside of the bound of a light's range", "pairs of light and tile"),
    "cluster.distances": Skip("distances to area lights that the triangle inequality rules out", "clusterings"),
    "cluster.maps": Skip("shadow maps of area lights that nothing occludes", "area lights"),
    "cluster.subsets": Skip("tiles whose pixels take none of an area light's pixel lights",
                            "pairs of area light and tile"),
    "cluster.facing": Skip("normals of triangles that no shadow reads", "pixels"),
    "cluster.casters": Skip("depth tests of PCF and PCSS in blocks of 8 x 8 texels that hold nothing",
                            "blocks, once a map"),
    "cluster.receivers": Skip("visibility of an area light at pixels that it does not light",
                              "pairs of area light and pixel"),
    "sssil.levels": Skip("levels of which no texel has another in its crown", "levels"),
    "sssil.senders": Skip("receivers at either end of a strip that a sample is dark for",
                          "texels at dark ends of rows"),
    "truth.photons": Skip("photons, where no lobe is sharp", "photons a pass"),
})


class Count(NamedTuple):
    """How much was left out, summed over all places that asked."""

    left_out: int
    of: int


_off: ContextVar[frozenset[str]] = ContextVar("refgi_skips_off", default=frozenset())
_counts: ContextVar[dict[str, Count] | None] = ContextVar("refgi_skips_counted", default=None)


def left_out(name: str, count: Callable[[], tuple[SupportsInt, SupportsInt]]) -> bool:
    """Return whether to leave out what a skip names.

    Parameters
    ----------
    name : str
        One of `SKIPS`.
    count : callable
        Returns how much there is to leave out, and of how much; called inside `count_skips` alone.

    Returns
    -------
    bool
        False inside `without_skip` of that name.
    """
    counts = _counts.get()
    if counts is not None:
        before, now = counts.get(name, Count(0, 0)), count()
        counts[name] = Count(before.left_out + int(now[0]), before.of + int(now[1]))
    return name not in _off.get()


@contextmanager
def without_skip(*names: str) -> Iterator[None]:
    """Switch skips off inside the block.

    Parameters
    ----------
    *names : str
        Of `SKIPS`.

    Yields
    ------
    None
        Nothing.

    Raises
    ------
    InputError
        If there is no skip of a name.
    """
    for name in names:
        expect(name in SKIPS, "skip", f"one of {', '.join(SKIPS)}", name)
    token = _off.set(_off.get() | set(names))
    try:
        yield
    finally:
        _off.reset(token)


@contextmanager
def count_skips() -> Iterator[dict[str, Count]]:
    """Count what is left out inside the block, which takes time of its own.

    Yields
    ------
    dict of str to Count
        By name, filled while the block runs: skips of which there is nothing to leave out may be absent.
    """
    counts: dict[str, Count] = {}
    token = _counts.set(counts)
    try:
        yield counts
    finally:
        _counts.reset(token)
