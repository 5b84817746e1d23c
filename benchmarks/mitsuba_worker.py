"""One-bounce irradiance of refgi's receivers by Mitsuba 3: a process of its own, in an environment that has Mitsuba.

Started as `python mitsuba_worker.py SCENE.npz`, it reads lines `METHOD SAMPLES SEED OUT.npy`, writes the irradiance
(3, n) and answers with seconds. The first call of each method and size compiles and is not timed. Methods:

- "cosine": cosine-distributed directions at the receiver, next-event estimation by refgi's formula where they hit.
- "sobol": the same with a scrambled (0, 2)-sequence in place of independent numbers.
- "light": rays of the lamps, connected to the receiver. Unbounded variance where a sender is near.
- "path": directions as "cosine", their radiance by Mitsuba's own `path` integrator and BSDFs; diffuse scenes alone.
"""

import math
import sys
import time

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
SPOT, POINT, DIRECTIONAL = 0, 1, 2  # kinds of lamps, as refgi numbers them
RAYS = 1 << 21  # in one launch


def main(place):
    given = dict(np.load(place))
    shapes, lookup = scene_of(given)
    receivers = {key: mi.Vector3f(given[key].astype(np.float32)) for key in ("origin", "normal", "facing")}
    warm = set()
    print(f"mitsuba {mi.__version__}, {dr.thread_count()} threads", flush=True)
    for line in sys.stdin:
        method, samples, seed, out = line.split()
        run = (shapes, lookup, receivers, given, method, int(samples))
        if (method, samples) not in warm:
            irradiance(*run, int(seed) + 1)
            warm.add((method, samples))
        started = time.perf_counter()
        found = irradiance(*run, int(seed))
        seconds = time.perf_counter() - started
        np.save(out, found)
        print(seconds, flush=True)


def scene_of(given):
    """Return the scene with all faces as one mesh, and the tables of materials."""
    smooth = len(given["vertex_normals"]) > 0
    mesh = mi.Mesh("all", len(given["vertices"]), len(given["faces"]), has_vertex_normals=smooth)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = given["vertices"].astype(np.float32).ravel()
    parameters["faces"] = given["faces"].astype(np.uint32).ravel()
    if smooth:
        parameters["vertex_normals"] = given["vertex_normals"].astype(np.float32).ravel()
    parameters.update()
    lookup = {"material": mi.UInt32(given["material_of_face"].astype(np.uint32)),
              "exponent": mi.Float(given["exponent"].astype(np.float32)),
              "share": mi.Float(given["share"].astype(np.float32).ravel()), "rows": given["share"].shape[1]}
    for key in ("diffuse", "specular"):
        lookup[key] = mi.Float(given[key].astype(np.float32).ravel())
    described = {"type": "scene", "all": mesh}
    return (mi.load_dict(described), _with_lamps(given) if "path" in given["methods"] else None), lookup


def _with_lamps(given):
    """Return a scene of Mitsuba's own BSDFs and emitters, and the integrator that looks at it."""
    described = {"type": "scene"}
    for m in range(len(given["diffuse"])):
        chosen = given["faces"][given["material_of_face"] == m]
        if not len(chosen):
            continue
        smooth = len(given["vertex_normals"]) > 0
        colour = {"type": "rgb", "value": given["diffuse"][m].tolist()}
        bsdf = mi.load_dict({"type": "twosided", "inner": {"type": "diffuse", "reflectance": colour}})
        held = mi.Properties()
        held["bsdf"] = bsdf
        mesh = mi.Mesh(f"m{m}", len(given["vertices"]), len(chosen), has_vertex_normals=smooth, props=held)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = given["vertices"].astype(np.float32).ravel()
        parameters["faces"] = chosen.astype(np.uint32).ravel()
        if smooth:
            parameters["vertex_normals"] = given["vertex_normals"].astype(np.float32).ravel()
        parameters.update()
        described[f"m{m}"] = mesh
    for k, kind in enumerate(given["kind"]):
        if kind != POINT:
            raise ValueError("Mitsuba's own lamps: points alone, a spot's falloff is another")
        described[f"lamp{k}"] = {"type": "point", "position": given["position"][k].tolist(),
                                 "intensity": {"type": "rgb", "value": given["intensity"][k].tolist()}}
    return mi.load_dict(described), mi.load_dict({"type": "path", "max_depth": 2, "rr_depth": 1000})


