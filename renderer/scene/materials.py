"""BSDFs and textures of a scene as tables, and the BSDFs of each shape."""

from __future__ import annotations

import operator
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.kernels.jit import by_columns
from renderer.kernels.records.kernel_scene import (
    ANY,
    EMIT,
    FIRST_BSDF,
    LOOK_UP_COLOR,
    LOOK_UP_GRADIENT,
    LOOK_UP_SCALAR,
    MOST_BSDF_KINDS,
)
from renderer.plugins.bsdfs.kind import BsdfKind
from renderer.plugins.bsdfs.parameters import Rows
from renderer.plugins.bsdfs.registry import BSDFS
from renderer.plugins.bsdfs.registry import kind_of as kind_of
from renderer.plugins.textures.checkerboard import children
from renderer.plugins.textures.kind import TextureKind
from renderer.plugins.textures.registry import kind_of_texture, mean_of
from renderer.plugins.textures.uniform import UNIFORM
from renderer.scene.light_order import light_order
from renderer.scene_file.description import (
    Bsdf,
    CheckerboardTexture,
    ConstantTexture,
    SceneDescription,
    Shape,
    TwoSided,
)

# number of rows of a parameter -> the method that looks up its texture
_REQUESTS = {3: LOOK_UP_COLOR, 2: LOOK_UP_GRADIENT, 1: LOOK_UP_SCALAR}


def sides(bsdf: Bsdf) -> tuple[Any, Any]:
    """Return the BSDFs of the front and the back of a shape; None is black.

    Nested BSDFs handle both sides themselves.
    """
    if isinstance(bsdf, TwoSided):
        both = bsdf.front, bsdf.back
        nested = any(kind_of(side).inside for side in both)
        return (bsdf, bsdf) if nested else both
    kind = kind_of(bsdf)
    return bsdf, bsdf if kind.both_sides else None


def value_of(bsdf: Any, name: str) -> Any:
    """Return a parameter by its name in the kind's layout."""
    return operator.attrgetter(name)(bsdf)


def is_textured(value: Any) -> bool:
    """Return whether a parameter varies over a surface."""
    return kind_of_texture(value) not in (None, UNIFORM)


def leaves(texture: Any) -> Iterator[Any]:
    """Yield the textures that may be looked up for a parameter, inside nested ones."""
    nested = children(texture) if isinstance(texture, CheckerboardTexture) else None
    for part in nested or ():
        yield from leaves(part)
    if nested is None:
        yield texture


def table_of(texture: Any) -> tuple[TextureKind, Any]:
    """Return the kind of a texture, and the key of its table within the kind."""
    kind = kind_of_texture(texture)
    assert kind is not None
    return kind, kind.group(texture)


def constant_of(value: Any, rows: int) -> Any:
    """Return a parameter as `rows` numbers; 0 if it is textured."""
    if is_textured(value):
        return np.zeros(rows)
    if isinstance(value, ConstantTexture):
        value = value.rgb if rows == 3 else mean_of(value)
    return np.broadcast_to(np.asarray(value, np.float64), rows)


