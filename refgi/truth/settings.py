"""TruthSettings: how the ground truth is estimated, and when it stops."""

import dataclasses
import math
from pathlib import Path
from typing import Literal

from refgi.errors import expect
from refgi.settings import LAST_SEED, Settings, setting

Estimator = Literal["combined", "hemisphere", "light"]
Emitters = Literal["all", "visible"]

# By trial the least error in equal time on the Cornell box, at 0.5 s as at 5 s; half or twice of each differs little.
PICKS, DIRECTIONS, DIRECTIONS_ALONE, BOUND = 16, 8, 16, 0.1


@dataclasses.dataclass(frozen=True)
class TruthSettings(Settings):
    """How the ground truth is computed; it stops at the first of `samples`, `seconds`, `target_error`.

    - `target_error` is the root mean square standard error of the picture over its mean; `seconds` is checked after
      each pass.
    - `visibility=False`: nothing blocks between emitter and receiver; the emitter's direct light stays shadowed.
    - `emitters="visible"`: only surfaces that the camera sees emit (inside its picture, facing it, nothing between), as
      for a screen-space method. `visibility` remains a choice of its own.
    - `caustics`: photons also carry light through mirror-like lobes and glass; those lobes are then left out of the
      estimators. Without, photons follow the sharpest lobes alone, on their first bounce.
    - `estimator`: "combined" is multiple importance sampling (MIS) of both at a bounded geometry term.
    - `interleave`^2 sets of light vertices a pass: pixel (x, y) picks from set (x mod n, y mod n), n = `interleave`.
    - `uniform_share` of each light's rays are uniform, the rest follow the density of a pilot pass.
    """

    samples: int = setting(192, "samples a pixel: picks of light vertices and directions; two passes at least", least=1,
                           most=2**31)
    seconds: float | None = setting(None, "time to stop after", above=0.0, unit="s")
    target_error: float | None = setting(None, "relative standard error to stop at", above=0.0)
    bounces: int = setting(1, "bounces before the receiver, diffuse or glossy", least=1, most=64)
    visibility: bool = setting(True, "surfaces block light between emitter and receiver")
    emitters: Emitters = setting("all", "which surfaces emit: all, or those visible to the camera")
    caustics: bool = setting(False, "photons carry light through mirror-like lobes and glass")
    seed: int = setting(0, "which random numbers", least=0, most=LAST_SEED)
    estimator: Estimator = setting("combined", "both estimators combined by MIS, or one alone", study=True)
    photons: int = setting(1 << 18, "photons of each light in a pass", least=1, most=2**28, study=True)
    light_grid: int = setting(32, "directions along one side of each light's grid", least=1, most=1024, study=True)
    interleave: int = setting(4, "pixels along one side of the pattern of sets of light vertices", least=1, most=64,
                              study=True)
    uniform_share: float = setting(0.5, "share of each light's rays that are uniform", above=0.0, most=1.0, study=True)
    picks: int = setting(PICKS, "light vertices that each receiver picks in a pass", least=1, most=1024, study=True)
    directions: int | None = setting(None, "hemisphere directions of a receiver in a pass, shared out where they are "
                                     "short; none: 8, or 16 alone",
                                     least=1, most=65536, study=True)
    bound: float = setting(BOUND, "largest geometry term left to the light side, in 1 / footprint of a direction",
                           above=0.0, study=True)
    checkpoint: Path | str | None = setting(None, "file of all passes so far, continued where it exists; in a folder: "
                                           "one of its own for all that the passes depend on", study=True)
    batch: int = setting(1 << 18, "rays traced at a time: memory, never a bit of the result", least=1, most=2**30,
                         study=True)

    def check(self) -> None:
        """Check the settings that depend on each other."""
        expect(self.bounces == 1 or self.estimator != "light", "bounces",
               "1 for the light estimator, which knows no further bounce", self.bounces)
        expect(self.bounces == 1 or self.visibility, "visibility", "True for more than one bounce", self.visibility)
        expect(self.emitters == "all" or (self.bounces == 1 and not self.caustics), "emitters",
               "'all' for caustics or more than one bounce", self.emitters)
        expect(self.checkpoint is None or isinstance(self.checkpoint, Path | str), "checkpoint", "a file's name",
               self.checkpoint)

    @property
    def traces_rays(self) -> bool:
        """Whether the method traces rays."""
        return True

    @property
    def picks_per_pass(self) -> int:
        """Light vertices that each receiver picks in a pass."""
        return 0 if self.estimator == "hemisphere" else self.picks

    @property
    def directions_per_pass(self) -> int:
        """Hemisphere directions of each receiver in a pass."""
        if self.estimator == "light":
            return 0
        return self.directions or (DIRECTIONS_ALONE if self.estimator == "hemisphere" else DIRECTIONS)

    @property
    def lobe_samples(self) -> tuple[int, int]:
        """Light vertices that each glossy receiver picks in a pass, and directions of its lobe.

        As many as a pass has of irradiance. With both estimators and no `directions` two in three follow the lobe: a
        sharp one has nothing else.
        """
        together = self.picks_per_pass + self.directions_per_pass
        if self.estimator != "combined" or self.directions is not None:
            return self.picks_per_pass, self.directions_per_pass
        return together // 3, together - together // 3

    @property
    def passes(self) -> int:
        """Passes that make up `samples`, at least two."""
        return max(2, -(-self.samples // (self.picks_per_pass + self.directions_per_pass)))

    @property
    def shared_bound(self) -> float:
        """The bound as kernels take it: infinite leaves all to the light side, 0 all to the hemisphere."""
        return {"combined": self.bound, "light": math.inf, "hemisphere": 0.0}[self.estimator]
