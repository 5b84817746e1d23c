"""Convolution shadow maps (VAL): basis, mip map, means over discs, visibility."""

import numpy as np
from device import Arrays, Gpu


def basis(gpu: Gpu, arrays: Arrays, stage: dict) -> None:
    """Run csm_basis.comp."""
    (name,) = stage["reads"]
    depth, terms = arrays[name], arrays.facts[stage["name"]]["terms"]
    result = gpu.empty(depth.size * (4 * terms + 1))
    gpu.run("csm_basis.comp", (), {0: depth, 1: result}, depth.size, maps=len(depth), texels=depth[0].size, terms=terms)
    arrays.write(stage["writes"][0], gpu.read(result))


def mip(gpu: Gpu, arrays: Arrays, stage: dict) -> None:
    """Run csm_mip.comp for each level."""
    level = arrays[stage["reads"][0]]
    for name in stage["writes"]:
        planes, side = level.shape[0] * level.shape[1], level.shape[-1]
        half_side = (side + 1) // 2
        result = gpu.empty(planes * half_side**2)
        gpu.run("csm_mip.comp", (), {0: gpu.stored(level), 1: result}, planes * half_side**2, planes=planes, side=side)
        level = gpu.read(result).reshape(*level.shape[:2], half_side, half_side)
        arrays.write(name, level)


def means(gpu: Gpu, arrays: Arrays, stage: dict) -> None:
    """Run csm_means.comp on the discs of the search, whose basis has all channels, or of the penumbra."""
    which, region, *levels = (arrays[name] for name in stage["reads"])
    terms, weighed = (arrays.facts[stage["name"]][key] for key in ("terms", "weighed"))
    asked, channels = which.astype(np.int32), 4 * terms + 1 if weighed else 2 * terms
    chain = np.concatenate([level.reshape(-1) for level in levels])
    result = gpu.empty(asked.size * channels)
    gpu.run("csm_means.comp", (), {0: asked, 1: region, 2: gpu.stored(chain), 3: result}, asked.size, maps=len(asked),
            pixels=asked[0].size, levels=len(levels), stored_channels=levels[0].shape[1], channels=channels,
            side=levels[0].shape[-1])
    arrays.write(stage["writes"][0], gpu.read(result))


def visibility(gpu: Gpu, arrays: Arrays, stage: dict) -> None:
    """Run csm_visibility.comp."""
    which, depth, averages, weight, bias, *tested = (arrays[name] for name in stage["reads"])
    shaded = which.astype(np.int32)
    otherwise = tested[0] if tested else np.ones(shaded.shape, np.float32)
    result = gpu.empty(shaded.size)
    gpu.run("csm_visibility.comp", (), {
        0: shaded, 1: depth, 2: gpu.stored(averages), 3: weight, 4: gpu.stored(otherwise), 5: result,
    }, shaded.size, maps=len(shaded), pixels=shaded[0].size, terms=len(weight), bias=float(bias[1]),
        gain=arrays.facts[stage["name"]]["gain"])
    arrays.write(stage["writes"][0], gpu.read(result))
