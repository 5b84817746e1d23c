"""What ports get wrong in the list of pixel lights (SII Sec. 3.1): its literal form, texel by texel."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from refgi.vectors.spec import Array, Arrays, Bug, Run

OWN, WEIGHT = "each light has its own map's texel", "Phi_i = T/N w Phi_t"
FLUX = "texels without flux are dropped, all others are lights"
FLUXES = ("flux", "lobe_flux")


def lights_bugs(kinds: list[str], shapes: list[tuple[int, int, int]], warped: bool) -> Iterator[Bug]:
    """Yield likely bugs of the list of pixel lights.

    Parameters
    ----------
    kinds : list of str
        What lights have: position, normal, flux and lobes.
    shapes : list of tuple
        Maps, rows and columns of one, of each light's maps.
    warped : bool
        Whether weights differ within a map.
    """
    def literal(**bugs: Any) -> Run:
        return lambda arrays, _: literal_lights(arrays, kinds, shapes, **bugs)

    glossy, many = "lobe_flux" in kinds, len(shapes) > 1
    for cause, keep in (
            ("texels without flux (zero flux, dark) become pixel lights as well, they are not dropped", "all"),
            ("texels that are drawn twice become one light", "once"),
            ("the last light is left out", "not last"), ("the first light is left out", "not first"),
            *((("texels are dropped that have a lobe alone: lobe flux is not looked at", "diffuse"),
               ("texels are dropped that have no lobe: diffuse flux is not looked at", "lobe")) if glossy else ()),
            *((("only the first map's lights are listed: number of lights of one map", "first map"),
               ("the last map's lights are missing", "not last map")) if many else ())):
        yield Bug(cause, literal(keep=keep), FLUX)
    for cause, factor in (("T/N is left out", 0), ("T/N is counted twice", 2), ("N/T in place of T/N", -1)):
        yield Bug(cause, literal(power=factor), WEIGHT)
    yield Bug("positions are multiplied by T/N as well", literal(weighed=(*FLUXES, "position")), WEIGHT)
    if warped:
        yield Bug("the weight of the first light for all of a map", literal(weight_of="first"), WEIGHT)
        yield Bug("weights of lights belong to others: dropped points do not count in the index of weights",
                  literal(weight_of="packed"), WEIGHT)
        yield Bug("weights are read by the texel, not by the point", literal(weight_of="texel"), WEIGHT)
    if many:
        yield Bug("the first map's T/N for all maps", literal(weight_of="first map"), WEIGHT)
        yield Bug("T/N of all maps together", literal(power=1, share=1 / len(shapes)), "each map's own T/N")
        yield Bug("T/N is multiplied by the number of maps", literal(share=len(shapes)), "each map's own T/N")
        yield Bug("all lights read the first map's texels", literal(map_of="first"), OWN)
        yield Bug("all lights read the last map's texels", literal(map_of="last"), OWN)
        yield Bug("maps are listed in reverse order", literal(order="maps"), OWN)
        yield Bug("maps take turns in the list of lights", literal(order="turns"), OWN)
        yield Bug("every light's map is 0", literal(map_number="zero"), OWN)
        yield Bug("maps are counted from the last", literal(map_number="last"), OWN)
        yield Bug("texels count on over the maps of all lights", literal(texel_number="all"), OWN)
    if any(maps > 1 for maps, _, _ in shapes):
        yield Bug("texels count within one face of a cube, not over its stacked maps", literal(texel_number="face"),
                  OWN)
        yield Bug("the first face of a cube is read for all of its faces", literal(read="face"), OWN)
    for cause, read in (("rows and columns of texels are exchanged", "transposed"),
                        ("the map is read upside down", "upwards"), ("the map is mirrored", "leftwards"),
                        ("the next texel is read, one to the right", "next"),
                        ("the texel before is read, one to the left", "before"),
                        ("all lights read the first light's texel", "first"),
                        ("components lie beside each other (h, w, 3), not in planes (3, h, w)", "interleaved")):
        yield Bug(cause, literal(read=read), OWN)
    yield Bug("lights are sorted by their texels", literal(order="texels"), "order of the points")
    yield Bug("lights are listed in reverse order", literal(order="reverse"), "order of the points")
    yield Bug("normals point into the surface", literal(normal="turned"), "normals face the light")
    yield Bug("positions are moved by 1 cm along the normal (bias)", literal(bias=0.01), "the texel's position")
    yield Bug("positions are moved by 1 mm along the normal (bias)", literal(bias=0.001), "the texel's position")
    if glossy:
        yield from (Bug(cause, literal(**knobs), paper) for cause, knobs, paper in (
            ("lobes keep the texel's flux: T/N is missing for the lobe flux", {"weighed": ("flux",)}, WEIGHT),
            ("the diffuse flux keeps the texel's: T/N is missing for it, lobes have it", {"weighed": ("lobe_flux",)},
             WEIGHT),
            ("exponents of lobes are multiplied by T/N as well", {"weighed": (*FLUXES, "lobe_exponent")}, WEIGHT),
            ("axes of lobes are multiplied by T/N as well", {"weighed": (*FLUXES, "lobe_axis")}, WEIGHT),
            ("the axis of the lobe is the normal", {"axis": "normal"}, "SII Eq. 3"),
            ("the axis of the lobe is turned round", {"axis": "turned"}, "SII Eq. 3"),
            ("the lobe flux is added to the diffuse flux as well", {"flux": "sum"}, "SII Eq. 3"),
            ("the lobe flux is subtracted from the diffuse flux", {"flux": "rest"}, "SII Eq. 3"),
            ("the lobe flux holds the diffuse flux", {"flux": "same"}, "SII Eq. 3"),
            ("diffuse flux and lobe flux are exchanged", {"flux": "exchanged"}, "SII Eq. 3"),
            ("lobes are left out: their flux is 0", {"flux": "diffuse"}, "SII Eq. 3"),
            ("the diffuse flux is left out: it is 0", {"flux": "lobe"}, "SII Eq. 3"),
            ("the first light's exponent for all lobes", {"exponent": "first"}, "SII Eq. 3")))


def literal_lights(
    arrays: Arrays, kinds: list[str], shapes: list[tuple[int, int, int]], *, keep: str = "flux", power: int = 1,
    share: float = 1.0, weight_of: str = "", map_of: str = "", map_number: str = "", texel_number: str = "",
    read: str = "", order: str = "", weighed: tuple[str, ...] = FLUXES, normal: str = "", bias: float = 0.0,
    axis: str = "", flux: str = "", exponent: str = "",
) -> dict[str, Array]:
    """Return the arrays of the lights, with bugs."""
    points = _listed(arrays, kinds, len(shapes), keep, order)
    maps, texels, _ = points.T if len(points) else np.zeros((3, 0), np.int64)
    used = {"first": np.zeros_like(maps), "last": np.full_like(maps, len(shapes) - 1)}.get(map_of, maps)
    made = {kind: np.zeros((*_channels(kind), len(maps))) for kind in kinds}
    for k, (number, texel) in enumerate(zip(used, texels, strict=True)):
        weight = (_weight(arrays, points, k, weight_of) * share) ** power
        at = _texel(int(texels[0] if read == "first" else texel), shapes[number], read)
        for kind in kinds:
            plane = np.asarray(arrays[f"rsm{number}.{kind}"], np.float64)
            channels = 3 if plane.ndim == 3 else 1
            flat = plane.reshape(-1, channels).T if read == "interleaved" else plane.reshape(channels, -1)
            made[kind][..., k] = flat[:, at % flat.shape[1]].reshape(_channels(kind)) * (
                weight if kind in weighed else 1.0)
    if bias:
        made["position"] += bias * made["normal"]
    made["normal"] *= -1 if normal == "turned" else 1
    _change_lobes(made, axis, flux, exponent)
    number_of = {"zero": 0 * maps, "last": len(shapes) - 1 - maps}.get(map_number, maps)
    begins = np.cumsum([0, *(count * rows * columns for count, rows, columns in shapes)])
    sizes = np.array([rows * columns for _, rows, columns in shapes])
    listed = {"all": texels + begins[maps], "face": texels % sizes[maps]}.get(texel_number, texels)
    return {**{f"lights.{kind}": array for kind, array in made.items()}, "lights.texel": listed,
            "lights.map": number_of}


def _channels(kind: str) -> tuple[int, ...]:
    return () if kind == "lobe_exponent" else (3,)


def _listed(arrays: Arrays, kinds: list[str], count: int, keep: str, order: str) -> Array:
    """Return map, texel and place among the map's points of every light, (n, 3)."""
    found = []
    for number in range(count):
        names = [kind for kind in FLUXES if kind in kinds]
        names = {"diffuse": ["flux"], "lobe": ["lobe_flux"]}.get(keep, names)
        sent = np.sum([arrays[f"rsm{number}.{kind}"] for kind in names], axis=0).reshape(3, -1)
        sends = sent[0] >= 0 if keep == "all" else sent.max(axis=0) > 0
        seen = set()
        for place, texel in enumerate(np.asarray(arrays[f"rsm{number}.texel"]).tolist()):
            if sends[texel] and not (keep == "once" and texel in seen):
                found.append((number, texel, place))
            seen.add(texel)
    found = {"not last": found[:-1], "not first": found[1:]}.get(keep, found)
    last = {"first map": 1, "not last map": count - 1}.get(keep, count)
    found = [one for one in found if one[0] < last]
    if order:
        found.sort(key=lambda one: {"maps": (-one[0], one[2]), "turns": (one[2], one[0]), "reverse": (0, 0)}.get(
            order, (one[0], one[1])))
        found = found[::-1] if order == "reverse" else found
    return np.array(found, np.int64).reshape(-1, 3)


