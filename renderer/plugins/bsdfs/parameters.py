"""The parameters of BSDFs: how a kind annotates them, and how they are loaded at points.

A kind's parameters are a NamedTuple class. From its annotations a program writes the kernel
that loads them for 16 points at once (`make_loader`).
"""

from __future__ import annotations

import functools
import typing
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from renderer.kernels.jit import interface, kernel
from renderer.kernels.lanes.memory import gather_row, load_row
from renderer.kernels.lanes.vectors import load3, vec3


@functools.cache  # a scene asks for those of each BSDF a dozen times, 20 us each
def hints_of(parameters: type) -> Mapping[str, Any]:
    """Return the annotations of a kind's parameters by name."""
    return MappingProxyType(typing.get_type_hints(parameters))


class Color:
    """Annotation of a parameter: linear RGB in 16 lanes, constant or from a texture."""


class Float:
    """Annotation of a parameter: a number in 16 lanes, constant or from a texture."""


class Table:
    """Annotation of a parameter: numbers in a row, of each BSDF its own; see `entry_of`."""


class Rows(NamedTuple):
    """What kernels see of a `Table`; in the kind's record `first` is that of each BSDF."""

    numbers: Any  # (1, entries of all BSDFs), one behind the other
    first: Any  # where those of each point's BSDF begin


class Nested:
    """Annotation of a parameter that is a BSDF itself; these come last (`adapters.py`)."""


class Gradient:
    """Annotation of a parameter: how a texture's brightness changes with u and v."""


class Derivatives:
    """Annotation of a parameter that the surface gives: dp/du and dp/dv."""


class Surface:
    """Annotation of a parameter that is in the records of the surface points."""


# of the parameters that each point has
ROWS = {Color: 3, Gradient: 2, Float: 1, Derivatives: 6, Table: 0, Surface: 0}


@interface
def parameters_from(form: Any, points: Any, first: int, i: int) -> Any:
    """Return the parameters of points i to i + 15 that begin in row `first`."""


@interface
def rows_of(form: Any) -> int:
    """Return how many rows the parameters take."""


@kernel
def parameters_at(form, points, i):
    """Return the parameters of points i to i + 15, as a record of the kind's class."""
    return parameters_from(form, points, np.int64(0), i)


@kernel
def rows2(rows, first, i):
    """Load columns i to i + 15 of two rows."""
    return load_row(rows, first, i), load_row(rows, first + 1, i)


@kernel
def rows3(rows, first, i):
    """Load columns i to i + 15 of three rows as a vector of lanes."""
    return vec3(
        load_row(rows, first, i), load_row(rows, first + 1, i), load_row(rows, first + 2, i)
    )


@kernel
def entries_at(table, bsdf):
    """Return where the entries of each point's BSDF are."""
    return Rows(table.numbers, gather_row(table.first, 0, bsdf, bsdf >= 0))


@kernel
def entry_of(table, i):
    """Return entry i of the point's own rows of a `Table`, lane by lane."""
    return gather_row(table.numbers, 0, table.first + i, i >= 0)


def make_loader(parameters: type) -> tuple[Any, Any]:
    """Return `parameters_from` and `rows_of`, made from the annotations."""
    parts, rows, nested = [], 0, ""
    for name, kind in hints_of(parameters).items():
        if kind is Nested:
            parts.append(f"parameters_from(form.{name}, points, first + {rows}{nested}, i)")
            nested += f" + rows_of(form.{name})"
            continue
        row = f"points.parameters, first + {rows}"
        load = {
            Color: f"rows3({row}, i)",
            Float: f"load_row({row}, i)",
            Gradient: f"rows2({row}, i)",
            Derivatives: f"(rows3({row}, i), rows3({row} + 3, i))",
            Table: f"entries_at(form.{name}, load_row(points.bsdf, 0, i))",
            Surface: f"load3(points.{name}, i)",
        }
        parts.append(load[kind])
        rows += ROWS[kind]
    names = {
        "record": parameters,
        "load_row": load_row,
        "load3": load3,
        "rows2": rows2,
        "rows3": rows3,
        "entries_at": entries_at,
        "parameters_from": parameters_from,
        "rows_of": rows_of,
    }
    load_all = f"lambda form, points, first, i: record({', '.join(parts)})"
    count = f"lambda form: {rows}{nested}"
    return kernel(eval(load_all, names)), kernel(eval(count, names))
