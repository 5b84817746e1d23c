"""The literal twins of clustered visibility as a port: each stage from the arrays that a kit holds."""

import math
from types import SimpleNamespace

import numpy as np

from refgi.cluster.settings import BackProjection, Csm, Pcf
from refgi.vectors.stages.lights import pixel_lights_of
from tests.naive import area_visibility as soft
from tests.naive import filters, interleaving, kmeans
from tests.naive.clustered import ABOVE, FLAT, HULL, NEAR, turn
from tests.naive.crossings import face_normals
from tests.naive.pair_term import contributions
from tests.naive.val import is_between, view_frame


class Port:
    """Outputs of the stages of a case by the twins; `stages` names those that they cover."""

    def __init__(self, setup, known):
        self.settings, self.geometry = setup.settings, setup.scene.geometry
        self.known = known
        self.covered = known["gbuffer.triangle_id"] >= 0
        self.pixels = [tuple(place) for place in np.argwhere(self.covered)]
        self.shape = self.covered.shape

    def __getitem__(self, name):
        array = self.known[name]
        return array.astype(float) if array.dtype.kind == "f" else array

    def outputs(self, stage):
        """Return arrays by name."""
        step = stage.rstrip("0123456789").replace(".", "_") if stage.startswith("kmeans.") else stage.replace(".", "_")
        number = stage[len(stage.rstrip("0123456789")):]
        return getattr(self, step)(*([int(number)] if number else []))

    # Sec. 5 and 6, area lights

    def extents(self):
        boxes = [box([self["gbuffer.position"][:, *at] for at in self.pixels])]
        lit, k = [], 0
        while f"rsm{k}.flux" in self.known:
            flux = self[f"rsm{k}.flux"] + (self[f"rsm{k}.lobe_flux"] if f"rsm{k}.lobe_flux" in self.known else 0)
            lit += [self[f"rsm{k}.position"][:, *at] for at in np.argwhere(flux.any(axis=0))]
            k += 1
        return {"extents.visible": boxes[0], "extents.illuminated": box(lit)}

    def diagonal(self, name):
        return math.dist(*self[f"extents.{name}"])

    def kmeans_start(self):
        total = self["lights.position"].shape[1]
        count = self.settings.clusters.count
        first = [k * total // count for k in range(count)]
        return {"kmeans.center0": self["lights.position"][:, first], "kmeans.normal0": self["lights.normal"][:, first]}

    def metric(self):
        kind = self.settings.clusters
        return kind.distance, (kind.position_weight, kind.normal_weight), self.diagonal("illuminated")

    def kmeans_assign(self, number):
        centers, normals = (self[f"kmeans.{key}{number}"].T.tolist() for key in ("center", "normal"))
        found = [kmeans.nearest(x, n, centers, normals, *self.metric()) for x, n in
                 zip(self["lights.position"].T.tolist(), self["lights.normal"].T.tolist(), strict=True)]
        return {f"kmeans.of{number}": np.array([k for k, _ in found]),
                f"kmeans.distance{number}": np.array([d for _, d in found])}

    def kmeans_means(self, number):
        centers, normals = (self[f"kmeans.{key}{number - 1}"].T.tolist() for key in ("center", "normal"))
        kmeans.means(self["lights.position"].T.tolist(), self["lights.normal"].T.tolist(),
                     self[f"kmeans.of{number - 1}"].tolist(), centers, normals)
        return {f"kmeans.center{number}": np.array(centers).T, f"kmeans.normal{number}": np.array(normals).T}

    def kmeans(self):
        total = self["lights.position"].shape[1]
        if self.settings.clusters.count >= total:
            return {"clusters.center": self["lights.position"], "clusters.normal": self["lights.normal"],
                    "clusters.of": np.arange(total)}
        start = [self[f"kmeans.{key}2"].T.tolist() for key in ("center", "normal")]
        center, normal, of, *_ = kmeans.cluster(
            self["lights.position"].T.tolist(), self["lights.normal"].T.tolist(), len(start[0]), *self.metric(),
            self.settings.clusters.rounds - 2, start)
        return {"clusters.center": np.array(center).T, "clusters.normal": np.array(normal).T,
                "clusters.of": np.array(of)}

    def areas(self):
        how, count = self.settings.area, self["clusters.center"].shape[1]
        made = {key: [] for key in ("frame", "axes", "side", "offset", "delta", "radius", "members")}
        for k in range(count):
            members = np.flatnonzero(self["clusters.of"] == k)
            normal = self["clusters.normal"][:, k]
            right, down = (np.array(v) for v in view_frame(normal.tolist()))
            away = (self["lights.position"][:, members] - self["clusters.center"][:, [k]]).T
            c, s = turn(away @ right, away @ down, how.axes)
            c, s = (-c, -s) if c < 0 else (c, s)
            axes = np.array([c * right + s * down, c * down - s * right])
            radius = float(np.linalg.norm(away, axis=1).max(initial=0))
            flat = away @ axes.T
            low, high = (flat.min(axis=0), flat.max(axis=0)) if len(members) else np.zeros((2, 2))
            side = np.where(high - low < FLAT * radius, 0.0, high - low)
            if how.unbiased_area and len(members) > 1:
                side = side * (len(members) + 1) / (len(members) - 1)
            delta = {"root": math.sqrt(side[0] * side[1]), "longer": side.max(), "shorter": side.min()}[how.extent]
            values = (np.array([right, down, normal]), axes, side, (low + high) / 2, delta, radius, len(members))
            for key, value in zip(made, values, strict=True):
                made[key].append(value)
        return {f"areas.{key}": np.array(value).T if key in ("side", "offset") else np.array(value)
                for key, value in made.items()}

    # Sec. 4.2, maps

    def common_box(self):
        both = np.array([self["extents.visible"], self["extents.illuminated"]])
        return both[:, 0].min(axis=0), both[:, 1].max(axis=0)

    def maps_views(self):
        low, high = self.common_box()
        center = (self["clusters.center"] + ABOVE * np.abs(self["extents.illuminated"]).max()
                  * self["clusters.normal"]).T
        far = [math.hypot(*np.maximum(np.abs(low - c), np.abs(high - c))) for c in center]
        return {"maps.center": center, "maps.scene_far": np.array(far),
                "maps.ball": NEAR[self.settings.visibility.name()] * self["areas.radius"]}

    def corners(self):
        return self["scene.vertices"][self["scene.faces"]]

    def maps_blockers(self):
        low, high = self.common_box()
        seen = np.unique(self["gbuffer.triangle_id"][self.covered])
        ends = np.concatenate([self.corners()[seen].reshape(-1, 3), self["lights.position"].T]).tolist()
        return {"maps.blocks": np.array([is_between(t.tolist(), ends, HULL * math.dist(low, high))
                                         for t in self.corners()])}

    def maps_depth(self):
        blockers = self.corners()[self["maps.blocks"]]
        views = zip(self["maps.center"], self["areas.frame"], self["maps.ball"], strict=True)
        made = [soft.draw(blockers, center, frame, self.settings.maps.resolution, ball, 0.0).depth
                for center, frame, ball in views]
        return {"maps.depth": np.where((self["areas.members"] > 0)[:, None, None], made, np.inf)}

    def maps_depth_behind(self):
        """Right and forward turned round."""
        blockers, turned = self.corners()[self["maps.blocks"]], np.array([[-1], [1], [-1]])
        views = zip(self["maps.center"], self["areas.frame"] * turned, self["maps.ball"], strict=True)
        made = [soft.draw(blockers, center, frame, self.settings.maps.resolution, ball, 0.0).depth
                for center, frame, ball in views]
        return {"maps.behind": np.where((self["areas.members"] > 0)[:, None, None], made, np.inf)}

    def maps_range(self):
        depth = self["maps.depth"]
        return {"maps.near": depth.min(axis=(1, 2)),
                "maps.far": np.where(np.isfinite(depth), depth, 0).max(axis=(1, 2))}

    def series(self):
        chain = soft.series(self.settings.visibility)
        return {"series.weight": chain.weight, "series.bias": np.array([chain.search_bias, chain.bias]),
                "series.range": np.array([chain.end])}

    def used(self, name="maps.near"):
        return [k for k, near in enumerate(self[name]) if np.isfinite(near)]

    def scale(self):
        made = np.zeros((2, len(self["maps.near"])))
        for k in self.used():
            pair = np.array([[self["maps.near"][k], self["maps.far"][k]]])
            seen = soft.Seen(None, None, pair, float(self["maps.scene_far"][k]))
            found = soft.scale_of(seen, self.settings.visibility.depth_scale, float(self["series.range"][0]))
            made[:, k] = found.origin, found.slope
        return {"scale.origin": made[0], "scale.slope": made[1]}

    def scale_at(self, k):
        return soft.Scale(self.settings.visibility.depth_scale == "log_map", self["scale.origin"][k],
                          self["scale.slope"][k], self["series.range"][0])

    def maps_t(self):
        made = np.zeros_like(self["maps.depth"])
        for k in np.flatnonzero(self["scale.slope"]):
            t = self.scale_at(k).depth(self["maps.depth"][k])
            made[k] = filters.mirrored(t) if self.settings.visibility.prefilter == "mip" else t
        return {"maps.t": made}

    def basis(self):
        terms = self.settings.visibility.terms
        made = [np.moveaxis(filters.planes(t, terms), 2, 0) if t.any() else np.zeros((4 * terms + 1, *t.shape))
                for t in self["maps.t"]]
        return {"basis.0": np.array([self.kept(np.moveaxis(one, 0, 2)) for one in made]).transpose(0, 3, 1, 2)}

    def kept(self, planes):
        """Return channels as they are stored: in 8 and 16 bits where that is asked for; 0 on empty maps."""
        rounds = self.settings.visibility.quantisation == "published" and planes.any()
        return soft.rounded_channels(planes) if rounds else planes

    def mip(self):
        levels = []
        for one in self["basis.0"]:
            levels.append([np.moveaxis(one, 0, 2)])
            while len(levels[-1][-1]) > 1:
                levels[-1].append(self.kept(filters.mip_levels(levels[-1][-1])[1]))
        return {f"basis.{level}": np.array([np.moveaxis(one[level], 2, 0) for one in levels])
                for level in range(1, len(levels[0]))}

    # Sec. 4.1, visibility

    def facing(self):
        made = np.zeros((3, *self.shape))
        at = tuple(np.array(self.pixels).T)
        made[:, *at] = face_normals(self.geometry, self["gbuffer.triangle_id"][at], self["gbuffer.normal"][:, *at].T).T
        return {"gbuffer.facing": made}

    def planes(self, *axes, fill=0.0):
        return np.full((len(self["areas.delta"]), *axes, *self.shape), fill)

    def local(self, k, at):
        return self["areas.frame"][k] @ (self["gbuffer.position"][:, *at] - self["maps.center"][k])

    def delta(self, k, local):
        size = self["areas.delta"][k]
        return size * math.sqrt(local[2] / math.hypot(*local)) if self.settings.area.foreshortened else size

    def search(self):
        pending, region, distance = self.planes().astype(bool), self.planes(3), self.planes()
        for k in self.used():
            near = self["maps.near"][k]
            for at in self.pixels if self["areas.delta"][k] > 0 else ():
                local = self.local(k, at)
                d = math.hypot(*local)
                if local[2] > 0 and d > near:
                    pending[k, *at], distance[k, *at] = True, d
                    tangent = soft.search(self.delta(k, local), d, near, self.settings.as_published)
                    region[k, :, *at] = soft.region(local, tangent, self.settings.as_published)
        return {"search.pending": pending, "search.region": region, "search.distance": distance}

    def means(self, name, flag, channels):
        csm = self.settings.visibility
        names = sorted((one for one in self.known if one.startswith("basis.")), key=lambda one: int(one[6:]))
        made = self.planes(channels)
        for k, flags in enumerate(self[flag]):
            levels = [np.moveaxis(self[one][k], 0, 2) for one in names]
            kept = soft.Filtered(levels[0], levels if csm.prefilter == "mip" else None,
                                 "val_alpha_over_pi" in self.settings.as_published)
            for at in np.argwhere(flags):
                made[k, :, *at] = kept.mean(*self[f"{name}.region"][k, :, *at])[:channels]
        return {f"{name}.means": made}

    def search_means(self):
        return self.means("search", "search.pending", 4 * self.settings.visibility.terms + 1)

    def penumbra_means(self):
        return self.means("penumbra", "penumbra.shaded", 2 * self.settings.visibility.terms)

    def penumbra(self):
        by_series = isinstance(self.settings.visibility, Csm)
        shaded, z_avg, region, depth = self.planes().astype(bool), self.planes(), self.planes(3), self.planes()
        for k, *at in np.argwhere(self["search.pending"]):
            local = self.local(k, at)
            d = math.hypot(*local)
            mean = self.by_series(k, at, d, depth) if by_series else self.by_tests(k, at, local)
            if mean is not None:
                mean = min(max(mean, self["maps.near"][k]), d)
                shaded[k, *at], z_avg[k, *at] = True, mean
                tangent = soft.penumbra(self.delta(k, local), d, mean, self.settings.as_published)
                region[k, :, *at] = soft.region(local, tangent, self.settings.as_published)
        made = {"penumbra.shaded": shaded, "penumbra.z_avg": z_avg, "penumbra.region": region}
        return made | ({"penumbra.t": depth} if by_series else {})

    def by_series(self, k, at, d, depth):
        scale, means, weight = self.scale_at(k), self["search.means"][k, :, *at], self["series.weight"]
        depth[k, *at] = scale.depth(d)
        here = depth[k, *at] - self["series.bias"][0]
        blocked = 1 - soft.lit_share(means, weight, here)
        if blocked < soft.NO_BLOCKER:
            return None
        return float(scale.distance(soft.blocked_depth(means, weight, here) / blocked))

    def seen(self, k):
        return soft.Seen(self["maps.center"][k], self["areas.frame"][k], self["maps.depth"][k], 0.0)

    def hides(self, k, at, local):
        normal = self["areas.frame"][k] @ self["gbuffer.facing"][:, *at]
        depth = self["maps.depth"][k]
        return depth < soft.plane_distance(len(depth), local, normal) * (1 - soft.SLACK)

    def by_tests(self, k, at, local):
        depth = self["maps.depth"][k]
        blockers = self.hides(k, at, local) & soft.in_disc(len(depth), *self["search.region"][k, :, *at])
        blockers &= soft.in_cone(self.seen(k), local, self.delta(k, local))
        return depth[blockers].mean() if blockers.any() else None

    def visibility(self):
        kind = self.settings.visibility
        if isinstance(kind, BackProjection):
            return {"visibility.share": self.projected()}
        if isinstance(kind, Pcf) or not self["areas.delta"].any():
            return {"visibility.share": self.binary(kind.texels if isinstance(kind, Pcf) else 1, everywhere=True)}
        made = self["hard.share"].copy() if "hard.share" in self.known else self.planes(fill=1.0)
        for k, *at in np.argwhere(self["penumbra.shaded"]):
            if isinstance(kind, Csm):
                chain = soft.series(kind)
                share = soft.lit_share(self["penumbra.means"][k, :, *at], self["series.weight"],
                                       self["penumbra.t"][k, *at] - self["series.bias"][1])
                made[k, *at] = min(max(chain.gain * share, 0), 1)
            else:
                disc = soft.in_disc(self["maps.depth"].shape[1], *self["penumbra.region"][k, :, *at])
                made[k, *at] = 1 - self.hides(k, at, self.local(k, at))[disc].mean()
        return {"visibility.share": made}

    def hard(self):
        return {"hard.share": self.binary(1, everywhere=False)}

    def projected(self):
        made = self.planes(fill=1.0)
        for k in self.used():
            area = SimpleNamespace(center=self["clusters.center"][:, k], **{
                key: self[f"areas.{key}"][:, k] for key in ("offset", "side")})
            axes = np.array([*self["areas.axes"][k], self["clusters.normal"][:, k]])
            for at in self.pixels:
                if self.local(k, at)[2] > 0:
                    made[k, *at] = soft.back_projected(self.seen(k), area, axes, self["gbuffer.position"][:, *at],
                                                       self["gbuffer.facing"][:, *at])
        return made

    def binary(self, texels, everywhere):
        made = self.planes(fill=1.0)
        ahead = [("maps.depth", np.eye(3))]
        for name, turned in [*ahead, ("maps.behind", np.diag([-1, 1, -1]))] if "maps.behind" in self.known else ahead:
            for k in np.flatnonzero(np.isfinite(self[name]).any(axis=(1, 2))):
                size, frame = self["areas.delta"][k], turned @ self["areas.frame"][k]
                seen = soft.Seen(self["maps.center"][k], frame, self[name][k], 0.0)
                for at in self.pixels if everywhere or size == 0 else ():
                    local = turned @ self.local(k, at)
                    if local[2] > 0:
                        share = soft.pcf_share(seen, local, frame @ self["gbuffer.facing"][:, *at],
                                               texels if size > 0 else 1)
                        made[k, *at] = min(made[k, *at], share)
        return made

    # Sec. 4 and 6, light

    @property
    def block(self):
        return self.settings.interleaving.block

    def interleaving(self):
        of = self["clusters.of"].tolist() if self.settings.interleaving.assignment == "cluster" else None
        made = np.full(len(self["clusters.of"]), -1)
        for row in range(self.block):
            for column in range(self.block):
                made[interleaving.lights_of(column, row, self.block, len(made), of)] = row * self.block + column
        return {"interleaving.subset": made}

    def parts(self):
        lights = pixel_lights_of({name: self[name] for name in self.known if name.startswith("lights.")}, np.float64)
        at = tuple(np.array(self.pixels).T)
        position, normal = (self[f"gbuffer.{key}"][:, *at].T for key in ("position", "normal"))
        area = self["lights.area"] if "lights.area" in self.known else None
        each, side = contributions(position, normal, lights, self.settings.pairs, area), self.block
        if side > 1:
            own = self["interleaving.subset"][:, None] == np.array([y % side * side + x % side for y, x in self.pixels])
            each = each * own[..., None] * side**2
        made = np.zeros((self["clusters.center"].shape[1], 3, *self.shape))
        for i, k in enumerate(self["clusters.of"]):
            made[k][:, *at] += each[i].T
        return {"parts.irradiance": made}

    def sum(self):
        return {"sum.irradiance": (self["parts.irradiance"] * self["visibility.share"][:, None]).sum(axis=0)}

    def blur(self):
        how = self.settings.blur
        return {"blur.irradiance": interleaving.blurred(
            self["sum.irradiance"], self["gbuffer.position"], self["gbuffer.normal"], self.covered, self.block,
            how.extent * self.diagonal("visible"), how.cosine, how.every_subset)}


def box(points):
    """Return the least and the greatest of each coordinate."""
    return np.array([np.min(points, axis=0), np.max(points, axis=0)])