@dataclass
class MaterialTables:
    """The distinct BSDFs of a scene and, for each shape, the ids of its two sides."""

    bsdfs: list[Any] = field(default_factory=list)
    front: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    back: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    light: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    loaded: list[BsdfKind] = field(default_factory=list)  # kind of each BSDF when built

    @classmethod
    def of(cls, description: SceneDescription) -> MaterialTables:
        """Collect the BSDFs and the ids of the area lights."""
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
        tables.loaded = [kind_of(bsdf) for bsdf in tables.bsdfs]
        tables.front = np.array(front or [-1], np.int32)
        tables.back = np.array(back or [-1], np.int32)
        tables.light = np.full(max(len(front), 1), -1, np.int32)
        tables.light[: len(description.shapes)] = light_order(description).of_shapes
        return tables

    @property
    def kinds(self) -> list[BsdfKind]:
        """Kinds that occur: those with smooth lobes first, else in order of registration.

        Wrappers with nested BSDFs follow; each different structure is a kind.
        """
        found = [kind_of(bsdf) for bsdf in self.bsdfs]
        for kind, loaded in zip(found, self.loaded or found, strict=True):
            if kind != loaded:  # the tables were built for an older registration
                raise SceneError(
                    f"BSDF {kind.name!r} was registered anew after the scene was loaded; "
                    "load it again"
                )
        present = {kind.name: kind for kind in found}
        known = list(BSDFS)
        listed = sorted(
            present.values(),
            key=lambda k: (known.index(k.name) if k.name in known else len(known), k.name),
        )
        return sorted(listed, key=lambda kind: not kind.smooth)

    @property
    def smooth(self) -> bool:
        """Whether any BSDF has smooth lobes, so that light samples are taken."""
        return any(kind.smooth for kind in self.kinds)

    @property
    def delta(self) -> bool:
        """Whether any BSDF has delta lobes."""
        return any(kind.delta for kind in self.kinds)

    @property
    def straight(self) -> bool:
        """Whether any BSDF transmits rays straight through."""
        return any(kind.straight for kind in self.kinds)

    @property
    def half_open(self) -> bool:
        """Whether any BSDF has both smooth lobes and straight transmission."""
        return any(kind.smooth and kind.straight for kind in self.kinds)

    @property
    def chooses(self) -> bool:
        """Whether any BSDF selects a delta lobe at random."""
        return any(kind.chooses for kind in self.kinds)

    @property
    def oriented(self) -> bool:
        """Whether any BSDF is anisotropic, so that dp/du is needed."""
        return any(kind.oriented for kind in self.kinds)

    @property
    def textured(self) -> bool:
        """Whether any BSDF depends on uv."""
        return any(is_textured(value) for value in self._parameters())

    def stages(self, shapes: Sequence[Shape]) -> NDArray[np.int32]:
        """Return the bits that tell which stages follow a hit, by shape."""
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

    def parameters_of(self, bsdf: Any) -> list[tuple[Any, int]]:
        """Return (value, rows) of all parameters of a BSDF that are stored per point."""
        return [(value_of(bsdf, name), rows) for name, _, rows in kind_of(bsdf).layout()]

    def _parameters(self) -> list[Any]:
        return [value for b in self.bsdfs for value, _ in self.parameters_of(b)]

    def textures(self) -> list[Any]:
        """Return the distinct textures; their indices are the texture ids."""
        found: dict[int, Any] = {}

        def collect(texture: Any) -> None:
            if id(texture) not in found:
                found[id(texture)] = texture
                if isinstance(texture, CheckerboardTexture):
                    for part in children(texture) or ():
                        collect(part)

        for value in self._parameters():
            if is_textured(value):
                collect(value)
        return list(found.values())

    def values(self) -> NDArray[np.float32]:
        """Return the constant parameters, (rows, BSDFs), padded to four rows."""
        rows = max((kind.row_count for kind in self.kinds), default=1)
        fours = -(-max(rows, 1) // 4)
        table = np.zeros((4 * fours, max(len(self.bsdfs), 1)), np.float32)
        for k, bsdf in enumerate(self.bsdfs):
            for name, first, count in kind_of(bsdf).layout():
                table[first : first + count, k] = constant_of(value_of(bsdf, name), count)
        return by_columns(table)

    def tables_of(self, kind: BsdfKind) -> dict[str, Rows]:
        """Return the tables of a kind by name; tables shared by BSDFs are stored once."""
        tables = {}
        for name in kind.tables:
            parts: list[NDArray[np.float32]] = []
            at, end = {}, 0
            first = np.zeros((1, len(self.bsdfs)), np.int32)
            for k, bsdf in enumerate(self.bsdfs):
                if kind_of(bsdf) != kind:
                    continue
                entries = value_of(bsdf, name)
                if id(entries) not in at:
                    at[id(entries)], end = end, end + len(entries)
                    parts.append(np.asarray(entries, np.float32))
                first[0, k] = at[id(entries)]
            tables[name] = Rows(np.concatenate(parts)[None], first)
        return tables

    def texture_ids(self) -> NDArray[np.int32]:
        """Return the texture of each parameter, (rows, BSDFs); -1 for constants."""
        ids = {id(texture): k for k, texture in enumerate(self.textures())}
        table = np.full(self.values().shape, -1, np.int32)
        for k, bsdf in enumerate(self.bsdfs):
            for name, first, _ in kind_of(bsdf).layout():
                table[first, k] = ids.get(id(value_of(bsdf, name)), -1)
        return table

    def look_ups(
        self, kinds: Sequence[BsdfKind | None], tables: Sequence[tuple[TextureKind, Any]]
    ) -> NDArray[np.int64]:
        """Return (kind of BSDF, texture table, first row, request) of textured parameters.

        An entry of `kinds` is None if no parameters of that kind are needed.
        """
        rows: dict[tuple[int, int, int, int], None] = {}
        for k, kind in enumerate(kinds):
            for name, first, count in kind.layout() if kind else ():
                request = _REQUESTS[count]
                values = [value_of(b, name) for b in self.bsdfs if kind_of(b) == kind]
                for texture in (v for v in values if is_textured(v)):
                    for leaf in leaves(texture):
                        rows[k, tables.index(table_of(leaf)), first, request] = None
        return np.array(sorted(rows), np.int64).reshape(-1, 4)
