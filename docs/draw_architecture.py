"""Draw docs/architecture.svg from the imports: what imports stands above what it imports.

Boxes are packages: `mitsuba_ref`, `reports` and the folders of `renderer`. Its single
files are names in grey on the row where they belong. There are no circles (`make lint`). An
arrow is drawn only where no way over other boxes says the same. `make docs` draws it
anew.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

import grimp
import numpy as np

PICTURE = Path(__file__).parent / "architecture.svg"
ROOTS = ("renderer", "mitsuba_ref", "reports")
WIDTH, ROW, BOX_WIDTH, BOX_HEIGHT, GAP = 960, 56, 122, 28, 18
FILES_FROM = 590  # x where the names of single files begin
LETTER = 6.7  # mean width of a letter of 11 px, to break lines

Graph = dict[str, set[str]]


def imports() -> tuple[Graph, set[str]]:
    """Return what each box or single file imports, and which of them are packages."""
    modules = grimp.build_graph(*ROOTS, cache_dir=None)

    def node(module: str) -> str:
        parts = module.split(".")
        return parts[1] if parts[0] == "renderer" and len(parts) > 1 else parts[0]

    graph: Graph = defaultdict(set)
    packages = {"mitsuba_ref", "reports"}
    for module in sorted(modules.modules):
        if module.startswith("renderer.") and module.count(".") > 1:
            packages.add(node(module))
        for imported in modules.find_modules_directly_imported_by(module):
            graph[node(module)].add(node(imported))
        graph[node(module)].discard(node(module))
    # the package's own __init__ imports and is imported by all: it is the door
    graph.pop("renderer")
    return {name: graph[name] - {"renderer"} for name in sorted(graph)}, packages


def reachable(graph: Graph) -> Graph:
    """Return all that each node imports, directly or over others."""
    reach = {name: set(graph[name]) for name in graph}
    for middle in graph:
        for name in graph:
            if middle in reach[name]:
                reach[name] |= reach[middle]
    return reach


def rows(reach: Graph, packages: set[str]) -> list[list[str]]:
    """Return the nodes from the top down; neighbours without a package are one row."""
    level: dict[str, int] = {}

    def height(name: str) -> int:
        if name not in level:
            level[name] = 1 + max(map(height, reach[name]), default=-1)
        return level[name]

    by_level = defaultdict(list)
    for name in reach:
        by_level[height(name)].append(name)
    merged: list[list[str]] = []
    for here in sorted(by_level, reverse=True):
        if merged and not packages & {*merged[-1]} and not packages & {*by_level[here]}:
            merged[-1] += by_level[here]
        else:
            merged.append(by_level[here])
    return merged


def arrows(reach: Graph, packages: set[str]) -> list[tuple[str, str]]:
    """Return the pairs of packages that no third package connects already."""
    above = {(a, b) for a in packages for b in reach[a] & packages}
    return sorted(
        (a, b)
        for a, b in above
        if not any((a, c) in above and (c, b) in above for c in packages)
    )


def lines_of(names: Iterable[str]) -> list[str]:
    """Break names, separated by commas, into lines that fit next to the boxes."""
    lines = [""]
    for name in names:
        if len(lines[-1] + name) * LETTER > WIDTH - FILES_FROM:
            lines.append("")
        lines[-1] += f"{name}, "
    return [line.rstrip(", ") for line in lines if line]


def _arrow(above: str, below: str, centers: dict[str, tuple[float, float]]) -> str:
    """Return the arrow between two boxes, through the nearest gap of the rows between."""
    (x0, y0), (x1, y1) = centers[above], centers[below]
    half = BOX_HEIGHT / 2
    ys = [y0 + half, y0 + ROW - half, y1 - ROW + half, y1 - half - 2]
    between = [
        (x, y + e) for x, y in centers.values() if y0 < y < y1 for e in (-half, half)
    ]

    def is_free(lane: float) -> bool:
        xs = [x0, lane, lane, x1]
        return all(abs(np.interp(y, ys, xs) - x) > BOX_WIDTH / 2 + 4 for x, y in between)

    lanes = sorted(range(0, FILES_FROM, 5), key=lambda lane: abs(2 * lane - x0 - x1))
    lane = next(filter(is_free, lanes), lanes[0])
    bend = f"L{lane} {ys[1]:g} L{lane} {ys[2]:g} " if between else ""
    return f'<path d="M{x0:g} {ys[0]:g} {bend}L{x1:g} {ys[3]:g}"/>'


def draw() -> str:
    """Return the picture as SVG text, the same for the same imports."""
    graph, packages = imports()
    reach = reachable(graph)
    centers: dict[str, tuple[float, float]] = {}
    boxes: list[str] = []
    layers = rows(reach, packages)
    for row, names in enumerate(layers):
        y = row * ROW + ROW / 2
        here = [name for name in names if name in packages]
        left = (FILES_FROM - GAP - len(here) * (BOX_WIDTH + GAP)) / 2
        for column, name in enumerate(here):
            x = left + column * (BOX_WIDTH + GAP) + (BOX_WIDTH + GAP) / 2
            centers[name] = x, y
            boxes.append(
                f'<rect x="{x - BOX_WIDTH / 2:g}" y="{y - BOX_HEIGHT / 2:g}" '
                f'width="{BOX_WIDTH}" height="{BOX_HEIGHT}" rx="4"/>'
                f'<text x="{x:g}" y="{y + 4:g}" text-anchor="middle">{name}</text>'
            )
        files = lines_of(name for name in names if name not in packages)
        for number, line in enumerate(files):
            top = y + 4 + (number - (len(files) - 1) / 2) * 14
            boxes.append(f'<text class="file" x="{FILES_FROM}" y="{top:g}">{line}</text>')
    lines = [_arrow(a, b, centers) for a, b in arrows(reach, packages)]
    return "\n".join([_HEAD.format(WIDTH, len(layers) * ROW), *lines, *boxes, "</svg>\n"])


_HEAD = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" \
font-family="sans-serif" font-size="13">
<title>Packages from the top down: each imports only what is below it</title>
<style>rect {{ fill: #eef3f8; stroke: #47617d }}
path {{ stroke: #8a9bb0; fill: none; marker-end: url(#tip) }}
.file {{ fill: #666; font-size: 11px }}
</style>
<marker id="tip" viewBox="0 0 6 6" refX="6" refY="3" markerWidth="7" markerHeight="7" \
orient="auto"><path d="M0 0 L6 3 L0 6 z" style="fill: #8a9bb0; stroke: none"/></marker>
<rect width="100%" height="100%" style="fill: #fff; stroke: none"/>"""


if __name__ == "__main__":
    sys.path.insert(0, str(PICTURE.parents[1]))  # of this clone, whatever is installed
    PICTURE.write_text(draw(), encoding="utf-8")
