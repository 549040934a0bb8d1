"""The figures that a page draws: what the script is given, read back from the HTML."""

from __future__ import annotations

import json
from html.parser import HTMLParser
from typing import Any

Figure = dict[str, Any]  # plotly's: "data", a list of traces, and "layout"


def figures(page: str) -> list[Figure]:
    """Return the figures of all charts in a piece of HTML, in their order."""
    found: list[Figure] = []

    class Reader(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            given = dict(attrs)
            if "data-figure" in given:
                assert given["role"] == "img"
                assert given["aria-label"]
                found.append(json.loads(given["data-figure"] or ""))

    Reader().feed(str(page))
    return found


def figure(chart: str) -> Figure:
    """Return the one figure in a piece of HTML."""
    (only,) = figures(chart)
    return only


def points(trace: dict[str, Any]) -> list[tuple[Any, Any]]:
    """Return the places of a trace's points, in the units of the axes."""
    return list(zip(trace["x"], trace["y"], strict=True))


def guides(chart: Figure) -> list[dict[str, Any]]:
    """Return the dotted lines that are no measurement."""
    return [trace for trace in chart["data"] if trace.get("hoverinfo") == "skip"]


def curves(chart: Figure) -> list[dict[str, Any]]:
    """Return the traces that answer to the mouse."""
    return [trace for trace in chart["data"] if trace.get("hoverinfo") != "skip"]
