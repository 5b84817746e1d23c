"""The pictures of a bench, in `pictures/SCENE/` of its folder: references, ids, and the first seed of every setting."""

import itertools
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.bench.grid import TRUTH
from refgi.compare.outcome import UNOCCLUDED
from refgi.compare.pictures import linear_planes
from refgi.frame import Frame
from refgi.image import write_exr
from refgi.provenance import Record, method_record, scene_record
from refgi.scene import Scene

Array = npt.NDArray[Any]

FOLDER = "pictures"
TRUTH_FILES = {TRUTH: f"{TRUTH}.exr", UNOCCLUDED: f"{TRUTH}_{UNOCCLUDED}.exr"}
IDS_FILE = "ids.exr"


class Place(NamedTuple):
    """Where the pictures of one scene lie."""

    out: Path  # folder of results.json
    folder: str  # inside it

    def name(self, file: str) -> str:
        """Return a file as results.json names it."""
        return f"{self.folder}/{file}"


def places(out: Path, scenes: Sequence[str]) -> list[Place]:
    """Return a place for each of several scenes: folders by their names, the later ones of one name with a number."""
    names: list[str] = []
    for scene in scenes:
        stem = re.sub(r"[^A-Za-z0-9_-]+", "_", scene) or "_"
        numbered = (f"{stem}-{number}" for number in itertools.count(2))
        names.append(next(name for name in itertools.chain([stem], numbered) if name not in names))
    return [Place(out, f"{FOLDER}/{name}") for name in names]


class Writer(NamedTuple):
    """Writes pictures of one scene, each with the record of how it was made."""

    place: Place
    scene: Scene  # as it was loaded
    frame: Frame  # what they show

    def write(self, stem: str, planes: Mapping[str, Array], record: Record) -> str:
        """Write one EXR, whole or not at all; return its path from the folder of results.json.

        `planes`: (h, w) by channel; `record`: what it holds beside the record of scene and frame.
        """
        frame, name = self.frame, self.place.name(f"{stem}.exr")
        file = self.place.out / name
        file.parent.mkdir(parents=True, exist_ok=True)
        options = {"dtype": frame.dtype.name, "rsm_resolution": frame.rsm_resolution, "shadows": frame.shadows}
        write_exr(file, planes, {**scene_record(self.scene, options, size=(frame.width, frame.height)), **record})
        return name

    def write_runs(self, runs: Sequence[tuple[str, Any, Array, Array | None]]) -> Iterator[str]:
        """Write pictures of methods and yield each file, from the folder of results.json.

        A run: method, all its settings, indirect irradiance (3, h, w), W/m^2, and receivers' lobes (3, h, w), W/m^2/sr,
        or None.
        """
        counts: Counter[str] = Counter()
        for method, settings, irradiance, lobes in runs:
            counts[method] += 1
            planes = linear_planes(self.frame.radiance(irradiance, lobes), irradiance, lobes=lobes)
            yield self.write(f"{method}-{counts[method]:02d}", planes, method_record(method, settings))

    def write_ids(self) -> str:
        """Write what each pixel shows, planes `face` and `material`, 2^32 - 1 where nothing; return the file."""
        buffer = self.frame.gbuffer
        ids = {"face": buffer.triangle_id, "material": buffer.material_id}
        return self.write(Path(IDS_FILE).stem, {key: plane.astype(np.uint32) for key, plane in ids.items()}, {})
