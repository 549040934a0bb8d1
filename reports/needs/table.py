"""What a scene needs, as a table in the terminal."""

from __future__ import annotations

import textwrap

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from reports.needs.page import fewer, interval, percent, title_of
from reports.needs.record import Loss, SceneNeeds

# heading -> what stands there for what the scene has not
NOTHING = {
    "left out": "",
    "mean": "0",
    "loss": "0",
    "at most": "0",
    "FLIP": "0",
    "time": "1",
    "noise": "1",
    "fewer": "-",
}
WIDE = 100  # characters; on narrower terminals two columns are left to the page
LEFT_TO_THE_PAGE = ("FLIP", "fewer")


def print_table(needs: SceneNeeds, console: Console) -> None:
    """Print losses, what the plan says, and the command of the least model."""
    width, height = needs.size
    title = f"{title_of(needs)}: {width} x {height}, {needs.seeds} x {needs.spp} samples"
    table = Table(title=title, title_justify="left", box=SIMPLE, padding=(0, 0, 0, 1))
    shown = [h for h in NOTHING if console.width >= WIDE or h not in LEFT_TO_THE_PAGE]
    for heading in shown:
        if heading == "left out":
            table.add_column(heading, overflow="fold")
        else:
            table.add_column(heading, justify="right", no_wrap=True, overflow="fold")

    def add(words: str, cells: dict[str, str], *, dim: bool) -> None:
        row = cells | {"left out": words}
        table.add_row(*(row[h] for h in shown), style="dim" if dim else None)

    for loss in needs.losses:
        add(" ".join(loss.words), _cells(loss), dim=loss.error_high > needs.tolerance)
    for word in needs.absent:
        add(word, NOTHING, dim=True)
    if needs.least is not None:
        table.add_section()
        add("the least model", _cells(needs.least), dim=False)
    console.print(table)
    for claim in needs.claims:
        if claim.words or claim.at_its_word:
            said = f"exactly 0, as the plan says: {claim.text}"
            for line in textwrap.wrap(said, console.width - 2, subsequent_indent="  "):
                console.print(f"  {line}", markup=False, soft_wrap=True)
    console.print(needs.command, markup=False, soft_wrap=True)


def _cells(loss: Loss) -> dict[str, str]:
    return {
        "mean": interval(loss.mean, loss.mean_half_width),
        "loss": percent(loss.error),
        "at most": percent(loss.error_high),
        "FLIP": f"{loss.flip:.3f}",
        "time": f"{loss.time:.2f}",
        "noise": "-" if loss.noise is None else f"{loss.noise:.3g}",
        "fewer": fewer(loss.shared_variance),
    }
