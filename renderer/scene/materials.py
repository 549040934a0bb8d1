"""BSDFs, textures and which shape has which: the description's objects as tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.kinds.bsdfs.kind import BsdfKind
from renderer.kinds.bsdfs.registry import BSDFS
from renderer.kinds.textures.kind import TextureKind
from renderer.kinds.textures.registry import TEXTURES
from renderer.records.kernel_scene import ANY, EMIT, FIRST_BSDF, MOST_BSDF_KINDS
from renderer.scene.light_order import light_order
from renderer.scene_file.description import (
    Bsdf,
    ConstantTexture,
    SceneDescription,
    Shape,
    TwoSided,
)


def kind_of(bsdf: Any) -> BsdfKind:
    """Return the kind of a BSDF of the description."""
    return BSDFS[bsdf.plugin]


def sides(bsdf: Bsdf) -> tuple[Any, Any]:
    """Return what a shape shows on the side of its normal and behind; None is black."""
    if isinstance(bsdf, TwoSided):
        return bsdf.front, bsdf.back
    return bsdf, bsdf if kind_of(bsdf).transmits else None


def is_textured(value: Any) -> bool:
    """Return whether a parameter differs from point to point."""
    return texture_kind_of(value) is not None


def texture_kind_of(value: Any) -> TextureKind | None:
    """Return the kind of texture that gives a parameter, None for a constant."""
    for kind in TEXTURES.values():
        if isinstance(value, kind.description):
            return kind
    return None


def constant_of(value: Any, rows: int) -> Any:
    """Return a parameter as so many numbers; 0 where a texture gives it."""
    if isinstance(value, ConstantTexture):
        value = value.rgb if rows == 3 else value.rgb[0]
    if is_textured(value):
        return np.zeros(rows)
    return np.broadcast_to(np.asarray(value, np.float64), rows)


@dataclass
class MaterialTables:
    """The distinct BSDFs of a scene and, for each shape, the ids of its two sides."""

    bsdfs: list[Any] = field(default_factory=list)
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

    @property
    def kinds(self) -> list[BsdfKind]:
        """The kinds present: those with smooth lobes first, else as they are registered."""
        present = {kind_of(bsdf).name for bsdf in self.bsdfs}
        listed = [kind for name, kind in BSDFS.items() if name in present]
        return sorted(listed, key=lambda kind: not kind.smooth)

    @property
    def smooth(self) -> bool:
        """Whether lights are sampled at any surface."""
        return any(kind.smooth for kind in self.kinds)

    @property
    def delta(self) -> bool:
        """Whether there are mirrors or glass."""
        return any(kind.delta for kind in self.kinds)

    @property
    def chooses(self) -> bool:
        """Whether a delta lobe is chosen at random."""
        kinds = [kind for kind in self.kinds if kind.reflection is not None]
        return any(kind.smooth or kind.transmission is not None for kind in kinds)

    @property
    def oriented(self) -> bool:
        """Whether any BSDF looks at dp/du."""
        return any(kind.oriented for kind in self.kinds)

    @property
    def textured(self) -> bool:
        """Whether any BSDF looks at uv."""
        return any(is_textured(value) for _, value in self._parameters())

    def stages(self, shapes: Sequence[Shape]) -> NDArray[np.int32]:
        """Return the bits of what a hit on each shape needs next."""
        if len(self.kinds) > MOST_BSDF_KINDS:
            raise SceneError(
                f"the scene has {len(self.kinds)} kinds of BSDF; {MOST_BSDF_KINDS} are "
                "possible"
            )
        bit = {kind.name: FIRST_BSDF << k for k, kind in enumerate(self.kinds)}
        rows = []
        for shape in shapes:
            shown = {kind_of(side).name for side in sides(shape.bsdf) if side is not None}
            bits = ANY | (EMIT if shape.radiance is not None else 0)
            rows.append(bits | sum(bit[name] for name in shown))
        return np.array(rows or [0], np.int32)

    def _parameters(self) -> list[tuple[Any, Any]]:
        """Return (BSDF, value) of all parameters that each point has."""
        return [
            (bsdf, getattr(bsdf, name))
            for bsdf in self.bsdfs
            for name, _, _ in kind_of(bsdf).layout()
        ]

    def textures(self) -> list[Any]:
        """Return the distinct textures; their places are the texture ids."""
        found = {id(v): v for _, v in self._parameters() if is_textured(v)}
        return list(found.values())

    def values(self) -> NDArray[np.float32]:
        """Return the constant parameters, (rows, BSDFs)."""
        rows = max((kind.row_count for kind in self.kinds), default=1)
        table = np.zeros((max(rows, 1), max(len(self.bsdfs), 1)), np.float32)
        for k, bsdf in enumerate(self.bsdfs):
            for name, first, count in kind_of(bsdf).layout():
                table[first : first + count, k] = constant_of(getattr(bsdf, name), count)
        return table

    def tables_of(self, kind: BsdfKind) -> dict[str, NDArray[np.float32]]:
        """Return the tables of a kind by their names, (BSDFs, entries)."""
        tables = {}
        for name in kind.tables:
            rows = [getattr(b, name) if kind_of(b) is kind else None for b in self.bsdfs]
            entries = max(len(row) for row in rows if row is not None)
            rows = [np.zeros(entries) if row is None else row for row in rows]
            tables[name] = np.array(rows, np.float32)
        return tables

    def texture_ids(self) -> NDArray[np.int32]:
        """Return the texture of each parameter, (rows, BSDFs); -1 for constants."""
        ids = {id(texture): k for k, texture in enumerate(self.textures())}
        table = np.full(self.values().shape, -1, np.int32)
        for k, bsdf in enumerate(self.bsdfs):
            for name, first, _ in kind_of(bsdf).layout():
                table[first, k] = ids.get(id(getattr(bsdf, name)), -1)
        return table

    def look_ups(
        self, kinds: Sequence[BsdfKind | None], texture_kinds: Sequence[TextureKind]
    ) -> NDArray[np.int64]:
        """Return (kind of BSDF, kind of texture, first row, rows) of all that is textured.

        None in place of a kind: nobody needs its parameters.
        """
        rows: dict[tuple[int, int, int, int], None] = {}
        for k, kind in enumerate(kinds):
            for name, first, count in kind.layout() if kind else ():
                for bsdf in (b for b in self.bsdfs if kind_of(b) is kind):
                    of = texture_kind_of(getattr(bsdf, name))
                    if of in texture_kinds:
                        rows[k, texture_kinds.index(of), first, count] = None
        return np.array(sorted(rows), np.int64).reshape(-1, 4)
