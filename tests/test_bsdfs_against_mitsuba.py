"""Every BSDF against Mitsuba's own object, number by number, and against itself.

`SETS` is the one table: a row is a dictionary of parameters, and each test here goes
through all of them, or through those for which it makes sense. A new BSDF adds rows.
"""

from __future__ import annotations

import zlib
from typing import Any, NamedTuple

import numpy as np
import pytest
from bsdf_probes import BsdfProbe, MitsubaProbe, random_directions, seen_under
from chi_square import assert_follows, cell_masses, histogram

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

SETS: dict[str, dict[str, Any]] = {
    "roughconductor": {"type": "roughconductor"},
    "roughconductor gold": GOLD | {"alpha": 0.3, "specular_reflectance": PALE},
    "roughconductor ggx": GOLD | GGX | {"alpha": 0.3},
    "roughconductor eta k": {"type": "roughconductor", "alpha": 1.2, **GGX}
    | {"eta": rgb(0.2, 0.9, 1.1), "k": rgb(3.9, 2.4, 2.1)},
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
}
every_set = pytest.mark.parametrize("name", SETS)
_OURS: dict[str, BsdfProbe] = {}


def ours(name: str) -> BsdfProbe:
    if name not in _OURS:
        _OURS[name] = BsdfProbe(SETS[name])
    return _OURS[name]


def chosen(*, without: str = "") -> Any:
    names = [n for n in SETS if not (without and without in n)]
    return pytest.mark.parametrize("name", names)
