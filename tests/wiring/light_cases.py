"""Cases of all settings of pixel lights, which every method that has some takes over."""

import dataclasses
from collections.abc import Mapping

from tests.wiring.cases import Case

# 14, 13 and 13 of three lamps, which the grid rounds to 16, 6 (one on each face) and 16
BASE = {"count": 40}
LONG_RAYS = {"openness.radius": 1.0}  # the default's leave most lights open
WARP_A, WARP_B = ({"source.warp": name, "source.warp.levels": 4} for name in "AB")


def under(key: str, cases: Mapping[str, Case]) -> dict[str, Case]:
    """Return cases whose keys lie below another key: those of the part of a tree as those of the tree."""
    def below(values: Mapping[str, object]) -> dict[str, object]:
        return {f"{key}.{name}": value for name, value in values.items()}

    return {name: dataclasses.replace(case, values=below(case.values), over=below(case.over))
            for name, case in cases.items()}


LIGHT_CASES = {
    "more lights": Case({"count": 100}),
    "another seed": Case({"seed": 7}),
    "a grid": Case({"source.pattern": "grid"}),
    "every texel": Case({"source.pattern": "all"}),
    "random texels": Case({"source.pattern": "random"}),
    "random texels by another seed": Case({"seed": 3}, {"source.pattern": "random"}),
    "cells of a grid": Case({"source.filtered": True}, {"source.pattern": "grid", "count": 60}),
    "nearest texels": Case({"source.filtered": True}),
    "nearest texels of a warped pattern": Case({"source.filtered": True}, WARP_A),
    "nearest texels of a warped grid": Case({"source.filtered": True}, {**WARP_A, "source.pattern": "grid"}),
    "warp A": Case({"source.warp": "A"}),
    "warp B": Case({"source.warp": "B"}),
    "a warped grid": Case({"source.warp": "A"}, {"source.pattern": "grid"}),
    "a level of A": Case({"source.warp.levels": 1}, {"source.warp": "A"}),
    "levels of B": Case({"source.warp.levels": 5}, {"source.warp": "B"}),
    "peaks by A": Case({"source.warp.importance": "peak"}, WARP_A),
    "peaks by B": Case({"source.warp.importance": "peak"}, WARP_B),
    "printed peaks by A": Case({"source.as_published": frozenset({"sii_peak"})},
                               {**WARP_A, "source.warp.importance": "peak"}),
    "printed peaks by B, in the open": Case({"source.as_published": frozenset({"sii_peak"})},
                                            {**WARP_B, "source.warp.importance": "openness"}),
    "openness by A": Case({"source.warp.importance": "openness"}, WARP_A),
    "openness by B": Case({"source.warp.importance": "openness"}, WARP_B),
    "an even part of A": Case({"source.warp.defensive": 0.4}, WARP_A),
    "an even part of B": Case({"source.warp.defensive": 0.4}, WARP_B),
    "weights of A made to sum to N": Case({"source.warp.renormalise_weights": True}, WARP_A),
    "weights of B made to sum to N": Case({"source.warp.renormalise_weights": True}, WARP_B),
    "no refraction": Case({"source.refraction": None}, {"count": 200}, scene="glass"),
    "both interfaces of painted glass": Case({"source.refraction": "two_interface"}, {"count": 200},
                                             scene="painted glass"),
    "both interfaces": Case({"source.refraction": "two_interface"}, {"count": 200}, scene="glass"),
    "blunt lobes of backs": Case({"source.refraction.exponent": 40.0}, {"count": 200}, scene="smooth glass"),
    "blunt lobes of both": Case({"source.refraction.exponent": 40.0},
                                {"count": 200, "source.refraction": "two_interface"}, scene="smooth glass"),
    "without T/N": Case({"source.as_published": frozenset({"sii_no_tn"})}),
    "cells without T/N": Case({"source.as_published": frozenset({"sii_no_tn"})}, {"source.filtered": True}),
    "equal solid angles": Case({"source.as_published": frozenset({"equal_solid_angle"})}),
    "equal solid angles behind glass": Case({"source.as_published": frozenset({"equal_solid_angle"})}, {"count": 200},
                                            scene="glass"),
    "equal solid angles behind both interfaces": Case(
        {"source.as_published": frozenset({"equal_solid_angle"})},
        {"count": 200, "source.refraction": "two_interface"}, scene="glass"),
    "cells behind glass": Case({"source.filtered": True}, {"count": 200}, scene="glass"),
    "peaks behind glass": Case({"source.warp.importance": "peak"}, WARP_A, scene="glass"),
    "light paths": Case({"source": "walk"}),
    "three bounces": Case({"source.bounces": 3}, {"source": "walk"}),
    "shifted paths": Case({"seed": 5}, {"source": "walk", "source.bounces": 2}),
    "scaled flux": Case({"openness.flux": "scale"}, {"count": 200}),
    "flux scaled as printed": Case({"openness.as_published": frozenset({"sii_openness"})},
                                   {**LONG_RAYS, "openness.flux": "scale", "count": 200}),
    "scaled paths": Case({"openness.flux": "scale"}, {"source": "walk", "source.bounces": 2}),
    "roulette": Case({"openness.flux": "roulette"}, {**LONG_RAYS, "count": 200}),
    "roulette by another seed": Case({"seed": 2}, {**LONG_RAYS, "count": 200, "openness.flux": "roulette"}),
    "roulette of paths": Case({"openness.flux": "roulette"}, {**LONG_RAYS, "source": "walk"}),
    "long rays": Case({"openness.radius": 1.0}, {"openness.flux": "scale"}),
    "rays by another seed": Case({"seed": 2}, {**LONG_RAYS, "openness.flux": "scale", "source.pattern": "grid"}),
    "rays of importance by another seed": Case({"seed": 2}, {**WARP_A, **LONG_RAYS, "source.pattern": "grid",
                                                             "source.warp.importance": "openness"}),
    "few rays": Case({"openness.rays": 5}, {**LONG_RAYS, "openness.flux": "scale"}),
    "few rays of importance": Case({"openness.rays": 5},
                                   {**WARP_A, **LONG_RAYS, "source.warp.importance": "openness"}),
    "long rays of importance": Case({"openness.radius": 1.0}, {**WARP_A, "source.warp.importance": "openness"}),
    "a higher floor": Case({"openness.floor": 0.6}, {**LONG_RAYS, "openness.flux": "roulette"}),
    "scaled flux behind glass": Case({"openness.flux": "scale"}, {**LONG_RAYS, "count": 200}, scene="glass"),
    "scaled flux of a smooth ball": Case({"openness.flux": "scale"}, {**LONG_RAYS, "count": 200}, scene="smooth"),
    "a smooth ball": Case({"count": 200}, scene="smooth"),
    "light paths on a smooth ball": Case({"source.bounces": 3}, {"source": "walk", "count": 100, "seed": 4},
                                         scene="smooth"),
    "light paths to glass": Case({"source.bounces": 2}, {"source": "walk", "count": 100}, scene="painted glass"),
    "a higher floor of importance": Case({"openness.floor": 0.6}, {**WARP_A, "source.warp.importance": "openness"}),
}
