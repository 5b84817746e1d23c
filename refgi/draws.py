"""Seeded random numbers of the methods: a hash of seed, stream and index, which any language reproduces to the bit.

In GLSL, with ``uint`` of 32 bits::

    uint mix32(uint x) {
        x = (x ^ (x >> 16)) * 0x21F0AAADu;
        x = (x ^ (x >> 15)) * 0xD35A2D97u;
        return x ^ (x >> 15);
    }
    float draw(uint seed, uint stream, uint index) {
        uint key = mix32(mix32(seed + 0x9E3779B9u) ^ stream);
        return float(mix32(mix32(index + key) ^ key) >> 8) * (1.0 / 16777216.0);
    }

A stream is one use of random numbers; a use that needs several of them, such as one for each map, numbers its parts:
the stream is then `use + 256 part`. Nothing keeps state, so a value depends on nothing that was drawn before it.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel
from refgi.sampling import hash_bits

Array = npt.NDArray[Any]

# uses; docs/conventions.md lists what each draws
(PIXEL_LIGHTS, LIGHT_PATHS, ROULETTE, RANGE, ERROR_SAMPLES, GATHERING, AREA_LIGHT_SAMPLES, IMPERFECT_MAPS) = range(8)
PARTS = 1 << 24  # of one use


@kernel
def draw_bits(seed: Any, stream: Any, index: Any) -> Any:
    """Return 32 random bits: a permutation of the index, another one for each seed and stream, all modulo 2^32."""
    key = hash_bits(hash_bits(np.uint32(np.uint32(seed) + np.uint32(0x9E3779B9))) ^ np.uint32(stream))
    return hash_bits(hash_bits(np.uint32(np.uint32(index) + key)) ^ key)


def draws(seed: int, use: int, count: int, part: int = 0) -> Array:
    """Return numbers 0 to `count` - 1 of a stream, (count,) float64 in [0, 1); one minus them lie in (0, 1].

    They are multiples of 2^-24, the same in float32. `seed` is 0 or more, taken modulo 2^32; `use` is one of this
    module's uses, `part` which stream of it.

    >>> draws(1, PIXEL_LIGHTS, 3).round(6).tolist()
    [0.64236, 0.831962, 0.388469]
    """
    expect(seed >= 0, "seed", "a whole number >= 0", seed)
    expect(0 <= part < PARTS, "part", f"0 to {PARTS - 1}", part)
    values = np.empty(count)
    _fill(np.uint32(seed % 2**32), np.uint32(use + 256 * part), values)
    return values


@kernel
def _fill(seed: Any, stream: Any, values: Array) -> None:
    for i in range(len(values)):
        values[i] = np.float64(draw_bits(seed, stream, np.uint32(i)) >> np.uint32(8)) * 2.0**-24
