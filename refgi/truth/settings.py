"""TruthSettings: what the ground truth is asked for."""

import dataclasses
import math
from pathlib import Path
from typing import Literal

from refgi.errors import expect

Estimator = Literal["combined", "hemisphere", "light"]
Emitters = Literal["all", "seen"]

# By trial the least error in equal time on the Cornell box, at 0.5 s as at 5 s; half or twice of each differs little.
PICKS, DIRECTIONS, DIRECTIONS_ALONE, BOUND = 16, 8, 16, 0.1


@dataclasses.dataclass(frozen=True)
class TruthSettings:
    """How the ground truth is computed and when it stops: at the first of `samples`, `seconds`, `target_error`.

    - `estimator`: "combined" (split at a bounded geometry term), "hemisphere" or "light" alone.
    - `samples` per pixel (picks of light vertices plus hemisphere directions; at least two passes are made), `seconds`
      (checked after each pass), `target_error` (root mean square standard error of the picture over its mean).
    - `visibility=False`: nothing blocks between emitter and receiver; the emitter's direct light stays shadowed.
    - `emitters="seen"`: only what the camera sees lights anything (inside its picture, facing it, nothing between), as
      for a method that knows the picture alone. `visibility` remains a choice of its own.
    - `bounces` before the receiver, diffuse or glossy, 1 or more.
    - `caustics`: add light through mirror-like lobes and glass, by `photons` from each light in a pass; those lobes are
      then left out of the estimators.
    - `seed`: which random numbers.
    - `interleave`^2 sets of light vertices a pass: pixel (x, y) picks from set (x mod `interleave`, y mod
    `interleave`).
    - `uniform_share` of each light's rays go out evenly, the rest where a pilot found that they light the picture.
    - `light_grid` directions along one side of each light's grid, `picks` of light vertices and `directions` over the
      hemisphere (8, or 16 for "hemisphere") of each receiver in a pass; `bound` is the largest geometry term left to
      the light side, in units of 1 / footprint of a light direction.
    - `checkpoint`: file that holds all passes so far; an existing one of the same computation is continued.
    - `batch` rays are traced at a time, which changes memory and never a bit of the result.
    """

    estimator: Estimator = "combined"
    samples: int = 192
    seconds: float | None = None
    target_error: float | None = None
    visibility: bool = True
    emitters: Emitters = "all"
    bounces: int = 1
    caustics: bool = False
    photons: int = 1 << 18
    seed: int = 0
    light_grid: int = 32
    interleave: int = 4
    uniform_share: float = 0.5
    picks: int = PICKS
    directions: int | None = None
    bound: float = BOUND
    checkpoint: Path | str | None = None
    batch: int = 1 << 18

    def __post_init__(self) -> None:
        expect(self.estimator in ("combined", "hemisphere", "light"), "estimator",
               "'combined', 'hemisphere' or 'light'", self.estimator)
        expect(self.emitters in ("all", "seen"), "emitters", "'all' or 'seen'", self.emitters)
        for key, low, high in (("samples", 1, 2**31), ("bounces", 1, 64), ("seed", 0, 2**32 - 1),
                               ("light_grid", 1, 1024), ("interleave", 1, 64), ("picks", 1, 1024),
                               ("photons", 1, 2**28), ("batch", 1, 2**30)):
            value = getattr(self, key)
            expect(isinstance(value, int) and low <= value <= high, key, f"an integer, {low} to {high}", value)
        expect(self.directions is None or 1 <= self.directions <= 65536, "directions", "1 to 65536",
               self.directions)
        for key in ("seconds", "target_error"):
            value = getattr(self, key)
            expect(value is None or (math.isfinite(value) and value > 0), key, "a finite number > 0", value)
        expect(0 < self.uniform_share <= 1, "uniform_share", "a number in (0, 1]", self.uniform_share)
        expect(math.isfinite(self.bound) and self.bound > 0, "bound", "a finite number > 0", self.bound)
        expect(self.bounces == 1 or self.estimator != "light", "bounces",
               "1 for the light estimator, which knows no further bounce", self.bounces)
        expect(self.bounces == 1 or self.visibility, "visibility", "True for more than one bounce", self.visibility)
        expect(self.emitters == "all" or (self.bounces == 1 and not self.caustics), "emitters",
               "'all' for caustics or more than one bounce", self.emitters)

    @property
    def traces_rays(self) -> bool:
        """Whether the method traces rays."""
        return True

    @property
    def picks_per_pass(self) -> int:
        """Lit points that each receiver picks in a pass."""
        return 0 if self.estimator == "hemisphere" else self.picks

    @property
    def directions_per_pass(self) -> int:
        """Hemisphere directions of each receiver in a pass."""
        if self.estimator == "light":
            return 0
        return self.directions or (DIRECTIONS_ALONE if self.estimator == "hemisphere" else DIRECTIONS)

    @property
    def passes(self) -> int:
        """Passes that make up `samples`, at least two."""
        return max(2, -(-self.samples // (self.picks_per_pass + self.directions_per_pass)))

    @property
    def shared_bound(self) -> float:
        """The bound as kernels take it: infinite leaves all to the light side, 0 all to the hemisphere."""
        return {"combined": self.bound, "light": math.inf, "hemisphere": 0.0}[self.estimator]
