"""The first port: what a kit's stages give by the literal text and twins of buffers, in float64."""

import math

import numpy as np

from refgi.literal import lights, pairs
from refgi.literal.warp import warp
from refgi.vectors.stages.lights import LIGHT, LOBE
from tests.naive import raster
from tests.naive.pixel_lights import mirror

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
            return {f"{name}.points": lights.grid_points(math.isqrt(count))}
        shift = np.array(arrays.get(f"{name}.shift", (0, 0)))
        return {f"{name}.points": lights.halton_points([count], shift[None], 0)}

    def importance(self, name, _, arrays):
        return {f"{name}.importance": lights.importance(arrays[f"{name}.flux"], arrays.get(f"{name}.lobe_flux"))}

    def warp(self, name, _, arrays):
        points, weight = warp(arrays[f"{name}.points"], arrays[f"{name}.importance"], self.case.facts[name]["maps"],
                              **self.case.facts[f"{name}.warp"])
        return {f"{name}.warped": points, f"{name}.density_weight": weight}

    def texels(self, name, _, arrays):
        (points,) = [arrays[key] for key in (f"{name}.warped", f"{name}.points") if key in arrays]
        rows, columns = self.case.arrays[f"{name}.texel"].index_of
        texel, weight = lights.texels(points, [len(points)], 0, 1, rows, columns,
                                      arrays.get(f"{name}.density_weight", 1.0))
        return {f"{name}.texel": texel, f"{name}.weight": weight}

    def lights(self, arrays):
        maps = sum(key.endswith(".texel") and key.startswith("rsm") for key in arrays)
        kinds = [key for key in ("texel", "weight", *LIGHT, *LOBE) if f"rsm0.{key}" in arrays]
        names = [f"lights.{key}" for key in (*kinds[2:], "texel", "map")]
        return dict(zip(names, lights.pixel_lights(*([arrays[f"rsm{m}.{key}"] for m in range(maps)] for key in kinds)),
                        strict=True))

    def footprints(self, arrays):
        maps = range(1 + arrays["lights.map"].max())
        near = [f"light{m}.position" in arrays for m in maps]
        lamp = [arrays[f"light{m}.{'position' if near[m] else 'direction'}"] for m in maps]
        own = ([arrays[f"rsm{m}.{key}"] for m in maps] for key in ("solid_angle", "texel", "weight"))
        return {"lights.area": lights.footprints(
            *(arrays[f"lights.{key}"] for key in ("position", "normal", "texel", "map")), *own, lamp, near)}

    def sum(self, arrays):
        seen = (arrays[f"gbuffer.{key}"] for key in ("position", "normal", "triangle_id"))
        own = (arrays.get(f"lights.{key}") for key in (*LIGHT, *LOBE, "area"))
        return {"sum.irradiance": pairs.irradiance(*seen, *own)}

    def pairs(self, arrays):
        own = (arrays.get(f"lights.{key}") for key in (*LIGHT, *LOBE))
        return {"pairs.irradiance": pairs.pairs(arrays["gbuffer.position"], arrays["gbuffer.normal"], *own)}

    def written(self, stage):
        """Return the names of the arrays that a stage writes."""
        return next(one.writes for one in self.case.stages if one.name == stage)
