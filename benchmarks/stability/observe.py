"""Write anew the worst that is observed where numbers round: `python -m benchmarks.stability.observe [CHANGE ...]`.

Limits of "observed x 2" rest on it. Run it after a change that makes rounding smaller, never to make a failure pass.
"""

import json
import sys
from pathlib import Path
from typing import Any

from benchmarks.harness import real_scene
from refgi import load_scene
from refgi.methods import BUILT_IN
from refgi.stress.changes import CHANGES
from refgi.stress.promises import FILE
from refgi.stress.run import stress

SIZE, LARGER = 64, 96
SCENES = ("cornell_box", "cornell_sphere:faces=1000", "stage", "ring:faces=3000",
          "glass_ball:faces=3000", "metaballs", "integrating_sphere:faces=1000", "parallel_plates", "wedge", "atrium",
          "textured_atrium", "leaf_grid")
REAL = ("cornell_horse", "dragon_bunny")
SAID = "all built-in and two real scenes, 64 x 64, and five at 96 x 96"
LARGER_SCENES = ("cornell_box", "stage", "ring:faces=3000", "glass_ball:faces=3000", "metaballs")
FAST = ("gather", "sii", "multires", "hssil")  # also seen larger


def main(asked: list[str]) -> int:
    rounded = [change.name for change in CHANGES
               if change.promise in ("rounding", "mean") and change.name != "hidden plane"]
    rounded = asked or rounded
    worst: dict[str, dict[str, Any]] = json.loads(FILE.read_text())["worst"] if asked else {}
    for known in worst.values():
        for name in asked:
            known.pop(name, None)
    real = [str(file) for name in REAL if (file := real_scene(name)) is not None]
    views = [(name, SIZE, tuple(BUILT_IN)) for name in (*SCENES, *real)]
    for name, size, methods in [*views, *((name, LARGER, FAST) for name in LARGER_SCENES)]:
        scene = load_scene(name)
        for found in stress(scene, methods, width=size, height=size, changes=rounded, source=name, unknown=True):
            row = found.row
            if row.kind == "observed x 2":
                known = worst.setdefault(row.subject, {})
                before = known.get(row.property, (0.0, ""))
                known[row.property] = (row.figure, scene.name) if row.figure > before[0] else before
        print(f"{Path(name).stem} done", flush=True)
        said = SAID if len(real) == len(REAL) else ", ".join(SCENES)
        digits = {subject: {change: [float(f"{figure:.2g}"), where] for change, (figure, where) in rows.items()}
                  for subject, rows in worst.items()}
        FILE.write_text(json.dumps({"scenes": said, "worst": digits}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
