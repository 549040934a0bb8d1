"""Reader of microfacet distributions, for all BSDFs that have one."""

from __future__ import annotations

from typing import Any

from renderer.scene_file.objects.objects import read_scalar_texture

_DEFAULT = 0.1


def read_roughness(properties: Any, *, textured: bool = True) -> dict[str, Any]:
    """Return the parameters of `microfacets`: distribution, roughness, sampling.

    As in Mitsuba, a roughness below 1e-4, even a negative one, counts as 1e-4.
    """
    distribution = properties.choice(
        "distribution", "beckmann", ("beckmann", "ggx"), any_case=True
    )
    visible = properties.boolean("sample_visible", True)
    alpha_u, alpha_v = _read_alphas(properties, textured)
    return {
        "alpha_u": alpha_u,
        "alpha_v": alpha_v,
        "beckmann": float(distribution == "beckmann"),
        "every_normal": float(not visible),
    }


def _read_alphas(properties: Any, textured: bool) -> tuple[Any, Any]:
    """Return the roughness along both tangents, from alpha, or alpha_u and alpha_v."""
    given = [name for name in ("alpha_u", "alpha_v") if properties.has(name)]
    if properties.has("alpha") or not given:
        if given:
            properties.fail(given[0], 'a value together with "alpha"', "one of the two")
        alpha = _read_alpha(properties, "alpha", textured)
        return alpha, alpha
    if len(given) == 1:
        properties.fail(given[0], "this one alone", "both alpha_u and alpha_v, or alpha")
    return (
        _read_alpha(properties, "alpha_u", textured),
        _read_alpha(properties, "alpha_v", textured),
    )


def _read_alpha(properties: Any, name: str, textured: bool) -> Any:
    if textured:
        return read_scalar_texture(properties, name, _DEFAULT)
    return properties.number(name, _DEFAULT)