def irradiance(shapes, lookup, receivers, given, method, samples, seed):
    """Return the mean (3, n) of `samples` samples of each receiver."""
    count = given["origin"].shape[1]
    a_launch = max(1, min(samples, RAYS // count))
    total, done = np.zeros((3, count)), 0
    while done < samples:
        now = min(a_launch, samples - done)
        index = dr.arange(mi.UInt32, count * now)
        which, number = index // now, index % now + dr.opaque(mi.UInt32, done)  # a literal would compile anew
        x, n, facing = (dr.gather(mi.Vector3f, receivers[key], which) for key in ("origin", "normal", "facing"))
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed * 7919 + done, count * now)
        if method == "light":
            value = _from_lamps(shapes[0], lookup, given, sampler, x, n, facing)
        else:
            u = mi.Point2f(sampler.next_1d(), sampler.next_1d())
            if method == "sobol":
                salt = mi.sample_tea_32(which, dr.opaque(mi.UInt32, seed))
                u = mi.Point2f(mi.radical_inverse_2(number, salt[0]), mi.sobol_2(number, salt[1]))
            value = _from_receivers(shapes, lookup, given, sampler, x, n, facing, u, method == "path")
        sums = [dr.block_sum(channel, now) for channel in value]
        dr.eval(sums)
        total += np.array(sums)
        done += now
    return total / samples


def _from_receivers(shapes, lookup, given, sampler, x, n, facing, u, by_integrator):
    """Return pi L (w) of one cosine-distributed direction w of each receiver."""
    w = mi.Frame3f(n).to_world(mi.warp.square_to_cosine_hemisphere(u))
    counts = dr.dot(w, facing) > 0
    if by_integrator:
        scene, integrator = shapes[1]
        ray = mi.RayDifferential3f(mi.Ray3f(x, w))
        radiance = integrator.sample(scene, sampler, ray, active=counts)[0]
        return dr.select(counts, radiance * math.pi, 0)
    hit = shapes[0].ray_intersect(mi.Ray3f(x, w), counts)
    total = mi.Color3f(0)
    for k in range(len(given["kind"])):
        toward, distance, strength = _incident(given, k, hit.p)
        cosine = dr.dot(hit.n, toward)
        g, cosine = dr.select(cosine < 0, -hit.n, hit.n), dr.abs(cosine)
        leaves = counts & hit.is_valid() & (dr.dot(g, w) < 0)
        shadow = hit.spawn_ray(toward)
        shadow.maxt = distance * (1 - 1e-5)
        lit = leaves & ~shapes[0].ray_test(shadow, leaves)
        pattern = _pattern(lookup, hit, g, toward, -w)
        total += dr.select(lit, pattern * strength * (cosine * math.pi / dr.maximum(-dr.dot(g, w), 1e-12)), 0)
    return total


def _from_lamps(scene, lookup, given, sampler, x, n, facing):
    """Return what receivers get of one even ray of each lamp."""
    total = mi.Color3f(0)
    for k in range(len(given["kind"])):
        u = mi.Point2f(sampler.next_1d(), sampler.next_1d())
        axis = mi.Vector3f(given["direction"][k].tolist())
        if given["kind"][k] == DIRECTIONAL:
            disc = mi.warp.square_to_uniform_disk_concentric(u) * float(given["radius"])
            start = mi.Point3f(given["middle"].tolist()) + mi.Frame3f(axis).to_world(
                mi.Vector3f(disc.x, disc.y, -2 * float(given["radius"])))
            ray = mi.Ray3f(start, axis)
            flux = mi.Color3f(given["intensity"][k].tolist()) * (math.pi * float(given["radius"]) ** 2)
        else:
            outer = given["cos_outer"][k] if given["kind"][k] == SPOT else -1.0
            frame = mi.Frame3f(axis if given["kind"][k] == SPOT else mi.Vector3f(0, 0, 1))
            ray = mi.Ray3f(mi.Point3f(given["position"][k].tolist()), frame.to_world(
                mi.warp.square_to_uniform_cone(u, float(outer))))
            flux = _intensity(given, k, ray.d) * (2 * math.pi * (1 - float(outer)))
        hit = scene.ray_intersect(ray)
        g = dr.select(dr.dot(hit.n, ray.d) > 0, -hit.n, hit.n)
        away = x - hit.p
        r2 = dr.squared_norm(away)
        v = away * dr.rsqrt(r2)
        counts = hit.is_valid() & (dr.dot(g, v) > 0) & (dr.dot(facing, v) < 0) & (dr.dot(n, v) < 0)
        shadow = hit.spawn_ray_to(x)
        counts &= ~scene.ray_test(shadow, counts)
        pattern = _pattern(lookup, hit, g, -ray.d, v)
        total += dr.select(counts, flux * pattern * (-dr.dot(n, v) / r2), 0)
    return total


def _incident(given, k, y):
    """Return direction and distance to a lamp, and the irradiance on what faces it."""
    if given["kind"][k] == DIRECTIONAL:
        constant = mi.Color3f(given["intensity"][k].tolist())
        return -mi.Vector3f(given["direction"][k].tolist()), mi.Float(dr.inf), constant
    away = mi.Point3f(given["position"][k].tolist()) - y
    distance = dr.norm(away)
    return away / distance, distance, _intensity(given, k, -away / distance) / dr.square(distance)


def _intensity(given, k, w):
    peak = mi.Color3f(given["intensity"][k].tolist())
    if given["kind"][k] != SPOT:
        return peak
    inner, outer = float(given["cos_inner"][k]), float(given["cos_outer"][k])
    cosine = dr.dot(w, mi.Vector3f(given["direction"][k].tolist()))
    t = dr.clip((cosine - outer) / (inner - outer), 0, 1) if inner > outer else dr.select(cosine > outer, 1.0, 0.0)
    bend, linear = map(float, given["shape"][k])
    return peak * (t * (linear + (1 - linear) * t) * (1 + 2 * bend - 2 * bend * t))


def _pattern(lookup, hit, g, toward, v):
    """Return rho / pi <n v> + rho_s (P + 1) / (2 pi K) <r v>^P."""
    material = dr.gather(mi.UInt32, lookup["material"], hit.prim_index)
    n = hit.sh_frame.n
    n = dr.select(dr.dot(n, g) < 0, -n, n)
    cosine, lifted = dr.dot(n, v), dr.dot(n, toward)
    diffuse, specular = (dr.gather(mi.Color3f, lookup[key], material) for key in ("diffuse", "specular"))
    value = diffuse * (cosine / math.pi)
    if dr.any(lookup["specular"] > 0):
        exponent = dr.gather(mi.Float, lookup["exponent"], material)
        place = (lifted + 1) / 2 * (lookup["rows"] - 1)
        low = dr.clip(mi.UInt32(place), 0, lookup["rows"] - 2)
        a, b = (dr.gather(mi.Float, lookup["share"], material * lookup["rows"] + low + step) for step in (0, 1))
        share = dr.lerp(a, b, place - mi.Float(low))
        gap = dr.squared_norm(2 * lifted * n - toward - v) / 2
        lobe = dr.select(gap < 1, dr.exp2(exponent * dr.log2(dr.maximum(1 - gap, 1e-30))), 0)
        value += specular * dr.select(share > 1e-12, lobe * (exponent + 1) / (2 * math.pi * share), 0)
    return dr.select(cosine > 0, value, 0)


if __name__ == "__main__":
    main(sys.argv[1])
