"""All mutations, by what they change."""

from __future__ import annotations

from mitsuba_ref.mutations import (
    defects_of_film,
    defects_of_geometry,
    defects_of_lights,
    defects_of_materials,
    defects_of_transport,
)
from mitsuba_ref.mutations.mutation import Mutation
from mitsuba_ref.mutations.neutral_changes import NEUTRAL_CHANGES

DEFECTS: tuple[Mutation, ...] = (
    *defects_of_transport.DEFECTS,
    *defects_of_lights.DEFECTS,
    *defects_of_materials.DEFECTS,
    *defects_of_film.DEFECTS,
    *defects_of_geometry.DEFECTS,
)
CATALOGUE: tuple[Mutation, ...] = DEFECTS + NEUTRAL_CHANGES


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
