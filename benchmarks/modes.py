"""Modes that do less: error and speed beside the same light in full, on six scenes.

An error is RMSE of irradiance over its mean, both over all pixels; a speed is that of the method alone on buffers that
rest, median of ratios. The papers' scenes are used where REFGI_DATA names their folder, built-in ones elsewhere.
"""

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.harness import Row, paper_scene, ratio, relative_rmse
from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.methods import find_method, usual_shadows
from refgi.settings import of

SCENES = ("cornell_horse", "sponza", "kitchen", "dragon_bunny", "flying_bunnies", "caustic_ring")
Mode = tuple[str, dict[str, Any]]  # method, settings by key
MANY = {"lights": 16384, "pattern": "grid"}
SHADOWED = {"lights": 1024, "pattern": "halton"}
MODES: dict[str, tuple[Mode, Mode]] = {  # the mode, and the same light in full
    "sii, lightcuts 2 %": (("sii", MANY | {"lightcuts": "bounded"}), ("sii", MANY)),
    "sii, cut at 5 % of the light": (("sii", {"cut_share": 0.05}), ("sii", {})),
    "sii, half resolution": (("sii", {"half_resolution": True}), ("sii", {})),
    "multires, subsplats by geometry": (("multires", {}), ("sii", {"lights": 256, "pattern": "grid"})),
    "multires, subsplats to 5 %": (("multires", {"subsplats": "error"}), ("sii", {"lights": 256, "pattern": "grid"})),
    "val at subsplats": (("multires", SHADOWED | {"visibility": "val"}),
                         ("val", {"lights": 1024, "interleaving": 1})),
    "val, 8 x 8 interleaved and blurred": (("val", {"lights": 1024, "interleaving": 8}),
                                           ("val", {"lights": 1024, "interleaving": 1})),
    "vpl at subsplats": (("multires", {"lights": 64, "pattern": "grid", "visibility": "rays"}),
                         ("vpl", {"lights": 64, "pattern": "grid"})),
    "vpl at subsplats to 5 %": (("multires", {"lights": 64, "pattern": "grid", "subsplats": "error",
                                              "visibility": "rays"}), ("vpl", {"lights": 64, "pattern": "grid"})),
    "val at subsplats to 5 %": (("multires", SHADOWED | {"subsplats": "error", "visibility": "val"}),
                                ("val", {"lights": 1024, "interleaving": 1})),
}


def rows(quick: bool) -> Iterator[Row]:
    warnings.simplefilter("ignore", RefgiWarning)
    size, repeats = (96, 3) if quick else (256, 5)
    for name in SCENES:
        scene = paper_scene(name)
        for title, (mode, full) in MODES.items():
            settings = of(find_method(mode[0]).settings, **mode[1])
            frame = Frame(scene, width=size, height=size, shadows=usual_shadows(settings))
            found, whole = _light(frame, mode), _light(frame, full)
            error = relative_rmse(found, whole)
            faster = ratio(lambda frame=frame, full=full: _light(frame, full),
                           lambda frame=frame, mode=mode: _light(frame, mode), repeats)
            yield Row(f"{name}: {title}", error, "RMSE / mean", "",
                      f"{faster.median:.2f} times as fast ({faster.low:.2f} to {faster.high:.2f}), "
                      f"{1e3 * faster.seconds_b:.1f} against {1e3 * faster.seconds_a:.1f} ms at {size}^2")


def _light(frame: Frame, mode: Mode) -> Any:
    method = find_method(mode[0])
    return np.asarray(method.compute(frame, of(method.settings, **mode[1]))[0], np.float64)
