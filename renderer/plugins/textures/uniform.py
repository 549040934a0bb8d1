"""Constant textures.

A BSDF parameter that is constant needs no look-up; this kind is for constants inside of
other textures.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import kernel
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import gather3
from renderer.plugins.textures.kind import TextureKind
from renderer.scene_file.colors.colors import Use, read_constant_plugin
from renderer.scene_file.description import ConstantTexture


class Uniforms(NamedTuple):
    """Columns by texture id."""

    colors: NDArray[np.float32]  # (3, n)
    numbers: NDArray[np.float32]  # (n,) their values as scalars


def read(properties: Any, use: Use) -> ConstantTexture:
    """Read the properties of a file."""
    return ConstantTexture(read_constant_plugin(properties.element, properties.reading))


def mean(texture: ConstantTexture, mean_of: Any = None) -> float:
    """Return the mean of the three channels; not the luminance, as for a bitmap."""
    return sum(texture.rgb) / 3.0


def uniform_table(textures: list[ConstantTexture | None], scene: Any) -> Uniforms:
    """Pack colours into one record."""
    colors = [t.rgb if t else (0.0,) * 3 for t in textures]
    return Uniforms(
        np.ascontiguousarray(np.array(colors, np.float32).T),
        np.array([mean(t) if t else 0.0 for t in textures], np.float32),
    )


@kernel
def uniform_color(uniforms, texture, point, mask):
    """Return the colour."""
    return gather3(uniforms.colors, texture, mask)


@kernel
def uniform_scalar(uniforms, texture, point, mask):
    """Return the mean of the colour."""
    return gather_row(uniforms.numbers, 0, texture, mask)


UNIFORM = TextureKind(
    "uniform",
    ConstantTexture,
    read,
    uniform_table,
    Uniforms,
    uniform_color,
    uniform_scalar,
    mean,
)
