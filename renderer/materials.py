"""BSDFs, textures and which shape has which: the description's objects as tables."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.kernel_scene import (
    CONDUCTOR,
    DIELECTRIC,
    DIFFUSE,
    EMIT,
    Bsdfs,
    ConductorTable,
    DielectricTable,
    DiffuseTable,
    Textures,
)
from renderer.light_order import light_order
from renderer.scene_file.description import (
    BitmapTexture,
    Bsdf,
    CheckerboardTexture,
    Conductor,
    ConstantTexture,
    Dielectric,
    Diffuse,
    SceneDescription,
    Shape,
    TwoSided,
)
from renderer.textures import CLAMP, MIRROR, REPEAT

_KIND = {Diffuse: DIFFUSE, Conductor: CONDUCTOR, Dielectric: DIELECTRIC}
_WRAP = {"repeat": REPEAT, "mirror": MIRROR, "clamp": CLAMP}


def sides(bsdf: Bsdf) -> tuple[Any, Any]:
    """Return what a shape shows on the side of its normal and behind; None is black."""
    if isinstance(bsdf, TwoSided):
        return bsdf.front, bsdf.back
    if isinstance(bsdf, Dielectric):
        return bsdf, bsdf
    return bsdf, None


def shape_stages(shape: Shape) -> int:
    """Return the bits of what a hit on a shape needs next."""
    kinds = {_KIND[type(side)] for side in sides(shape.bsdf) if side is not None}
    return sum(kinds) | (EMIT if shape.radiance is not None else 0)


def texture_rows(
    textures: Iterable[BitmapTexture | CheckerboardTexture],
) -> Textures | None:
    """Pack textures into one record; None if there are none."""
    textures = list(textures)
    if not textures:
        return None
    texels, starts, sizes = [np.zeros((3, 1), np.float32)], [], []
    total = 1
    for texture in textures:
        if isinstance(texture, BitmapTexture):
            height, width = texture.pixels.shape[:2]
            texels.append(texture.pixels.reshape(-1, 3).T)
            starts.append(total)
            sizes.append((width, height))
            total += width * height
        else:
            starts.append(-1)
            sizes.append((1, 1))
    bitmaps = [t if isinstance(t, BitmapTexture) else None for t in textures]
    colors = [
        (*t.color0, *t.color1) if isinstance(t, CheckerboardTexture) else (0.0,) * 6
        for t in textures
    ]
    return Textures(
        np.ascontiguousarray(np.concatenate(texels, axis=1), np.float32),
        np.array(starts, np.int32),
        np.array([width for width, _ in sizes], np.int32),
        np.array([height for _, height in sizes], np.int32),
        np.array([b is not None and b.filter_type == "nearest" for b in bitmaps], np.int32),
        np.array([_WRAP[b.wrap_mode] if b else 0 for b in bitmaps], np.int32),
        np.ascontiguousarray([t.to_uv[:2].ravel() for t in textures], np.float32).T.copy(),
        np.ascontiguousarray(colors, np.float32).T.copy(),
    )


@dataclass
class MaterialTables:
    """The distinct BSDFs of a scene and, for each shape, the ids of its two sides."""

    bsdfs: list[Diffuse | Conductor | Dielectric] = field(default_factory=list)
    front: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    back: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    light: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))

    @classmethod
    def of(cls, description: SceneDescription) -> MaterialTables:
        """Collect the BSDFs and the numbers of the area lights."""
        tables = cls()
        ids: dict[int, int] = {}
        front, back = [], []

        def number(bsdf: Any) -> int:
            if bsdf is None:
                return -1
            if id(bsdf) not in ids:
                ids[id(bsdf)] = len(tables.bsdfs)
                tables.bsdfs.append(bsdf)
            return ids[id(bsdf)]

        for shape in description.every_shape:
            ahead, behind = sides(shape.bsdf)
            front.append(number(ahead))
            back.append(number(behind))
        tables.front = np.array(front or [-1], np.int32)
        tables.back = np.array(back or [-1], np.int32)
        tables.light = np.full(max(len(front), 1), -1, np.int32)
        tables.light[: len(description.shapes)] = light_order(description).of_shapes
        return tables

    def has(self, kind: type) -> bool:
        """Return whether the scene has a BSDF of a class of the description."""
        return any(isinstance(bsdf, kind) for bsdf in self.bsdfs)

    @property
    def textured(self) -> bool:
        """Whether any BSDF looks at uv."""
        return any(
            isinstance(b, Diffuse) and not isinstance(b.reflectance, ConstantTexture)
            for b in self.bsdfs
        )

    def records(self) -> Bsdfs:
        """Return the kernels' tables, None for each kind that the scene lacks."""
        kinds = [_KIND[type(bsdf)] for bsdf in self.bsdfs] or [0]
        return Bsdfs(
            np.array(kinds, np.int32),
            self._diffuse() if self.has(Diffuse) else None,
            self._conductor() if self.has(Conductor) else None,
            self._dielectric() if self.has(Dielectric) else None,
        )

    def _columns(self, kind: type, default: Any, value: Any) -> NDArray[np.float32]:
        rows = [value(b) if isinstance(b, kind) else default for b in self.bsdfs]
        return np.ascontiguousarray(np.array(rows, np.float32).T)

    def _diffuse(self) -> DiffuseTable:
        textures: list[Any] = []
        numbers = []
        for bsdf in self.bsdfs:
            textured = isinstance(bsdf, Diffuse) and not isinstance(
                bsdf.reflectance, ConstantTexture
            )
            numbers.append(len(textures) if textured else -1)
            if textured:
                textures.append(bsdf.reflectance)

        def constant(bsdf: Diffuse) -> Any:
            texture = bsdf.reflectance
            return texture.rgb if isinstance(texture, ConstantTexture) else (0, 0, 0)

        return DiffuseTable(
            self._columns(Diffuse, (0, 0, 0), constant),
            np.array(numbers, np.int32),
            texture_rows(textures),
        )

    def _conductor(self) -> ConductorTable:
        none = (0.0, 0.0, 0.0)
        return ConductorTable(
            self._columns(Conductor, none, lambda b: b.eta),
            self._columns(Conductor, none, lambda b: b.k),
            self._columns(Conductor, none, lambda b: b.specular_reflectance),
        )

    def _dielectric(self) -> DielectricTable:
        none = (0.0, 0.0, 0.0)
        return DielectricTable(
            self._columns(Dielectric, 1.0, lambda b: b.eta),
            self._columns(Dielectric, none, lambda b: b.specular_reflectance),
            self._columns(Dielectric, none, lambda b: b.specular_transmittance),
        )
