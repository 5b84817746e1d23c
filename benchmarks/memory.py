"""Peak memory of a frame of a million triangles, above what Python and the compiled kernels take."""

import json
import subprocess
import sys
from collections.abc import Iterator

from benchmarks.harness import Row

# A small frame first: it imports and compiles everything, and its peak is the floor that is subtracted.
MEASURE = """
import json, resource, sys
import numpy as np
from refgi import Frame, load_scene
from refgi.methods import render

def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024

def bytes_of(value):
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, (tuple, list)):
        return sum(map(bytes_of, value))
    return sum(map(bytes_of, vars(value).values())) if hasattr(value, "__dict__") else 0

render("cornell_box", "sii", width=64, height=64)
floor = peak()
scene = load_scene(f"atrium:faces={sys.argv[1]}")
picture = render(scene, "sii", width=1024, height=1024)
frame = picture.frame
held = bytes_of([scene.geometry, picture.irradiance, picture.radiance, frame.direct, list(frame.rsms), frame.gbuffer])
print(json.dumps({"floor": floor, "peak": peak(), "held": held, "faces": scene.face_count}))
"""


def rows(quick: bool) -> Iterator[Row]:
    faces = 100_000 if quick else 1_000_000
    command = [sys.executable, "-c", MEASURE, str(faces)]
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    mebi = 2.0**20
    yield Row("peak resident memory", found["peak"] / mebi, "MiB", note=f"atrium, {found['faces']} faces, 1024x1024")
    yield Row("of it Python, libraries and kernels", found["floor"] / mebi, "MiB", note="peak of a 64x64 frame")
    yield Row("scene and buffers", found["held"] / mebi, "MiB")
    yield Row("peak above the floor / scene and buffers", (found["peak"] - found["floor"]) / found["held"], "x",
              "<= 3")
