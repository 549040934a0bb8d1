"""Sets of parameters of the BSDFs with rough and coated surfaces."""

from __future__ import annotations

from typing import Any

GOLD = {"type": "roughconductor", "material": "Au"}


GLASS = {"type": "roughdielectric", "int_ior": 1.5, "ext_ior": 1.0}


ALL = {"sample_visible": False}


GGX = {"distribution": "ggx"}


ALONG_V = {"alpha_u": 0.05, "alpha_v": 0.4}


def rgb(*value: float) -> dict[str, Any]:
    return {"type": "rgb", "value": list(value)}


RED, PALE = rgb(0.7, 0.2, 0.1), rgb(0.9, 0.95, 0.8)


PLASTIC = {"type": "plastic", "diffuse_reflectance": RED}


ROUGH = {"type": "roughplastic", "diffuse_reflectance": RED}


KNOBS = {"type": "principled", "base_color": RED, "roughness": 0.35}


SETS: dict[str, dict[str, Any]] = {
    "roughconductor": {"type": "roughconductor"},
    "roughconductor gold": GOLD | {"alpha": 0.3, "specular_reflectance": PALE},
    "roughconductor ggx": GOLD | GGX | {"alpha": 0.3},
    "roughconductor eta k": {"type": "roughconductor", "alpha": 1.2, **GGX}
    | {"eta": rgb(-0.2, 0.9, 1.1), "k": rgb(3.9, 2.4, -2.1)},
    "roughconductor ggx uv": GOLD | GGX | ALONG_V,
    "roughconductor uv": GOLD | ALONG_V,
    "roughconductor all": GOLD | ALL | {"alpha": 0.3},
    "roughconductor all ggx uv": GOLD | GGX | ALL | ALONG_V,
    "roughconductor all uv": GOLD | ALL | ALONG_V,
    "roughdielectric": {"type": "roughdielectric"},
    "roughdielectric ggx": GLASS | GGX | {"alpha": 0.4},
    "roughdielectric uv": GLASS | ALONG_V | {"specular_transmittance": RED},
    "roughdielectric thin": GLASS | {"alpha": 0.5, "int_ior": "air", "ext_ior": "diamond"},
    "roughdielectric all": GLASS | ALL | {"alpha": 0.3, "specular_reflectance": PALE},
    "roughdielectric all ggx uv": GLASS | GGX | ALL | ALONG_V,
    "plastic": {"type": "plastic"},
    "plastic nonlinear": PLASTIC | {"nonlinear": True, "int_ior": "diamond"},
    "plastic pale": PLASTIC | {"specular_reflectance": PALE, "int_ior": 1.9},
    "plastic thin": PLASTIC | {"int_ior": 1.0, "ext_ior": 1.4},
    "plastic mirror": PLASTIC | {"diffuse_reflectance": 0.0},
    "plastic no mirror": PLASTIC | {"specular_reflectance": 0.0},
    "roughplastic": {"type": "roughplastic"},
    "roughplastic nonlinear": ROUGH | GGX | {"nonlinear": True, "alpha": 0.3},
    "roughplastic all": ROUGH | ALL | {"alpha": 0.5, "specular_reflectance": PALE},
    "roughplastic all ggx": ROUGH | GGX | ALL | {"alpha": 0.2, "int_ior": 1.9},
    "roughplastic thin": ROUGH | {"int_ior": 1.0, "ext_ior": 1.4, "alpha": 0.3},
    "principled": {"type": "principled"},
    "principled metal": KNOBS | {"metallic": 0.7, "anisotropic": 0.8},
    "principled cloth": KNOBS | {"sheen": 0.8, "sheen_tint": 0.6, "flatness": 0.5},
    "principled coat": KNOBS | {"clearcoat": 1.0, "clearcoat_gloss": 0.3, "spec_tint": 0.7},
    "principled rates": KNOBS
    | {"clearcoat": 0.6, "metallic": 0.2, "specular": 0.9, "roughness": 0.15}
    | {"main_specular_sampling_rate": 0.4, "diffuse_reflectance_sampling_rate": 2.0},
    "principled glass": KNOBS | {"spec_trans": 0.5, "eta": 1.33},
    "principled glass all": KNOBS
    | {"spec_trans": 0.6, "metallic": 0.2, "clearcoat": 0.7, "spec_tint": 0.5}
    | {"sheen": 0.3, "anisotropic": 0.4, "flatness": 0.2, "clearcoat_gloss": 0.8},
    "principled glass alone": KNOBS | {"spec_trans": 1.0, "roughness": 0.5},
    "principledthin": {"type": "principledthin"},
    "principledthin all": KNOBS
    | {"type": "principledthin", "spec_trans": 0.5, "diff_trans": 1.2, "eta": 1.4}
    | {"sheen": 0.5, "sheen_tint": 1.0, "flatness": 0.5, "spec_tint": 0.4}
    | {"anisotropic": 0.5, "specular_transmittance_sampling_rate": 1.5},
}
