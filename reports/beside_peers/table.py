"""Pictures and rays beside peers as text: ours, and how many times as long others took."""

from __future__ import annotations

import statistics

from rich.console import Console
from rich.table import Table

from reports.beside_peers.record import PeersRecord, ratio
from reports.look import formatting
from reports.speed.table import print_circumstances


def print_peers(record: PeersRecord, console: Console) -> None:
    """Print both tables, why a peer was not timed, and where the numbers come from."""
    number = formatting.number
    if record.pictures:
        peers = [one.name for one in record.pictures[0].renderers[1:]]
        title = f"pictures, {record.threads} threads each: times as long as ours"
        table = _table(title, ["picture", "samples", "ours", *peers])
        for one in record.pictures:
            ours, *others = one.renderers
            table.add_row(
                f"{one.name}, {one.width} x {one.height}",
                str(one.spp),
                formatting.seconds(statistics.median(ours.seconds)),
                *(
                    number(ratio(other.seconds, ours.seconds)) if other.seconds else "-"
                    for other in others
                ),
            )
        console.print(table)
    if record.rays:
        peers = [name for one in record.rays for name in list(one.nanoseconds)[1:]]
        peers = list(dict.fromkeys(peers))
        title = "rays: times as long as ours"
        words = ["rays", "threads", "tests a ray", "ns a ray", *peers]
        table = _table(title, words)
        for rays in record.rays:
            mine, *_ = rays.nanoseconds.values()
            table.add_row(
                f"{rays.mesh}, {rays.kind}",
                str(rays.threads),
                number(rays.tests),
                number(statistics.median(mine)),
                *(
                    number(ratio(rays.nanoseconds[peer], mine))
                    if peer in rays.nanoseconds
                    else "-"
                    for peer in peers
                ),
            )
        console.print(table)
    for line in _absent(record):
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    print_circumstances(record, console)


def _table(title: str, columns: list[str]) -> Table:
    table = Table(title=title, title_justify="left")
    table.add_column(columns[0], no_wrap=True)
    for name in columns[1:]:
        table.add_column(name, justify="right")
    return table


def _absent(record: PeersRecord) -> list[str]:
    """Return why peers were not timed, each reason once."""
    reasons = [
        f"{renderer.name}: {renderer.unavailable}"
        for one in record.pictures
        for renderer in one.renderers
        if renderer.unavailable
    ]
    reasons += [f"{n}: {fault}" for one in record.rays for n, fault in one.faults.items()]
    return list(dict.fromkeys(reasons))
