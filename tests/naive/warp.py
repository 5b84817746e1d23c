"""Chances of texels under hierarchical warping, for square maps of 2^L x 2^L texels, and the variance they leave."""


def pyramid(importance):
    """Sums S_0 .. S_L; S_L is the map, each S_l sums the four children of a cell."""
    levels = [[[float(value) for value in row] for row in importance]]
    while len(levels[0]) > 1:
        below = levels[0]
        half = range(len(below) // 2)
        levels.insert(0, [[below[2 * i][2 * j] + below[2 * i][2 * j + 1] + below[2 * i + 1][2 * j]
                           + below[2 * i + 1][2 * j + 1] for j in half] for i in half])  # fmt: skip
    return levels


def probabilities(importance, levels, method):
    """Return the chance q of each texel: that of its cell after the given number of levels, shared by its texels."""
    sums, size = pyramid(importance), len(importance)
    chance = [[1.0]]
    for level in range(1, levels + 1):
        s, above = sums[level], chance
        chance = [[0.0] * len(s) for _ in s]
        for i in range(len(s)):
            for j in range(len(s)):
                top, left = i - i % 2, j - j % 2
                row = s[i][left] + s[i][left + 1]
                total = sum(s[top + k][left + m] for k in (0, 1) for m in (0, 1))
                down = row / total if total else 0.5
                if method == "A":
                    across = s[i][j] / row if row else 0.5
                else:
                    across = (s[top][j] + s[top + 1][j]) / total if total else 0.5
                chance[i][j] = above[i // 2][j // 2] * down * across
    block = size >> levels
    return [[chance[i // block][j // block] / block**2 for j in range(size)] for i in range(size)]


def variance_of_one(values, q):
    """Return the variance of values_t / q_t for one texel t drawn with chance q: sum values^2 / q - (sum values)^2."""
    pairs = [(f, p) for row, chances in zip(values, q, strict=True) for f, p in zip(row, chances, strict=True) if f]
    return sum(f * f / p for f, p in pairs) - sum(f for f, _ in pairs) ** 2
