"""Whitted's recursive ray tracer (1980) as a plugin for Mitsuba, which lacks it.

Intersections, BSDFs and emitters are Mitsuba's; only the recursion is ours, so a
comparison with our renderer tests everything but the shape of the ray tree. The tree is
walked with a stack of weighted rays, one camera ray at a time: slow by nature, fast
enough for a small reference (96 x 96 pixels of mirrors in about a tenth of a second).
"""

from __future__ import annotations

from typing import Any

# Also what -1 stands for: between mirrors without loss, weight alone never ends a ray.
DEFAULT_DEPTH = 8


def register_whitted(mi: Any) -> None:
    """Make `<integrator type="whitted">` known to Mitsuba's current variant.

    Properties
    ----------
    max_depth : int, default 8 (also for -1)
        Segments of a path as Mitsuba's `path` counts them: 1 is emitted light alone, 2
        adds direct light, each more one reflection or refraction.
    cutoff : float, default 1/1024
        A ray whose weight's largest component is below this is dropped, and a black one.
    hide_emitters : bool, default false
        Camera rays pass through area emitters and see no environment.
    """
    import drjit as dr

    smooth = int(mi.BSDFFlags.Smooth)
    delta_lobes = (
        mi.BSDFFlags.DeltaReflection,
        mi.BSDFFlags.DeltaTransmission,
        mi.BSDFFlags.Null,  # of `thindielectric` and `null`
    )
    contexts = []
    for lobe in delta_lobes:
        # Sampled for one lobe alone, a BSDF returns its full weight: the Fresnel factor,
        # the tint and, for refraction, the scale of radiance 1 / eta^2.
        context = mi.BSDFContext()
        context.type_mask = int(lobe)
        contexts.append((int(lobe), context))
    all_lobes = mi.BSDFContext()
    unused = mi.Point2f(0.5, 0.5)  # a delta lobe and a delta light draw nothing

    def direct_light(scene: Any, sampler: Any, si: Any, bsdf: Any) -> Any:
        """Return the light of every emitter that `si` reflects towards the viewer."""
        total = mi.Color3f(0.0)
        for emitter in scene.emitters():
            is_delta = emitter.flags() & int(mi.EmitterFlags.Delta)
            ds, weight = emitter.sample_direction(
                si, unused if is_delta else sampler.next_2d()
            )
            if ds.pdf <= 0.0:
                continue
            value = bsdf.eval(all_lobes, si, si.to_local(ds.d)) * weight
            value *= cosine_ratio(scene, si, ds, emitter)
            # Asking for visibility last saves the ray where the light is behind.
            if max(value) > 0.0 and not scene.ray_test(si.spawn_ray_to(ds.p)):
                total += value
        return total

    def cosine_ratio(scene: Any, si: Any, ds: Any, emitter: Any) -> float:
        """Return the cosine of a lamp's triangle over that of its vertex normals.

        Mitsuba goes from area to solid angle by the second; without BSDF samples nothing
        else makes up for it (`expected_failures`, "Mitsuba's lamp with vertex normals").
        """
        shape = emitter.get_shape()
        if shape is None or not shape.is_mesh():
            return 1.0
        hit = scene.ray_intersect(si.spawn_ray(ds.d))
        if hit.shape != shape:  # in the shadow
            return 1.0
        return float(dr.abs_dot(ds.d, hit.n) / dr.abs_dot(ds.d, ds.n))

    class WhittedIntegrator(mi.SamplingIntegrator):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            depth = props.get("max_depth", DEFAULT_DEPTH)
            self.max_depth = depth if depth >= 0 else DEFAULT_DEPTH
            self.cutoff = props.get("cutoff", 1.0 / 1024.0)
            self.hides_emitters = props.get("hide_emitters", False)

        def first_hit(self, scene: Any, ray: Any) -> Any:
            si = scene.ray_intersect(ray)
            # not `skip_area_emitters`: what it returns ends the process at an instance
            while self.hides_emitters and si.is_valid() and si.shape.emitter() is not None:
                si = scene.ray_intersect(si.spawn_ray(ray.d))
            return si

        def sample(
            self,
            scene: Any,
            sampler: Any,
            ray: Any,
            medium: Any = None,
            active: bool = True,
        ) -> tuple[Any, bool, list[float]]:
            radiance = mi.Color3f(0.0)
            if self.max_depth == 0:
                return radiance, False, []
            si = self.first_hit(scene, ray)
            seen = si.is_valid()
            tree = [(si, mi.Color3f(1.0), 1)]
            while tree:
                si, weight, depth = tree.pop()
                emitter = si.emitter(scene)
                if emitter is not None and not (depth == 1 and self.hides_emitters):
                    radiance += weight * emitter.eval(si)
                if depth >= self.max_depth or not si.is_valid():
                    continue
                bsdf = si.bsdf()
                flags = bsdf.flags()
                if flags & smooth:
                    radiance += weight * direct_light(scene, sampler, si, bsdf)
                for lobe, context in contexts:
                    if not flags & lobe:
                        continue
                    sample, factor = bsdf.sample(context, si, 0.5, unused)
                    # A BSDF written in Python may sample whatever it has: with a mirror
                    # on its back, `twosided` samples it for the lobe of the mirror.
                    if not sample.sampled_type & lobe:
                        continue
                    branch = weight * factor
                    # With a cutoff of 0 a black ray would still be followed.
                    if max(branch) >= self.cutoff and max(branch) > 0.0:
                        next_ray = si.spawn_ray(si.to_world(sample.wo))
                        tree.append((scene.ray_intersect(next_ray), branch, depth + 1))
            return radiance, seen, []

        def to_string(self) -> str:
            return f"Whitted[max_depth={self.max_depth}, cutoff={self.cutoff:g}]"

    mi.register_integrator("whitted", WhittedIntegrator)
