"""Pieces of inline SVG that the charts share; every text passes through escaping.

Colours come from the page (`--series-0`, ...), so a chart follows dark mode; each series
also has its own marker and dash, so nothing depends on colour alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

WIDTH = 460.0  # [px] of the viewBox; small, so that text stays legible on a phone
LEFT, RIGHT, BOTTOM = 70.0, 14.0, 46.0
LETTER = 6.9  # [px] a little more than the mean width of a letter at 13 px

# used where no page sets others
_COLOURS = ("#00796b", "#882255", "#5f6368", "#8a6d00", "#1f5fa8", "#b4501e")
_DASHES = ("none", "7 3", "2 3", "9 3 2 3", "12 4", "5 2 1 2")
_MARKERS = (
    "M-4.5,0a4.5,4.5 0 1,0 9,0a4.5,4.5 0 1,0 -9,0z",  # circle
    "M-4,-4h8v8h-8z",  # square
    "M0,-5.5L5,4H-5z",  # triangle
    "M0,-5.5L5.5,0L0,5.5L-5.5,0z",  # diamond
    "M0,5.5L5,-4H-5z",  # triangle on its tip
    "M-1.5,-5h3v3.5h3.5v3h-3.5v3.5h-3v-3.5h-3.5v-3h3.5z",  # cross
)


@dataclass(frozen=True)
class Point:
    """One measurement; `label` is drawn beside it, `tooltip` shown on hover."""

    x: float
    y: float
    label: str = ""
    tooltip: str = ""


@dataclass(frozen=True)
class Series:
    """Points of one method, in their order."""

    name: str
    points: tuple[Point, ...]


def drawing(parts: Sequence[Markup], height: float, description: str) -> Markup:
    """Return the `<svg>` around the parts; `description` is for a screen reader."""
    return Markup(
        '<svg class="chart" viewBox="0 0 {:.0f} {:.0f}" role="img" aria-label="{}">\n'
        "{}\n</svg>"
    ).format(WIDTH, height, description, joined(parts))


def joined(parts: Sequence[Markup]) -> Markup:
    """Return the parts one a line."""
    return Markup("\n").join(parts)


def text(css: str, x: float, y: float, content: str, anchor: str = "start") -> Markup:
    """Return a text; `anchor` is start, middle or end."""
    return Markup(
        '<text class="{}" x="{:.2f}" y="{:.2f}" text-anchor="{}">{}</text>'
    ).format(css, x, y, anchor, content)


def line(css: str, start: tuple[float, float], end: tuple[float, float]) -> Markup:
    """Return a straight line."""
    return Markup(
        '<line class="{}" x1="{:.2f}" y1="{:.2f}" x2="{:.2f}" y2="{:.2f}"/>'
    ).format(css, *start, *end)


def bar(x: float, y: float, width: float, height: float, tooltip: str) -> Markup:
    """Return a filled rectangle; an empty tooltip gives none."""
    title = Markup("<title>{}</title>").format(tooltip) if tooltip else ""
    return Markup(
        '<rect class="bar" x="{:.2f}" y="{:.2f}" width="{:.2f}" height="{:.2f}">{}</rect>'
    ).format(x, y, width, height, title)


def polyline(index: int, places: Sequence[tuple[float, float]]) -> Markup:
    """Return the line of series `index` through `places`."""
    points = " ".join(f"{x:.2f},{y:.2f}" for x, y in places)
    return Markup('<polyline class="line" points="{}" stroke-dasharray="{}"/>').format(
        points, _DASHES[index % len(_DASHES)]
    )


def marker(index: int, x: float, y: float, tooltip: str) -> Markup:
    """Return a point of series `index`; an empty tooltip gives none."""
    title = Markup("<title>{}</title>").format(tooltip) if tooltip else ""
    return Markup(
        '<path class="marker" transform="translate({:.2f} {:.2f})" d="{}">{}</path>'
    ).format(x, y, _MARKERS[index % len(_MARKERS)], title)


def series_group(index: int, parts: Sequence[Markup]) -> Markup:
    """Return a group in the colour of series `index`; beyond the palette it starts over."""
    index %= len(_COLOURS)
    return Markup(
        '<g class="series" style="--colour: var(--series-{}, {})">\n{}\n</g>'
    ).format(index, _COLOURS[index], joined(parts))
