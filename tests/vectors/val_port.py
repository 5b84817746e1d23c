"""The literal forms of clustered visibility as a port: each stage from the arrays that a kit holds."""

import math
from types import SimpleNamespace

import numpy as np

from refgi.cluster.settings import BackProjection, Csm, Pcf
from refgi.vectors.spec import outputs_of
from tests.naive import area_visibility as soft
from tests.naive import filters, interleaving


class Port:
    """Outputs of the stages of a case by their literal forms, or by twins where they have none."""

    def __init__(self, setup, known):
        self.settings, self.geometry = setup.settings, setup.scene.geometry
        self.known, self.steps = known, {step.name: step for step in setup.case().stages}
        self.covered = known["gbuffer.triangle_id"] >= 0
        self.pixels = [tuple(place) for place in np.argwhere(self.covered)]
        self.shape = self.covered.shape

    def __getitem__(self, name):
        array = self.known[name]
        return array.astype(float) if array.dtype.kind == "f" else array

    def outputs(self, stage):
        """Return arrays by name."""
        if self.steps[stage].variants:
            return outputs_of(self.steps[stage], self.known, np.float64, self.steps[stage].variants[0])
        return getattr(self, stage.replace(".", "_"))()

    def series(self):
        chain = soft.series(self.settings.visibility)
        return {"series.weight": chain.weight, "series.bias": np.array([chain.search_bias, chain.bias]),
                "series.range": np.array([chain.end])}

    def used(self, name="maps.near"):
        return [k for k, near in enumerate(self[name]) if np.isfinite(near)]

    def scale_at(self, k):
        return soft.Scale(self.settings.visibility.depth_scale == "log_map", self["scale.origin"][k],
                          self["scale.slope"][k], self["series.range"][0])

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

    def blur(self):
        how = self.settings.blur
        return {"blur.irradiance": interleaving.blurred(
            self["sum.irradiance"], self["gbuffer.position"], self["gbuffer.normal"], self.covered, self.block,
            how.extent * math.dist(*self["extents.visible"]), how.cosine, how.every_subset)}

