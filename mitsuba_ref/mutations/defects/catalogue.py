"""All mutations, by what they change."""

from __future__ import annotations

from mitsuba_ref.mutations.defects import (
    film,
    geometry,
    implicit_surfaces,
    integrators,
    lights,
    transport,
)
from mitsuba_ref.mutations.defects.neutral_changes import NEUTRAL_CHANGES
from mitsuba_ref.mutations.defects.surfaces import (
    materials,
    nested_bsdfs,
    rough_surfaces,
    spectra,
    textures,
)
from mitsuba_ref.mutations.mutation import Mutation

DEFECTS: tuple[Mutation, ...] = (
    *transport.DEFECTS,
    *lights.DEFECTS,
    *materials.DEFECTS,
    *rough_surfaces.DEFECTS,
    *nested_bsdfs.DEFECTS,
    *textures.DEFECTS,
    *film.DEFECTS,
    *geometry.DEFECTS,
    *implicit_surfaces.DEFECTS,
    *integrators.DEFECTS,
    *spectra.DEFECTS,
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
