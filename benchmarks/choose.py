"""What `refgi choose` finds beside a full search: is the wish met, and what does the choice cost over the best?

Pairs of scene and wish that nothing was set by. A choice is judged again with seeds and a truth of its own; the full
search runs every rung of every track that is faster than half of the choice, the only ones that could show it to cost
more than twice the best, or, for a time, every rung that takes no longer than the wish.
"""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from benchmarks.harness import Row, real_scene
from refgi.bench.choose import Pictures, Wish, choose
from refgi.bench.grid import Choice, Track, built_in_tracks
from refgi.scene import Scene, load_scene

SIZE = {"width": 160, "height": 120, "shadows": "exact"}
OTHER_SEED, OTHER_TRUTH = 1000, 7
ROUNDS = 3
BUILT_IN = ("cornell_sphere", "atrium", "parallel_plates")
PAIRS = (
    ("cornell_sphere", Wish(error=0.2)), ("atrium", Wish(error=0.5)), ("atrium", Wish(seconds=0.1)),
    ("parallel_plates", Wish(seconds=0.05)), ("cornell_horse", Wish(error=0.1)), ("teapot", Wish(error=0.3)),
    ("kitchen", Wish(seconds=0.2)), ("sponza", Wish(error=0.6)), ("buddha", Wish(error=0.2)),
    ("flying_bunnies", Wish(error=0.3)),
)


class Outcome(NamedTuple):
    """A pair of scene and wish."""

    kept: float  # error or time over the wish
    over_best: float  # time over that of the best that meets an error; error over the least within a time
    run: int  # choices that the full search ran


def rows(quick: bool) -> Iterator[Row]:
    found = []
    for name, wish in PAIRS[:3] if quick else PAIRS:
        source = name if name in BUILT_IN else real_scene(name)
        if source is None:
            continue
        found.append(one := _outcome(load_scene(source), wish))
        asked = f"{100 * wish.error:g} %" if wish.error else f"{1e3 * (wish.seconds or 0):g} ms"
        yield Row(f"{name}, {asked}: what is kept over the wish", one.kept, "x", "<= 1")
        yield Row(f"{name}, {asked}: cost over the best", one.over_best, "x", "<= 2",
                  f"full search of {one.run} choices")
    met = sum(one.kept <= 1 for one in found)
    yield Row("wishes that are met", met / max(1, len(found)), "of all", ">= 0.9", f"{met} of {len(found)}")
    cheap = sum(one.over_best <= 2 for one in found)
    yield Row("choices that cost at most twice the best", cheap / max(1, len(found)), "of all", ">= 0.9",
              f"{cheap} of {len(found)}")


def _outcome(scene: Scene, wish: Wish) -> Outcome:
    tracks = built_in_tracks()
    best = choose(scene, tracks, wish, rounds=ROUNDS, **SIZE).found.best
    truth = dataclasses.replace(wish.truth, seed=OTHER_TRUTH)
    again = Pictures(scene, truth, ROUNDS, lambda *_: None, dict(SIZE), OTHER_SEED)
    if best is None:  # right where nothing is fast enough
        missed = wish.error is not None or any(_faster(tracks, again, wish.seconds or 0))
        return Outcome(math.inf, math.inf, 0) if missed else Outcome(0.0, 1.0, len(tracks))
    judged = best.choice
    kept = again.error(judged) / wish.error if wish.error else again.seconds(judged) / (wish.seconds or 1)
    if wish.error:
        known = [(again.seconds(one), again.error(one)) for one in _faster(tracks, again, again.seconds(judged) / 2)]
        fastest = min((seconds for seconds, error in known if error <= wish.error), default=again.seconds(judged))
        return Outcome(kept, again.seconds(judged) / fastest, len(known))
    known = [(again.seconds(one), again.error(one)) for one in _faster(tracks, again, wish.seconds or 0)]
    nearest = min((error for seconds, error in known if seconds <= (wish.seconds or 0)), default=again.error(judged))
    return Outcome(kept, again.error(judged) / nearest, len(known))


def _faster(tracks: Sequence[Track], pictures: Pictures, seconds: float) -> Iterator[Choice]:
    """Yield the choices of each track up to the first that takes longer."""
    for track in tracks:
        for choice in track.rungs:
            if pictures.seconds(choice) > seconds:
                break
            yield choice
