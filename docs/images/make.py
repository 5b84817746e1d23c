"""Draw the pictures of README and docs/index.md: `python docs/images/make.py` (half a minute).

A tile for each method, its picture over the error of its indirect irradiance; means of BLOCK x BLOCK pixels.
"""

from pathlib import Path

import numpy as np
from PIL import Image

from refgi import Frame, load_scene
from refgi.compare.pictures import error_scale, luminance, paint
from refgi.image.picture import tone_map
from refgi.methods import METHODS
from refgi.settings import of

HERE = Path(__file__).parent
SIZE, BLOCK = 160, 3
METHOD_SETTINGS = {"sii": {"lights": 1024}, "multires": {"lights": 1024}, "val": {"lights": 1024}, "hssil": {},
                   "truth": {}}


def main() -> None:
    scene = load_scene("atrium:faces=400000")
    frame = Frame(scene, width=SIZE * BLOCK, height=SIZE * BLOCK, rsm_resolution=1024, shadows="exact")
    light = {"direct": None}
    for name, changes in METHOD_SETTINGS.items():
        method = METHODS[name]
        light[name] = method.function(frame, of(method.settings, **changes)).astype(frame.dtype)
    errors = {name: mean(luminance((0 if one is None else one) - light["truth"])) for name, one in light.items()}
    covered = mean(frame.gbuffer.resolve("covered")[0].astype(float)) > 0.5
    scale = error_scale([errors[name] for name in METHOD_SETTINGS if name != "truth"], covered)
    print(f"errors: {scale.low:g} (blue) to {scale.high:g} W/m^2 (red)")
    for name, one in light.items():
        picture = tone_map(np.moveaxis(mean(frame.radiance(one)), 0, -1), scene.exposure)
        tile = picture if name == "truth" else np.concatenate([picture, paint(errors[name], covered, scale)])
        Image.fromarray(tile).quantize(256, dither=Image.Dither.NONE).save(HERE / f"{name}.png", optimize=True)


def mean(planes: np.ndarray) -> np.ndarray:
    """Return means of blocks of the last two axes."""
    blocks = planes.reshape(*planes.shape[:-2], SIZE, BLOCK, SIZE, BLOCK)
    return blocks.mean(axis=(-3, -1))


if __name__ == "__main__":
    main()
