"""The formula of own_bsdf.py as a BSDF for Mitsuba 3, one ray at a time (`scalar_rgb`).

In Mitsuba's words `si.wi` is where the path comes from and `wo` where it goes on to.
"""

import mitsuba as mi


class LunarInMitsuba(mi.BSDF):
    """f = albedo / (4 pi (cos_i + cos_o)), seen from the side of the normal only."""

    def __init__(self, props):
        super().__init__(props)
        self.albedo = props.get_texture("albedo", 0.3)
        self.m_components = [mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide]
        self.m_flags = self.m_components[0]

    def sample(self, ctx, si, sample1, sample2, active=True):
        """Choose a direction by its cosine."""
        chosen = mi.BSDFSample3f(mi.warp.square_to_cosine_hemisphere(sample2))
        f_cos, chosen.pdf = self.eval_pdf(ctx, si, chosen.wo)
        chosen.eta = 1.0
        chosen.sampled_type = int(mi.BSDFFlags.DiffuseReflection)
        chosen.sampled_component = 0
        return chosen, f_cos / chosen.pdf if chosen.pdf > 0.0 else mi.Color3f(0.0)

    def eval(self, ctx, si, wo, active=True):
        """Return f cos."""
        return self.eval_pdf(ctx, si, wo)[0]

    def pdf(self, ctx, si, wo, active=True):
        """Return the density of `sample` [1/sr]."""
        return self.eval_pdf(ctx, si, wo)[1]

    def eval_pdf(self, ctx, si, wo, active=True):
        """Return both."""
        cos_i, cos_o = mi.Frame3f.cos_theta(wo), mi.Frame3f.cos_theta(si.wi)
        if cos_i <= 0.0 or cos_o <= 0.0:
            return mi.Color3f(0.0), 0.0
        density = mi.warp.square_to_cosine_hemisphere_pdf(wo)
        return self.albedo.eval(si) * (0.25 * density / (cos_i + cos_o)), density

    def eval_diffuse_reflectance(self, si, active=True):
        """Return what the AOV `albedo` shows."""
        return self.albedo.eval(si)

    def to_string(self):
        """Describe it in messages of Mitsuba's."""
        return f"LunarInMitsuba[albedo = {self.albedo}]"
