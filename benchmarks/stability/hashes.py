"""Print a hash of each stage's result, for comparisons of processes.

`python -m benchmarks.stability.hashes METHOD[,KEY=VALUE] ...`; the threads, the compiler's target and the folder of
compiled kernels are those of the environment.
"""

import json
import sys
import warnings

from refgi import Frame, load_scene
from refgi.batch.digest import hashes_of
from refgi.errors import RefgiWarning
from refgi.methods import find_method
from refgi.stages import observe
from refgi.stress.promises import settings_of

SCENES = ("cornell_box", "stage")
WIDTH, HEIGHT, MAP = 45, 33, 64  # pixels, texels: no multiples of any tile
FEW = {"sii": ("lights=256",), "multires": ("lights=256",), "val": ("lights=256", "clusters=8", "maps=64"),
       "vpl": ("lights=64",), "truth": ("samples=32",)}


def hashes(method: str, *changes: str) -> dict[str, str]:
    """Return the hash of each stage's results, in the order in which they ended, over all scenes."""
    found: dict[str, str] = {}
    settings = settings_of(method, (*FEW.get(method, ()), *changes))
    for scene in SCENES:
        with warnings.catch_warnings(), observe(record=True) as log:
            warnings.simplefilter("ignore", RefgiWarning)
            frame = Frame(load_scene(scene), width=WIDTH, height=HEIGHT, rsm_resolution=MAP)
            frame.radiance(find_method(method).compute(frame, settings)[0])
        found |= {f"{scene} {number} {name}": digest for number, (name, digest) in enumerate(hashes_of(log, {}))}
    return found


if __name__ == "__main__":
    print(json.dumps({text.partition(",")[0]: hashes(*text.split(",")) for text in sys.argv[1:]}))