def _weight(arrays: Arrays, points: Array, k: int, weight_of: str) -> float:
    number, texel, place = points[k]
    own = np.asarray(arrays[f"rsm{number}.weight"])
    packed = int(np.count_nonzero(points[:k, 0] == number))
    place = {"first": 0, "packed": packed, "texel": texel % len(own)}.get(weight_of, place)
    return float(arrays["rsm0.weight"][0] if weight_of == "first map" else own[place])


def _texel(texel: int, shape: tuple[int, int, int], read: str) -> int:
    maps, rows, columns = shape
    row, column = divmod(texel, columns)
    rows_of_all = maps * rows
    return {"transposed": column * rows_of_all + row, "upwards": (rows_of_all - 1 - row) * columns + column,
            "leftwards": row * columns + columns - 1 - column, "next": texel + 1, "before": texel - 1,
            "face": row % rows * columns + column}.get(read, texel)


def _change_lobes(made: dict[str, Array], axis: str, flux: str, exponent: str) -> None:
    if axis:
        made["lobe_axis"] = made["normal"].copy() if axis == "normal" else -made["lobe_axis"]
    if flux:
        diffuse, lobe = made["flux"], made["lobe_flux"]
        made["flux"], made["lobe_flux"] = {
            "sum": (diffuse + lobe, lobe), "rest": (diffuse - lobe, lobe), "same": (diffuse, diffuse),
            "exchanged": (lobe, diffuse), "diffuse": (diffuse, 0 * lobe), "lobe": (0 * diffuse, lobe)}[flux]
    if exponent:
        made["lobe_exponent"] = np.full_like(made["lobe_exponent"], made["lobe_exponent"][:1].sum())
