"""Literal twin of the light tree's bounds and cuts: one cluster, one receiver at a time, from all of its lights.

Written from docs/methods/lightcuts.md. A light is (position, reversed normal, flux / pi, softness), a receiver
(position, normal); vectors are lists of three numbers.
"""

import math


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def less(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def length(a):
    return math.sqrt(dot(a, a))


def term(light, receiver, least=0.0, most=math.inf):
    """<n_l . -d> <n_x . d> / (r^2 (max(r^2, least) + softness)), at most `most`."""
    d = less(light[0], receiver[0])
    square = dot(d, d)
    cl, cx = max(0.0, dot(light[1], d)), max(0.0, dot(receiver[1], d))
    if square == 0.0:
        return 0.0
    return min(most, cl * cx / (square * (max(square, least) + light[3])))


def irradiance(lights, receiver, least=0.0, most=math.inf):
    terms = [term(light, receiver, least, most) for light in lights]
    return [math.fsum(t * light[2][c] for t, light in zip(terms, lights, strict=True)) for c in range(3)]


def weight(light):
    return sum(light[2])


def mean(lights, values):
    total = sum(map(weight, lights))
    return [sum(weight(light) * value[k] for light, value in zip(lights, values, strict=True)) / total
            for k in range(len(values[0]))]


def representative(lights):
    """A light at the mean position with the mean normal, the flux of all and the mean softness."""
    return (mean(lights, [light[0] for light in lights]), mean(lights, [light[1] for light in lights]),
            [sum(light[2][c] for light in lights) for c in range(3)], mean(lights, [[light[3]] for light in lights])[0])


def error(lights, one, receiver, least=0.0, most=math.inf):
    """What a cluster is off by: the sum over channels."""
    return sum(abs(a - b) for a, b in zip(irradiance(lights, receiver, least, most),
                                          irradiance([one], receiver, least, most), strict=True))


def bound(lights, receiver, least=0.0, most=math.inf):
    """The bound of docs/methods/lightcuts for one receiver, from all lights and not from clusters of them."""
    p, n, _, soft = representative(lights)
    size = length(n)
    m = [x / size for x in n] if size > 0 else lights[0][1]
    x, g = receiver
    total = sum(map(weight, lights))
    away = [less(light[0], p) for light in lights]
    turn = max(length(less(light[1], m)) for light in lights)
    height = max(abs(dot(m, d)) for d in away)
    radius = max(map(length, away))
    d = less(p, x)
    reach = length(d) + radius
    along, over = dot(m, d), dot(g, d)
    across = length([a - along * b for a, b in zip(d, m, strict=True)])
    c = dot(m, g)
    s = length([a - c * b for a, b in zip(m, g, strict=True)])
    square = max(0.0, abs(along) - height) ** 2 + max(0.0, across - radius) ** 2
    swing, sunk = height + turn * reach, abs(c) * height + s * radius
    if along + swing <= 0 or over + sunk <= 0:
        return 0.0
    square = max(square, 1e-30)
    r = math.sqrt(square)
    a, b = min(1.0, (along + swing) / r), min(1.0, (over + sunk) / r)
    whole_term = a * b / (max(square, least) + min(light[3] for light in lights))
    whole = total * min(whole_term, most)
    if square < least or whole_term > most:
        return whole
    kink_a = min(a, 2 * swing / r) * b if along - swing < swing else 0.0
    kink_b = min(b, 2 * sunk / r) * a if over - sunk < sunk else 0.0
    tilt = sum(length([sum(light[2][k] * (light[1][i] - n[i]) for light in lights) for i in range(3)])
               for k in range(3))
    shift = sum(length([sum(light[2][k] * e[i] for light, e in zip(lights, away, strict=True)) for i in range(3)])
                for k in range(3))
    spread = sum(weight(light) * dot(e, e) for light, e in zip(lights, away, strict=True))
    fanned = sum(weight(light) * dot(less(light[1], n), less(light[1], n)) for light in lights)
    uneven = sum(weight(light) * abs(light[3] - soft) for light in lights)
    bend = min(3 + 1.5 * math.sqrt(6), 1 + 4 * a * b + math.sqrt(1 + 8 * min(1.0, a + b) ** 2))
    smooth = (tilt * b / r**2 + 2 * (shift + math.sqrt(spread * fanned)) / r**3
              + (0.5 * bend * spread + uneven) / r**4)
    return min(whole, max(smooth, total * max(kink_a, kink_b) / square))


def cut(clusters, receiver, share):
    """Refine from the highest clusters until the bounds S allow it: S <= share (E - S); return sum and nodes.

    `clusters` is a tree: (lights, children), without children for one light.
    """
    front = list(clusters)
    while True:
        bounds = [bound(lights, receiver) if children else 0.0 for lights, children in front]
        sums = [irradiance([representative(lights)] if children else lights, receiver) for lights, children in front]
        found = [math.fsum(s[c] for s in sums) for c in range(3)]
        total = math.fsum(bounds)
        if total <= share * sum(found) / (1 + share) or not any(children for _, children in front):
            return found, len(front)
        worst = max(range(len(front)), key=bounds.__getitem__)
        front[worst : worst + 1] = front[worst][1]
