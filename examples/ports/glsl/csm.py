"""Convolution shadow maps (VAL): basis, mip map, means over discs, visibility."""

import numpy as np
from device import Arrays, Gpu


def basis(gpu: Gpu, arrays: Arrays, _: str) -> None:
    """Run csm_basis.comp."""
    depth, terms = arrays["maps.t"], arrays.facts["csm"]["terms"]
    result = gpu.empty(depth.size * (4 * terms + 1))
    gpu.run("csm_basis.comp", (), {0: depth, 1: result}, depth.size, maps=len(depth), texels=depth[0].size, terms=terms)
    arrays.write("basis.0", gpu.read(result))


def mip(gpu: Gpu, arrays: Arrays, _: str) -> None:
    """Run csm_mip.comp for each level."""
    level = arrays["basis.0"]
    for number in range(1, len(arrays.facts["basis.sides"])):
        planes, side = level.shape[0] * level.shape[1], level.shape[-1]
        half_side = (side + 1) // 2
        result = gpu.empty(planes * half_side**2)
        gpu.run("csm_mip.comp", (), {0: gpu.stored(level), 1: result}, planes * half_side**2, planes=planes, side=side)
        level = gpu.read(result).reshape(*level.shape[:2], half_side, half_side)
        arrays.write(f"basis.{number}", level)


def means(gpu: Gpu, arrays: Arrays, stage: str) -> None:
    """Run csm_means.comp on the discs of the search or of the penumbra."""
    name = stage.removesuffix(".means")
    asked = arrays["search.pending" if name == "search" else "penumbra.shaded"].astype(np.int32)
    sides, terms = arrays.facts["basis.sides"], arrays.facts["csm"]["terms"]
    channels = 4 * terms + 1 if name == "search" else 2 * terms
    chain = np.concatenate([arrays[f"basis.{number}"].reshape(-1) for number in range(len(sides))])
    result = gpu.empty(asked.size * channels)
    gpu.run("csm_means.comp", (), {0: asked, 1: arrays[f"{name}.region"], 2: gpu.stored(chain), 3: result}, asked.size,
            maps=len(asked), pixels=asked[0].size, levels=len(sides), stored_channels=4 * terms + 1, channels=channels,
            side=sides[0])
    arrays.write(f"{stage}", gpu.read(result))


def visibility(gpu: Gpu, arrays: Arrays, _: str) -> None:
    """Run csm_visibility.comp."""
    csm, shaded = arrays.facts["csm"], arrays["penumbra.shaded"].astype(np.int32)
    otherwise = arrays["hard.share"] if "hard.share" in arrays else np.ones(shaded.shape, np.float32)
    result = gpu.empty(shaded.size)
    gpu.run("csm_visibility.comp", (), {
        0: shaded, 1: arrays["penumbra.t"], 2: gpu.stored(arrays["penumbra.means"]), 3: arrays["series.weight"],
        4: gpu.stored(otherwise), 5: result,
    }, shaded.size, maps=len(shaded), pixels=shaded[0].size, terms=csm["terms"], bias=float(arrays["series.bias"][1]),
        gain=csm["gain"])
    arrays.write("visibility.share", gpu.read(result))
