"""Slow literal twins of the figures of error: one pixel after another, written from the definitions."""

import math


def _pairs(image, reference, covered):
    """Yield (x, r) of every covered pixel and channel as Python floats."""
    channels, height, width = reference.shape
    for c in range(channels):
        for i in range(height):
            for j in range(width):
                if covered is None or covered[i, j]:
                    yield float(image[c, i, j]), float(reference[c, i, j])


def mse(image, reference, covered=None):
    squares = [(x - r) ** 2 for x, r in _pairs(image, reference, covered)]
    return math.fsum(squares) / len(squares)


def rmse(image, reference, covered=None):
    return math.sqrt(mse(image, reference, covered))


def relmse(image, reference, covered=None):
    pairs = list(_pairs(image, reference, covered))
    floor = 0.1 * math.fsum(r for _, r in pairs) / len(pairs)
    if any(r * r + floor * floor == 0 for _, r in pairs):
        return math.nan
    return math.fsum((x - r) ** 2 / (r * r + floor * floor) for x, r in pairs) / len(pairs)


def mae(image, reference, covered=None):
    errors = [abs(x - r) for x, r in _pairs(image, reference, covered)]
    return math.fsum(errors) / len(errors)


def smape(image, reference, covered=None):
    parts = []
    for x, r in _pairs(image, reference, covered):
        parts.append(0.0 if x == 0 and r == 0 else abs(x - r) / (abs(x) + abs(r)))
    return math.fsum(parts) / len(parts)


def bias(image, reference, covered=None):
    errors = [x - r for x, r in _pairs(image, reference, covered)]
    return math.fsum(errors) / len(errors)


def psnr(image, reference, covered=None):
    peak = max(r for _, r in _pairs(image, reference, covered))
    if peak <= 0:
        return math.nan
    squared_error = mse(image, reference, covered)
    return math.inf if squared_error == 0 else 20 * math.log10(peak) - 10 * math.log10(squared_error)


def ssim(image, reference, covered=None):
    """11x11 Gaussian windows, sigma 1.5, cut at the border and the mask; two-pass moments."""
    peak = max(r for _, r in _pairs(image, reference, covered))
    if peak <= 0:
        return math.nan
    c1, c2 = (0.01 * peak) ** 2, (0.03 * peak) ** 2
    channels, height, width = reference.shape
    values = []
    for c in range(channels):
        for i in range(height):
            for j in range(width):
                if covered is not None and not covered[i, j]:
                    continue
                window = []
                for a in range(max(0, i - 5), min(height, i + 6)):
                    for b in range(max(0, j - 5), min(width, j + 6)):
                        if covered is None or covered[a, b]:
                            weight = math.exp(-((a - i) ** 2 + (b - j) ** 2) / (2 * 1.5 * 1.5))
                            window.append((weight, float(image[c, a, b]), float(reference[c, a, b])))
                total = math.fsum(w for w, _, _ in window)
                mean_x = math.fsum(w * x for w, x, _ in window) / total
                mean_r = math.fsum(w * r for w, _, r in window) / total
                var_x = math.fsum(w * (x - mean_x) ** 2 for w, x, _ in window) / total
                var_r = math.fsum(w * (r - mean_r) ** 2 for w, _, r in window) / total
                cov = math.fsum(w * (x - mean_x) * (r - mean_r) for w, x, r in window) / total
                values.append((2 * mean_x * mean_r + c1) * (2 * cov + c2)
                              / ((mean_x**2 + mean_r**2 + c1) * (var_x + var_r + c2)))
    return math.fsum(values) / len(values)


def flicker(images, references=None, covered=None):
    shown = references if references is not None else images
    squares, levels = [], []
    for t in range(len(images) - 1):
        now = list(_pairs(images[t], shown[t], covered))
        after = list(_pairs(images[t + 1], shown[t + 1], covered))
        for (x0, r0), (x1, r1) in zip(now, after, strict=True):
            change = (x1 - r1) - (x0 - r0) if references is not None else x1 - x0
            squares.append(change * change)
    for image, reference in zip(images, shown, strict=True):
        levels += [r for _, r in _pairs(image, reference, covered)]
    level = math.fsum(levels) / len(levels)
    return math.sqrt(math.fsum(squares) / len(squares)) / level if level else math.nan
