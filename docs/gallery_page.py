"""Make docs/gallery.md, its tiles and its pages: `python docs/gallery_page.py` (two minutes).

A row a scene: the truth and each method, with the RMSE of its indirect irradiance over the truth's mean and the time of
its frame; a tile opens a comparison. Pages are no part of the repository: `make docs` makes them by `--pages` alone.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image

from refgi.compare.pages import number

HERE = Path(__file__).parent
TILES, PAGES = HERE / "images" / "gallery", HERE / "extra" / "gallery"
SIZE, METHODS = "128x96", ("truth", "sii", "multires", "val", "hssil")
SCENES = {
    "cornell_box": "The Cornell box, a spot at its red wall",
    "cornell_sphere": "A sphere in the Cornell box",
    "atrium": "A colonnade of two storeys, a spot into its courtyard",
    "stage": "A glossy vase between three coloured walls",
}
HEAD = """# Gallery

Each method at its defaults on scenes that are part of refgi, {size} pixels: root of the mean square error of its
indirect irradiance over the truth's mean, and the time of a frame with all its buffers, on two cores ({processor}).
A tile opens a comparison: errors drawn, places enlarged, stages timed (`make docs` makes these pages).

This page is made by `python docs/gallery_page.py`."""


def main(pages_only: bool) -> None:
    """Compare the methods on each scene; write pages, and unless these are all that is asked for, tiles and text."""
    blocks, processor = [], ""
    for folder in (PAGES, TILES):
        folder.mkdir(parents=True, exist_ok=True)
    for scene, title in SCENES.items():
        with tempfile.TemporaryDirectory() as place:
            subprocess.run([sys.executable, "-m", "refgi", "compare", scene, "--size", SIZE, "--methods",
                            ",".join(METHODS[1:]), "--out", place], check=True)
            shutil.copy(Path(place) / "index.html", PAGES / f"{scene}.html")
            if pages_only:
                continue
            results = json.loads((Path(place) / "results.json").read_text())
            for name in METHODS:
                with Image.open(Path(place) / f"{name}.png") as picture:
                    picture.convert("RGB").quantize(256, dither=Image.Dither.NONE).save(
                        TILES / f"{scene}-{name}.png", optimize=True)
        processor = results["environment"]["cpu"]
        blocks.append(row(scene, title, results))
    if not pages_only:
        head = HEAD.format(size=SIZE.replace("x", " x "), processor=processor)
        (HERE / "gallery.md").write_text("\n\n".join([head, *blocks]) + "\n", encoding="utf-8")


def row(scene: str, title: str, results: dict[str, Any]) -> str:
    """Return a scene's heading and tiles."""
    tiles, truth = [], results["references"]["truth"]
    for name in METHODS:
        said = f"the truth: {number(truth['seconds'])} s"
        if name != "truth":
            found = results["methods"][name]
            error = found["against"]["truth"]["figures"]["rmse"]["value"] / truth["mean_irradiance"]
            said = f"`{name}`: {100 * error:.0f} %, {1000 * found['seconds']:.0f} ms"
        tiles.append(f":::{{figure}} images/gallery/{scene}-{name}.png\n:alt: {scene} by {name}\n"
                     f":target: gallery/{scene}.html\n{said}\n:::")
    return "\n\n".join([f"## {title}", "::::{container} tiles five\n\n" + "\n".join(tiles) + "\n::::"])


if __name__ == "__main__":
    main(sys.argv[1:] == ["--pages"])
