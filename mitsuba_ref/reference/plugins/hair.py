"""Mitsuba's `hair` with samples of its last lobe in their place.

`hair` samples the paths of more than one internal reflection across the fibre alone, while
its density has them around the direction of the mirror: a picture of it is wrong in the
mean (docs/mitsuba-faults.md). A replay has the fault on both sides.
"""

from __future__ import annotations

from math import cos, exp, log, pi, sqrt
from typing import Any

from renderer.scene_file.description import SceneDescription

WITH_LAST_LOBE = "hair_with_last_lobe"


def has_hair(description: SceneDescription) -> bool:
    """Return whether a shape of the scene shows `hair`."""
    # it imports kernels, which the process that waits for Mitsuba does without
    from mitsuba_ref.reference.plugins.volpathmis import with_nested

    shown = (b for shape in description.every_shape for b in with_nested(shape.bsdf))
    return any(bsdf.plugin == "hair" for bsdf in shown)


def take_hair_with_last_lobe(state: Any) -> None:
    """Replace `hair` in the nodes of a parsed scene."""
    for node in state.nodes:
        if node.props.plugin_name() == "hair":
            node.props.set_plugin_name(WITH_LAST_LOBE)


def register_hair(mi: Any) -> None:
    """Make the plugin known to Mitsuba's current variant, with the properties of `hair`."""

    class HairWithLastLobe(mi.BSDF):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            inside = mi.Properties(props)
            inside.set_plugin_name("hair")
            b = props.get("longitudinal_roughness", 0.3)
            for name in props.keys():
                props.mark_queried(name)
            self.hair = mi.PluginManager.instance().create_object(inside)
            self.m_components = [
                self.hair.flags(k) for k in range(self.hair.component_count())
            ]
            self.m_flags = self.hair.flags()
            self.v = 4.0 * (0.726 * b + 0.812 * b**2 + 3.7 * b**20) ** 2

        def sample(
            self, ctx: Any, si: Any, sample1: float, sample2: Any, active: bool = True
        ) -> tuple[Any, Any]:
            chosen, weight = self.hair.sample(ctx, si, sample1, sample2, active)
            if not chosen.pdf > 0.0 or chosen.wo.y != 0.0:
                return chosen, weight
            x, y = sample2
            away = 1.0 + self.v * log(max(x + (1.0 - x) * exp(-2.0 / self.v), 1e-300))
            away = min(max(away, -1.0), 1.0)
            sine = si.wi.y
            sin_o = sqrt(1.0 - away**2) * cos(2.0 * pi * y) * sqrt(max(1.0 - sine**2, 0.0))
            sin_o -= away * sine
            cos_o = sqrt(max(1.0 - sin_o**2, 0.0))
            chosen.wo = mi.Vector3f(cos_o * chosen.wo.x, sin_o, cos_o * chosen.wo.z)
            value, chosen.pdf = self.hair.eval_pdf(ctx, si, chosen.wo)
            return chosen, value / chosen.pdf if chosen.pdf > 0.0 else mi.Color3f(0.0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: bool = True) -> Any:
            return self.hair.eval(ctx, si, wo, active)

        def pdf(self, ctx: Any, si: Any, wo: Any, active: bool = True) -> float:
            return self.hair.pdf(ctx, si, wo, active)

        def eval_pdf(
            self, ctx: Any, si: Any, wo: Any, active: bool = True
        ) -> tuple[Any, float]:
            return self.hair.eval_pdf(ctx, si, wo, active)

        def to_string(self) -> str:
            return f"HairWithLastLobe[{self.hair}]"

    mi.register_bsdf(WITH_LAST_LOBE, HairWithLastLobe)
