"""Tables that lie in memory column by column: what kernels gather of one thing is together.

How they are gathered from is in `renderer.kernels.lanes.columns`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError

_FIELDS: dict[type, frozenset[str]] = {}
_MOST_NUMBERS = 2**31  # kernels count them in 32 bits
Record = TypeVar("Record")


def table_columns(*names: str) -> Callable[[type[Record]], type[Record]]:
    """Say which fields of a NamedTuple are tables (k, n) that columns are gathered from.

    Said of the class and not seen from the strides: NumPy takes one column for rows as
    well, and copies of a table forget how it lay.
    """

    def noted(record: type[Record]) -> type[Record]:
        _FIELDS[record] = frozenset(names)
        return record

    return noted


def by_columns(rows: Any) -> NDArray[Any]:
    """Return a table (k, n) of 32-bit numbers, one column after the other in memory.

    Doubles become single. Behind them is one more, of zeros: lanes without a thing of their
    own read column 0, which must be there.

    Raises
    ------
    SceneError
        For 2^31 numbers or more.
    """
    size, count = rows.shape
    if (count + 1) * size >= _MOST_NUMBERS:
        raise SceneError(f"a table of {count} times {size} numbers is too large: 2^31 fit")
    dtype = rows.dtype if rows.dtype.itemsize == 4 else np.float32
    table = np.zeros((count + 1, size), dtype)
    table[:count] = rows.T
    return table[:count].T


def column_fields(record: type) -> frozenset[str]:
    """Return the fields that `table_columns` names."""
    return _FIELDS.get(record, frozenset())


def lies_by_columns(table: NDArray[Any]) -> bool:
    """Return whether a table is one that `by_columns` has made."""
    return table.strides == (table.itemsize, table.itemsize * table.shape[0])
