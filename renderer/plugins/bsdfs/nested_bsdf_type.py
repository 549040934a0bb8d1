"""Structures: a wrapper with all that is inside of it, which has a row of its own.

Such as "mask(blendbsdf(diffuse, conductor))". To the method tables a structure is a kind
like any other; what it is, follows from the kinds that it holds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from renderer.plugins.bsdfs.adapters import Wrapper
from renderer.plugins.bsdfs.kind import BsdfKind
from renderer.plugins.bsdfs.parameters import ROWS, Derivatives, Nested, hints_of


@dataclass(frozen=True)
class Structure:
    """A wrapper with what is inside of it: to the method tables a kind like any other."""

    wrapper: Wrapper
    inside: tuple[BsdfKind | Structure, ...]

    # nobody knows in what branches Whitted's trees should follow it
    reflection = transmission = None
    straight = False
    seen_albedo = True  # whatever is inside

    @property
    def name(self) -> str:
        """As of a function of what is inside."""
        return f"{self.wrapper.name}({', '.join(kind.name for kind in self.inside)})"

    @property
    def smooth(self) -> bool:
        """Whether lights are sampled at its points."""
        return any(kind.smooth for kind in self.inside)

    @property
    def delta(self) -> bool:
        """Whether it has lobes of a single direction."""
        return self.wrapper.passes or any(kind.delta for kind in self.inside)

    @property
    def chooses(self) -> bool:
        """Whether one of several delta lobes is chosen at random."""
        return self.delta

    @property
    def transmits(self) -> bool:
        """Whether light goes through."""
        return self.wrapper.passes or any(kind.transmits for kind in self.inside)

    @property
    def oriented(self) -> bool:
        """Whether the x axis of the local frame must be along dp/du."""
        return self.wrapper.oriented or any(kind.oriented for kind in self.inside)

    @property
    def albedo(self) -> Any:
        """The wrapper's kernel, None if there is nothing but black to be shown."""
        shows = any(kind.albedo is not None for kind in self.inside)
        return self.wrapper.albedo if shows else None

    @property
    def normal(self) -> Any:
        """The wrapper's kernel; Mitsuba shows none of those inside either."""
        return self.wrapper.normal

    @property
    def source(self) -> str:
        """As of a `BsdfKind`."""
        return " ".join(sorted({leaf.source for leaf in leaves_of(self)} - {""}))

    @property
    def tables(self) -> list[str]:
        """The names of the parameters that are tables, as in `layout`."""
        return [
            f"{field}.{name}"
            for field, kind in zip(self._fields, self.inside, strict=True)
            for name in kind.tables
        ]

    @property
    def _fields(self) -> list[str]:
        hints = hints_of(self.wrapper.parameters)
        return [name for name, hint in hints.items() if hint is Nested]

    def form(self, tables: dict[str, Any] | None = None) -> Any:
        """Return the record: None for what points have, or another record."""
        forms = {}
        for field, kind in zip(self._fields, self.inside, strict=True):
            start = f"{field}."
            own = {n.removeprefix(start): t for n, t in (tables or {}).items()}
            inside = {n: t for n, t in own.items() if start + n in (tables or {})}
            forms[field] = kind.form(inside)
        fields = self.wrapper.parameters._fields  # type: ignore[attr-defined]
        return self.wrapper.parameters(*(forms.get(name) for name in fields))

    def _rows(self) -> list[tuple[str, int, int]]:
        """Return (name, first row, rows), of what the surface gives too."""
        rows: list[tuple[str, int, int]] = []
        at, inside = 0, iter(self.inside)
        for name, annotation in hints_of(self.wrapper.parameters).items():
            if annotation is Nested:
                kind = next(inside)
                nested = kind._rows() if isinstance(kind, Structure) else kind.layout()
                rows += [(f"{name}.{n}", at + first, count) for n, first, count in nested]
                at += kind.row_count
            elif count := ROWS[annotation]:
                rows.append((name, at, count))
                at += count
        return rows

    def layout(self) -> list[tuple[str, int, int]]:
        """Return (name, first row, rows) of what a file gives; inside "child.name"."""
        return [row for row in self._rows() if row[2] != ROWS[Derivatives]]

    @property
    def derived(self) -> list[int]:
        """The first rows of what surfaces give."""
        return [first for _, first, count in self._rows() if count == ROWS[Derivatives]]

    @property
    def row_count(self) -> int:
        """Rows of all parameters."""
        return sum(count for _, _, count in self._rows())


def goes_straight(kind: BsdfKind | Structure) -> bool:
    """Return whether rays go straight on through a BSDF, or one inside of it."""
    if isinstance(kind, BsdfKind):
        return kind.straight
    return kind.wrapper.passes or any(goes_straight(nested) for nested in kind.inside)


def leaves_of(kind: BsdfKind | Structure) -> tuple[BsdfKind, ...]:
    """Return the kinds in a structure that nothing is inside of."""
    if isinstance(kind, BsdfKind):
        return (kind,)
    return tuple(leaf for nested in kind.inside for leaf in leaves_of(nested))
