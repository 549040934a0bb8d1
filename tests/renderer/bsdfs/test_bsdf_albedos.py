"""Energy of every BSDF: the share of light that goes on, at several angles and both sides.

It is Mitsuba's, by the same numbers, to a thousandth; and where the parameters absorb
nothing, what is missing is what the model loses: light that would have met a second facet,
or that a coat keeps. docs/plugins.md has the table.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import test_bsdfs_against_mitsuba as single
import test_nested_bsdfs as nested
from bsdf_probes import BsdfProbe, MitsubaProbe, albedo, seen_under
from scene_file_samples import mi

from mitsuba_ref.reference.plugins.merl import register_merl

register_merl(mi)
MEASURED = Path(__file__).parents[2] / "plugins" / "small.binary"
ANGLES = (0.0, 30.0, 60.0, 85.0)  # [deg]
SMOOTH = {
    "diffuse": {"type": "diffuse", "reflectance": single.RED},
    "conductor": {"type": "conductor", "material": "Au"},
    "dielectric": {"type": "dielectric", "specular_transmittance": single.PALE},
    "merl": {"type": "merl", "filename": str(MEASURED)},
}
WHITE = single.rgb(1.0, 1.0, 1.0)
NO_METAL = {"type": "roughconductor", "material": "none"}
# what absorbs nothing by its parameters
LOSSLESS: dict[str, dict[str, Any]] = {
    "white diffuse": {"type": "diffuse", "reflectance": WHITE},
    "perfect mirror": {"type": "conductor", "material": "none"},
    "clear glass": {"type": "dielectric"},
    "clear pane": {"type": "thindielectric"},
    "rough mirror 0.1": NO_METAL,
    "rough mirror 0.5": NO_METAL | {"alpha": 0.5},
    "rough mirror 1 ggx": NO_METAL | single.GGX | {"alpha": 1.0},
    "rough glass 0.1": single.GLASS,
    "rough glass 0.5": single.GLASS | {"alpha": 0.5},
    "white plastic": {"type": "plastic", "diffuse_reflectance": WHITE},
    "white plastic nonlinear": {"type": "plastic", "diffuse_reflectance": WHITE}
    | {"nonlinear": True},
    "white roughplastic 0.3": {"type": "roughplastic", "diffuse_reflectance": WHITE}
    | {"alpha": 0.3},
    "white principled": {"type": "principled", "base_color": WHITE},
    "white principled metal": {"type": "principled", "base_color": WHITE, "metallic": 1.0},
    "white principled glass": {"type": "principled", "base_color": WHITE}
    | {"spec_trans": 1.0, "eta": 1.5},
}
CONSERVING = tuple(LOSSLESS)[:4]
ALL = LOSSLESS | SMOOTH | single.SETS | nested.SETS


def albedos(name: str, n: int) -> Any:
    """Return ours and Mitsuba's, (2 sides, angles, 3) each, by n^2 even samples."""
    pair = BsdfProbe(ALL[name]), MitsubaProbe(ALL[name])
    sides = (False, True) if pair[0].kind.transmits else (False,)
    return [
        np.array(
            [[albedo(p, seen_under(a, below=below), n) for a in ANGLES] for below in sides]
        )
        for p in pair
    ]


@pytest.mark.parametrize("name", ALL)
def test_the_albedo_is_mitsubas(name):
    """To 1e-3 at each angle; microfacets make no light, but for what the grid rounds.

    The principled BSDF does: its diffuse part and its mirrors know nothing of each other.
    """
    ours, theirs = albedos(name, 8)
    np.testing.assert_allclose(ours, theirs, atol=1e-3)
    if name in CONSERVING:
        np.testing.assert_allclose(ours, 1.0, atol=1e-5)
    elif name.startswith("rough "):
        assert ours.max() < 1.0 + 5e-3
