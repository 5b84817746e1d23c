"""The hash that seeded draws are made of, in whole numbers of any size."""


def mix32(x):
    x = (x ^ (x >> 16)) * 0x21F0AAAD % 2**32
    x = (x ^ (x >> 15)) * 0xD35A2D97 % 2**32
    return x ^ (x >> 15)


def draw_bits(seed, stream, index):
    key = mix32(mix32((seed + 0x9E3779B9) % 2**32) ^ stream)
    return mix32(mix32((index + key) % 2**32) ^ key)


def draw(seed, stream, index):
    """A number in [0, 1): the upper 24 bits."""
    return (draw_bits(seed, stream, index) >> 8) / 2**24
