"""The page of the study of accelerators: a look inside first, then work, growth, times."""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from reports.bench.rows import Row, Table
from reports.bench.study import Study
from reports.charts.curves import log_log_chart
from reports.charts.figure import Point, Series
from reports.look import formatting
from reports.look.template import fill

INSIDE, MAPS, GROWTH, FIGURE = "look inside", "work per pixel", "growth", "a full screen"
KINDS = ("camera", "shadow", "diffuse", "random")
WORKLOAD = KINDS[:3]  # a picture's rays are thought of as one third each of these
BRUTE = "brute"
# drawn in the chart of growth until a reader picks others
FIRST_SHOWN = (BRUTE, "grid", "octree", "kd-sah", "wide")
# name -> what it is called, and what a reader can try
WORDS = Path(__file__).resolve().parents[1] / "templates/speed/structures.toml"
STRUCTURES: dict[str, dict[str, str]] = tomllib.loads(WORDS.read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Line:
    """One contender in the table of a mesh; `note` says why it has no times."""

    name: str
    is_peer: bool
    note: str
    build: float | None  # [s]
    memory: float | None  # [bytes]
    one: list[float | None]  # ns per ray by kind, one thread
    every: list[float | None]  # with all threads


class Rows:
    """The rows of a study by case, contender and quantity; those without a place."""

    def __init__(self, table: Table) -> None:
        self.table = table
        self.found = {(r.case, r.contender, r.quantity): r for r in table if r.at is None}

    def row(self, case: str, contender: str, quantity: str) -> Row | None:
        """Return a row, or None."""
        return self.found.get((case, contender, quantity))

    def value(self, case: str, contender: str, quantity: str) -> float | None:
        """Return a number, or None."""
        row = self.row(case, contender, quantity)
        return row.value if row and isinstance(row.value, int | float) else None

    def contenders(self, case: str) -> list[str]:
        """Return the contenders of a case, in the order of its rows."""
        return [name for name in self.table.where(case=case).distinct("contender") if name]


def accelerators_page(name: str, study: Study, table: Table) -> str:
    """Return the page as HTML."""
    rows = Rows(table)
    special = {INSIDE, MAPS, GROWTH, FIGURE}
    cases = [case for case in table.distinct("case") if case not in special]
    # the largest first: there structures differ most
    cases.sort(key=lambda case: -(rows.value(case, "", "triangles") or 0))
    return fill(
        "speed/accelerators.html",
        name=name,
        study=study,
        run=table.newest,
        faults=table.faults,
        setup=_setup(rows),
        titles={key: words["title"] for key, words in STRUCTURES.items()},
        rays=_rays(table),
        maps=_maps(rows),
        growth={
            title: chart
            for title in ("random rays", "camera rays", "build", "memory")
            if (chart := _growth_chart(table, title)) is not None
        },
        stopped=[row for row in table if row.quantity == "stopped"],
        kinds=KINDS,
        best=_best(rows, cases),
        meshes=[
            (case, rows.value(case, "", "triangles"), _lines(rows, case)) for case in cases
        ],
        work=[(case, _work(rows, case)) for case in cases],
        peers=_peers(rows, cases),
        totals=_totals(rows, cases),
        figure=_figure(rows),
        ball=_by_contender(rows, MAPS, "tests into the ball"),
    )


def _setup(rows: Rows) -> str:
    """Return what the viewer begins with as JSON; "" if nothing was measured for it."""
    files = {
        row.contender: row.value
        for row in rows.table.where(case=INSIDE)
        if row.quantity == "file"
    }
    if "scene" not in files:
        return ""
    counts = ("nodes", "box tests", "triangle tests")
    totals = {
        key: [
            [rows.value(INSIDE, key, f"{ray}: {count}") for count in counts]
            for ray in _rays(rows.table)
        ]
        for key in STRUCTURES
        if key in files and key != "bounding-volumes"
    }
    setup = {
        "files": files,
        "titles": {key: words["title"] for key, words in STRUCTURES.items()},
        "about": {key: words["about"] for key, words in STRUCTURES.items()},
        "totals": totals,
    }
    return json.dumps(setup, ensure_ascii=False)


def _rays(table: Table) -> list[str]:
    names = [row.quantity.partition(": ") for row in table.where(case=INSIDE)]
    return list(dict.fromkeys(ray for ray, colon, _ in names if colon))


def _maps(
    rows: Rows,
) -> list[tuple[str, float | None, list[tuple[str, str, float | None]]]]:
    """Return (mesh, most work, pictures: path, structure, mean) for each mesh."""
    found: dict[str, list[tuple[str, str, float | None]]] = {}
    for row in rows.table.where(case=MAPS, quantity="picture"):
        mesh, _, name = row.contender.partition(": ")
        mean = rows.value(MAPS, name, f"work, {mesh}")
        found.setdefault(mesh, []).append((str(row.value), name, mean))
    return [
        (mesh, rows.value(MAPS, "", f"most work, {mesh}"),
         sorted(pictures, key=lambda picture: picture[2] or math.inf))
        for mesh, pictures in found.items()
    ]  # fmt: skip


def _growth_chart(table: Table, quantity: str) -> Markup | None:
    grown = table.where(case=GROWTH, quantity=quantity)
    unit = next((row.unit for row in grown), "")
    series = []
    for name in grown.distinct("contender"):
        points = tuple(
            Point(row.at, row.value, tooltip=f"{name}, {row.at:,.0f} triangles: "
                  f"{formatting.number(row.value)} {unit}")
            for row in grown.curve(contender=name)
            if row.at and isinstance(row.value, int | float) and row.value > 0.0
        )  # fmt: skip
        if points:
            series.append(Series(name, points, visible=name in FIRST_SHOWN))
    if not series:
        return None
    says = f"{quantity} of each structure over the number of triangles."
    label = f"{quantity} [{unit}]"
    return log_log_chart(series, x_label="triangles", y_label=label, description=says,
                         guide_slope=None, height=460)  # fmt: skip


def _lines(rows: Rows, case: str) -> list[Line]:
    lines = []
    for name in rows.contenders(case):
        note = rows.row(case, name, "fault") or rows.row(case, name, "left out")
        times = [
            [rows.value(case, name, f"{kind} rays{suffix}") for kind in KINDS]
            for suffix in ("", ", all threads")
        ]
        lines.append(
            Line(
                name,
                name not in STRUCTURES,
                str(note.value) if note else "",
                rows.value(case, name, "build"),
                rows.value(case, name, "memory"),
                *times,
            )
        )
    return sorted(lines, key=lambda line: line.one[2] or math.inf)


def _best(rows: Rows, cases: list[str]) -> tuple[str, float | None, str, float] | None:
    """Return (largest mesh, triangles, fastest structure, times as fast as brute force)."""
    for case in cases:
        lines = [line for line in _lines(rows, case) if not line.is_peer and line.one[2]]
        brute = rows.value(case, BRUTE, "diffuse rays")
        if lines and brute and lines[0].one[2]:
            times = brute / lines[0].one[2]
            return case, rows.value(case, "", "triangles"), lines[0].name, times
    return None


def _work(rows: Rows, case: str) -> list[tuple[str, list[float | None]]]:
    """Return (structure, numbers): depth, SAH cost, then the counts of each kind."""
    counts = ("nodes", "box tests", "triangle tests", "tests saved", "stack")
    names = [f"{kind} rays: {count}" for kind in KINDS for count in counts]
    return [
        (name, [rows.value(case, name, one) for one in ("depth", "SAH cost", *names)])
        for name in rows.contenders(case)
        if rows.value(case, name, names[0]) is not None
    ]


def _peers(rows: Rows, cases: list[str]) -> list[tuple[str, str, str, list[Row | None]]]:
    """Return (mesh, peer, our fastest on diffuse rays, how many times as fast by kind)."""
    found = []
    for case in cases:
        ours = [line for line in _lines(rows, case) if not line.is_peer and line.one[2]]
        for peer in rows.contenders(case):
            times = [
                rows.row(case, ours[0].name, f"{kind} rays: times as fast as {peer}")
                for kind in KINDS
            ]
            if peer not in STRUCTURES and any(times):
                found.append((case, peer, ours[0].name, times))
    return found


def _totals(
    rows: Rows, cases: list[str]
) -> list[tuple[str, int, str, float, str, float | None]]:
    """Return (mesh, rays, best, its seconds, what auto takes, its seconds)."""
    found = []
    for case in cases:
        for row in rows.table.where(case=case, contender=""):
            if not row.quantity.startswith("auto takes, "):
                continue
            count = int(row.quantity.split()[2].replace(",", ""))
            seconds = {}
            for line in _lines(rows, case):
                times = line.every if all(line.every[:3]) else line.one
                if not line.is_peer and line.build and all(times[:3]):
                    each = sum(time or 0.0 for time in times[:3]) / len(WORKLOAD)
                    seconds[line.name] = line.build + 1e-9 * count * each
            if seconds:
                best = min(seconds, key=seconds.__getitem__)
                auto = str(row.value)
                found.append((case, count, best, seconds[best], auto, seconds.get(auto)))
    return found


def _figure(rows: Rows) -> list[tuple[str, list[float | None], float | None]]:
    """Return (structure, [tests a ray, seconds, with all threads], times brute force)."""
    slowest = rows.value(FIGURE, BRUTE, "whole picture")
    names = ("triangle tests of a ray", "whole picture", "whole picture, all threads")
    found = []
    for name in rows.contenders(FIGURE):
        values = [rows.value(FIGURE, name, one) for one in names]
        gain = slowest / values[1] if slowest and values[1] else None
        found.append((name, values, gain))
    return sorted(found, key=lambda row: row[1][1] or math.inf)


def _by_contender(rows: Rows, case: str, quantity: str) -> list[tuple[str, float]]:
    found = [(r.contender, r.value) for r in rows.table.where(case=case, quantity=quantity)]
    return sorted((n, v) for n, v in found if isinstance(v, int | float))
