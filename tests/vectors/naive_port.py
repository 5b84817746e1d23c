"""The first port: what a kit's stages give by the literal twins, texel by texel, in float64."""

import math

import numpy as np

from tests.naive import eq2, raster, warp
from tests.naive.pixel_lights import grid_texels, mirror, radical_inverse

RAYS = {"perspective": raster.perspective_ray, "orthographic": raster.orthographic_ray}


class NaivePort:
    """Functions named after stages; each takes the arrays that the stage reads, and returns those that it writes."""

    def __init__(self, case):
        self.case = case

    def run(self, stage, arrays):
        """Return what a stage writes, or None where no twin covers it."""
        name, _, step = stage.partition(".")
        index = name.lstrip("gbufersm")
        function = getattr(self, step or name, None)
        if stage.startswith(("rsm", "gbuffer")):
            return function(name, index, arrays) if function else None
        return function(arrays) if function else None

    def rays(self, name, arrays):
        """Yield row, column, ray of each texel of the stacked maps."""
        view = "camera" if name == "gbuffer" else name
        facts = self.case.facts[view]
        for m in range(facts["maps"]):
            for row in range(facts["rows"]):
                for column in range(facts["columns"]):
                    ray = RAYS[facts["projection"]](arrays[f"{view}.origin"][m], arrays[f"{view}.frame"][m],
                                                    arrays[f"{view}.half"], facts["rows"], facts["columns"], row,
                                                    column)
                    yield m, m * facts["rows"] + row, column, ray

    def ids(self, name, _, arrays):
        faces = arrays["scene.faces"]
        ids = np.full(self.case.arrays[f"{name}.triangle_id"].shape, -1)
        for _, row, column, (origin, direction) in self.rays(name, arrays):
            ids[row, column] = raster.nearest(origin, direction, arrays["scene.vertices"], faces)[0]
        return {f"{name}.triangle_id": ids}

    def surface(self, name, _, arrays):
        faces, vertices = arrays["scene.faces"], arrays["scene.vertices"]
        out = {key: np.zeros(self.case.arrays[key].shape) for key in self.written(f"{name}.surface")}
        out[f"{name}.depth"][:] = np.inf
        for m, row, column, (origin, direction) in self.rays(name, arrays):
            k = arrays[f"{name}.triangle_id"][row, column]
            if k < 0:
                continue
            _, t, weights, _ = raster.nearest(origin, direction, vertices, faces[k : k + 1])
            if not math.isfinite(t):  # the centre lies on an edge
                return None
            normals = arrays.get("scene.vertex_normals")
            position, normal, _ = raster.attributes(direction, (0, t, weights, 0), vertices, faces[k : k + 1], normals)
            view = "camera" if name == "gbuffer" else name
            ahead = (position - arrays[f"{view}.origin"][m]) @ arrays[f"{view}.frame"][m, 2]
            out[f"{name}.depth"][row, column] = ahead
            out[f"{name}.position"][:, row, column], out[f"{name}.normal"][:, row, column] = position, normal
            if name == "gbuffer":
                material = arrays["scene.material_of_face"][k]
                out["gbuffer.albedo"][:, row, column] = arrays["materials.diffuse"][material]
        return out

    def flux(self, name, index, arrays):
        """Cube and directional maps; a spot's falloff has no quick twin."""
        facts, half = self.case.facts[name], arrays[f"{name}.half"]
        light = f"light{index}"
        if self.case.facts[light] == "spot":
            return None
        flat = facts["projection"] == "orthographic"
        size = 2 * half / (facts["columns"], facts["rows"])
        out = {key: np.zeros(self.case.arrays[key].shape) for key in self.written(f"{name}.flux")}
        power = arrays[f"{light}.irradiance" if flat else f"{light}.intensity"]
        for _, row, column, (_, direction) in self.rays(name, arrays):
            x0, y0 = -half[0] + column * size[0], -half[1] + row % facts["rows"] * size[1]
            angle = size[0] * size[1] if flat else raster.solid_angle(
                raster.perspective_density, x0, x0 + size[0], y0, y0 + size[1], n=8)
            out[f"{name}.solid_angle"][row, column] = angle
            k = arrays[f"{name}.triangle_id"][row, column]
            if k < 0:
                continue
            material, here = arrays["scene.material_of_face"][k], (slice(None), row, column)
            out[f"{name}.flux"][here] = arrays["materials.diffuse"][material] * power * angle
            specular = arrays["materials.specular"][material]
            if specular.any():
                normal = self.normal(arrays, k, direction)
                out[f"{name}.lobe_flux"][here] = specular * power * angle
                out[f"{name}.lobe_axis"][here] = mirror(direction / np.linalg.norm(direction), normal)
                out[f"{name}.lobe_exponent"][row, column] = arrays["materials.exponent"][material]
        return out

    @staticmethod
    def normal(arrays, k, direction):
        a, b, c = arrays["scene.vertices"][arrays["scene.faces"][k]]
        normal = np.cross(b - a, c - a)
        return normal / np.linalg.norm(normal) * (1 if normal @ direction < 0 else -1)

    def points(self, name, _, arrays):
        count = self.case.arrays[f"{name}.points"].shape[0]
        if self.case.facts[f"{name}.points"] == "grid":
            n = math.isqrt(count)
            return {f"{name}.points": [((i + 0.5) / n, (j + 0.5) / n) for j in range(n) for i in range(n)]}
        shift = arrays.get(f"{name}.shift", (0, 0))
        return {f"{name}.points": [((radical_inverse(k, 2) + shift[0]) % 1, (radical_inverse(k, 3) + shift[1]) % 1)
                                   for k in range(count)]}

    def importance(self, name, _, arrays):
        flux = arrays[f"{name}.flux"] + arrays.get(f"{name}.lobe_flux", 0)
        return {f"{name}.importance": flux.max(axis=0)}

    def warp(self, name, _, arrays):
        how, worth = self.case.facts[f"{name}.warp"], arrays[f"{name}.importance"]
        if worth.shape[0] != worth.shape[1] or worth.shape[0] & (worth.shape[0] - 1):
            return None  # the twin knows one square map of a power of two
        sums = warp.pyramid(worth)
        found = [warp.warp(u, v, sums, how["levels"], how["method"]) for u, v in arrays[f"{name}.points"]]
        return {f"{name}.warped": [one[:2] for one in found], f"{name}.density_weight": [one[2] for one in found]}

    def texels(self, name, _, arrays):
        (points,) = [arrays[key] for key in (f"{name}.warped", f"{name}.points") if key in arrays]
        rows, columns = self.case.arrays[f"{name}.texel"].index_of
        weight = arrays.get(f"{name}.density_weight", np.ones(len(points)))
        if self.case.facts[f"{name}.points"] == "grid":
            n = math.isqrt(len(points))
            texel = [row * columns + column for row, column in grid_texels(n, rows, columns)]
        else:
            texel = [math.floor(v * rows) * columns + math.floor(u * columns) for u, v in points]
        return {f"{name}.texel": texel, f"{name}.weight": rows * columns / len(points) * weight}

    def lights(self, arrays):
        out = {name: [] for name in self.written("lights")}
        for m in range(sum(key.endswith(".texel") and key.startswith("rsm") for key in arrays)):
            for texel, weight in zip(arrays[f"rsm{m}.texel"], arrays[f"rsm{m}.weight"], strict=True):
                here = {key: arrays[f"rsm{m}.{key}"].reshape(-1, arrays[f"rsm{m}.triangle_id"].size)[:, texel]
                        for key in (name.removeprefix("lights.") for name in out) if f"rsm{m}.{key}" in arrays
                        and key != "texel"}
                if not (here["flux"].any() or here.get("lobe_flux", np.zeros(3)).any()):
                    continue
                for key, value in here.items():
                    factor = weight if key in ("flux", "lobe_flux") else 1
                    out[f"lights.{key}"].append(factor * (value[0] if key == "lobe_exponent" else value))
                out["lights.texel"].append(texel)
                out["lights.map"].append(m)
        return {name: np.array(rows).T for name, rows in out.items()}

    def footprints(self, arrays):
        areas = []
        for k, (m, texel) in enumerate(zip(arrays["lights.map"], arrays["lights.texel"], strict=True)):
            place = list(arrays[f"rsm{m}.texel"]).index(texel)
            away = arrays[f"light{m}.position"] - arrays["lights.position"][:, k]
            cosine = abs(away @ arrays["lights.normal"][:, k]) / np.linalg.norm(away)
            areas.append(arrays[f"rsm{m}.solid_angle"].reshape(-1)[texel] * arrays[f"rsm{m}.weight"][place]
                         * (away @ away) / cosine)
        return {"lights.area": areas}

    def sum(self, arrays):
        shape = self.case.arrays["sum.irradiance"].shape
        total = np.zeros(shape)
        for row, column in np.argwhere(arrays["gbuffer.triangle_id"] >= 0):
            x, n = arrays["gbuffer.position"][:, row, column], arrays["gbuffer.normal"][:, row, column]
            for k in range(arrays["lights.flux"].shape[1]):
                total[:, row, column] += self.pair(arrays, x, n, k)
        return {"sum.irradiance": total}

    def pairs(self, arrays):
        count = arrays["lights.flux"].shape[1]
        total = [self.pair(arrays, arrays["gbuffer.position"][:, 0, k], arrays["gbuffer.normal"][:, 0, k], k)
                 for k in range(count)]
        return {"pairs.irradiance": np.array(total).T[:, None]}

    @staticmethod
    def pair(arrays, x, n, k):
        p, normal = arrays["lights.position"][:, k], arrays["lights.normal"][:, k]
        area = arrays["lights.area"][k] if "lights.area" in arrays else 0.0
        light = eq2.clamped_pair(x, n, p, normal, arrays["lights.flux"][:, k], area=area)
        if "lights.lobe_flux" in arrays and arrays["lights.lobe_flux"][:, k].any():
            lobe = eq2.lobe_pair(x, n, p, normal, arrays["lights.lobe_axis"][:, k], arrays["lights.lobe_exponent"][k],
                                 arrays["lights.lobe_flux"][:, k])
            r = np.linalg.norm(x - p)
            light = light + lobe * (r**2 / (r**2 + area / math.pi) if area else 1.0)
        return light

    def written(self, stage):
        """Return the names of the arrays that a stage writes."""
        return next(one.writes for one in self.case.stages if one.name == stage)
