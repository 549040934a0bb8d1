"""What a trace shows: both paths side by side, and a sentence on the first difference."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from mitsuba_ref.replay.paths.path_comparison import (
    Quantity,
    difference_sentence,
    error_text,
    first_difference,
    place,
    value_text,
)

MARK = "<-- first"


def print_paths(
    quantities: Sequence[Quantity],
    names: tuple[str, str],
    tolerance: float,
    out: Console,
    cause: str = "",
) -> None:
    """Print all quantities, bounce by bounce, the first difference marked.

    Parameters
    ----------
    quantities
        From `compare_paths`.
    names
        Of the two renderers, ours first.
    tolerance
        Relative error above which a quantity differs.
    out
        A console; in a pipe it gets plain text.
    cause
        What was measured about the first difference.
    """
    first = first_difference(quantities, tolerance)
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("quantity", no_wrap=True)
    for name in names:
        table.add_column(name, no_wrap=True, justify="right")
    table.add_column("error", no_wrap=True, justify="right")
    table.add_column("", no_wrap=True)
    bounce = None
    for index, quantity in enumerate(quantities):
        if quantity.bounce != bounce:
            bounce = quantity.bounce
            table.add_row(Text(place(bounce), style="bold"))
        style = "bold red" if index == first else None
        table.add_row(*_row(quantity, MARK if index == first else ""), style=style)
    out.print(table)
    sentence = difference_sentence(quantities, names, tolerance, cause)
    out.print(sentence, markup=False, soft_wrap=True)


def _row(quantity: Quantity, mark: str) -> list[str]:
    values = (value_text(quantity.ours), value_text(quantity.reference))
    return [f"  {quantity.name}", *values, error_text(quantity.error), mark]
