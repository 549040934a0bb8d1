"""All mutations, read from the TOML files of this folder.

A table of a file is a mutation: its name is the header, its keys are the fields of
`Mutation`. `in`, `old` and `new` are one `Edit`. Several edits are an array of tables
`edits` with these keys. Keys above the first header are defaults for the file.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from mitsuba_ref.mutations.mutation import Mutation
from mitsuba_ref.mutations.source_edit import Edit

THEMES = (
    "transport",
    "lights",
    "materials",
    "rough_surfaces",
    "nested_bsdfs",
    "textures",
    "film",
    "geometry",
    "curves",
    "implicit_surfaces",
    "integrators",
    "media",
    "sun_and_sky",
    "spectra",
    "neutral_changes",
)


def read_mutations(path: Path) -> tuple[Mutation, ...]:
    """Return the mutations of a file, in its order."""
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    defaults = {key: value for key, value in content.items() if not isinstance(value, dict)}
    return tuple(
        _mutation(name, defaults | row)
        for name, row in content.items()
        if isinstance(row, dict)
    )


def _mutation(name: str, row: dict[str, Any]) -> Mutation:
    if "edits" not in row:
        row["edits"] = [{key: row.pop(key) for key in ("in", "old", "new")}]
    edits = tuple(Edit(edit["in"], edit["old"], edit["new"]) for edit in row.pop("edits"))
    return Mutation(name, edits=edits, tests=tuple(row.pop("tests", ())), **row)


CATALOGUE: tuple[Mutation, ...] = tuple(
    mutation
    for theme in THEMES
    for mutation in read_mutations(Path(__file__).with_name(f"{theme}.toml"))
)


def named(names: list[str]) -> list[Mutation]:
    """Return the mutations with these names, in the catalogue's order; all for no name.

    Raises
    ------
    KeyError
        For a name that does not exist, with those that do.
    """
    known = [mutation.name for mutation in CATALOGUE]
    unknown = [name for name in names if name not in known]
    if unknown:
        raise KeyError(f"no mutation {', '.join(unknown)}; there are: {', '.join(known)}")
    return [m for m in CATALOGUE if not names or m.name in names]
