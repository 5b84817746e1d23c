"""Draw the pictures of README and docs: `python docs/images/make.py` (a minute or two)."""

from pathlib import Path

import numpy as np

from refgi import Frame, load_scene
from refgi.image import write_png
from refgi.methods import METHODS

HERE = Path(__file__).parent
GAP = 8  # white pixels between panels


def main() -> None:
    scene = load_scene("atrium:faces=400000")
    frame = Frame(scene, width=480, height=480, rsm_resolution=1024, shadows="exact")
    panels = [frame.radiance()]
    for name, changes in (("sii", {"lights": 1024}), ("vpl", {"lights": 1024}), ("truth", {})):
        method = METHODS[name]
        function, settings = method.function, method.settings
        panels.append(frame.radiance(function(frame, settings(**changes)).astype(frame.dtype)))
    white = np.full((3, frame.height, GAP), 1e3, frame.dtype)
    strip = np.concatenate([part for panel in panels for part in (white, panel)][1:], axis=2)
    write_png(HERE / "atrium.png", np.moveaxis(strip, 0, -1), scene.exposure)


if __name__ == "__main__":
    main()
