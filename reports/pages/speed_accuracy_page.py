"""The page of speed against accuracy: one chart of all scenes, then one of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from reports.bench.intervals import mean_of_ratios
from reports.bench.rows import Row, Table
from reports.bench.study import Study
from reports.bench.timing import Interval
from reports.charts.curves import log_log_chart
from reports.charts.figure import Point, Series
from reports.charts.rows import ranked_chart
from reports.look.formatting import number, seconds
from reports.look.template import fill

OURS = "lightproof"
BEST = "the best of them in each scene"
# colour of a program; its contenders differ by their marks
COLOURS = {OURS: 0, "mitsuba scalar_rgb": 1, "mitsuba llvm_ad_rgb": 4, "cycles": 5}
OTHER_COLOUR = 3
SHOWN = 5  # lines of a chart; the others by a click on the legend
SMALL = 256  # [pixels] of a longer side below which fixed costs weigh much
SMALLEST = 1e-9  # of errors on a logarithmic axis: an exact picture has a place too


@dataclass(frozen=True)
class Curve:
    """One contender on a scene with noise."""

    name: str
    errors: list[Row]  # relative MSE, by samples per pixel
    seconds: list[Row]  # of the same pictures
    ratio: Row | None  # to the best peer, with most samples

    def worth(self, step: int) -> float:
        """Return 1 / (relative MSE x seconds)."""
        return 1.0 / (_number(self.errors[step]) * _number(self.seconds[step]))

    @property
    def program(self) -> str:
        """Return the renderer, without method and sampler."""
        program = self.name.partition(",")[0]
        return OURS if program.startswith(OURS) else program


@dataclass(frozen=True)
class Scene:
    """A scene with noise; its curves are sorted by their worth, best first."""

    name: str
    facts: dict[str, Row]
    curves: list[Curve]

    @property
    def ours(self) -> list[Curve]:
        """Our curves."""
        return [one for one in self.curves if one.program == OURS]

    @property
    def best(self) -> Curve:
        """Ours that is worth most with the second most samples.

        By the pictures with most, which the ratios are of, the luckiest would be chosen,
        and its luck be in the ratio. They decide only where there are no others.
        """
        step = -2 if len(self.curves[0].errors) > 1 else -1
        return max(self.ours, key=lambda one: one.worth(step))

    @property
    def best_peer(self) -> Curve | None:
        """The peer that is worth most."""
        return next((one for one in self.curves if one.program != OURS), None)

    @property
    def shown(self) -> list[str]:
        """Names of our best, our default, the best of each peer, at most `SHOWN`."""
        default = self.facts["default of ours"].value
        names = [self.best.name, *(one.name for one in self.ours if one.name == default)]
        programs = {one.program: one.name for one in reversed(self.curves)}
        names += [one.name for one in self.curves if programs[one.program] == one.name]
        peers = [name for name in dict.fromkeys(names) if not name.startswith(OURS)]
        return [*dict.fromkeys(names[:2]), *peers][:SHOWN]


@dataclass(frozen=True)
class Efficiency:
    """How many times a way of ours is worth the best peer, over scenes."""

    name: str
    scenes: int
    mean: float  # geometric
    interval: Interval
    worst: float
    worst_scene: str
    ahead: int  # scenes in which it is worth more


def speed_accuracy_page(name: str, study: Study, table: Table) -> str:
    """Return the page as HTML."""
    tables = {case: table.where(case=case) for case in table.distinct("case")}
    scenes = noisy_scenes(table)
    rows = sorted(_ranked(scenes), key=lambda row: -row[2])
    still = {case: t for case, t in tables.items() if t.where(quantity="error")}
    absent: dict[tuple[str, str], list[str]] = {}
    for row in table.where(quantity="unavailable"):
        absent.setdefault((row.contender, str(row.value)), []).append(row.case)
    sizes = [str(row.value) for row in table.where(quantity="size")]
    return fill(
        "speed/speed_accuracy.html",
        filters={"interval": interval_text},
        name=name,
        study=study,
        run=table.newest,
        faults=table.faults,
        efficiencies=efficiencies(scenes),
        ranking=ranked_chart(
            rows,
            x_label="times as fast as the best peer",
            description="How many times as fast as the best peer ours reaches the same "
            "error: " + ", ".join(f"{row[0]} {number(row[2])}" for row in rows),
        )
        if rows
        else None,
        scenes=[(scene, noisy_chart(scene), table_of(scene)) for scene in scenes],
        noiseless=[(case, *noiseless_chart(case, t)) for case, t in still.items()],
        pictures={row.case: row.value for row in table.where(quantity="picture")},
        absent=sorted(absent.items()),
        cases=len(tables),
        small=sum(max(map(int, size.split(" x "))) < SMALL for size in sizes),
    )


def noisy_scenes(table: Table) -> list[Scene]:
    """Return the scenes with noise."""
    measured = table.where(quantity="relative MSE").distinct("case")
    return [scene_of(table.where(case=case)) for case in measured]


def scene_of(table: Table) -> Scene:
    """Return a scene with noise from its rows."""
    by: dict[tuple[str, str], list[Row]] = {}
    for row in table:
        by.setdefault((row.contender, row.quantity), []).append(row)
    curves = [
        Curve(
            contender,
            errors,
            by[contender, "seconds"],
            next(iter(by.get((contender, "times as fast"), ())), None),
        )
        for (contender, quantity), errors in by.items()
        if quantity == "relative MSE"
    ]
    facts = {q: rows[0] for (contender, q), rows in by.items() if not contender}
    curves.sort(key=lambda one: -one.worth(-1))
    return Scene(table.rows[0].case, facts, curves)


def verdict(table: Table) -> str:
    """Say how many times as fast ours is at the same error."""
    for best in efficiencies(noisy_scenes(table))[:1]:
        return f"lightproof is {number(best.mean)} times as fast as the best peer."
    return ""


def efficiencies(scenes: Sequence[Scene]) -> list[Efficiency]:
    """Return our best of each scene, then each of our samplers, over all scenes.

    Methods other than that of the file are left out of the samplers' rows: few scenes have
    any. So are scenes that no peer can draw.
    """
    found: dict[str, list[tuple[Scene, Row]]] = {}
    for scene in scenes:
        method = str(scene.facts["default of ours"].value).partition(",")[0]
        samplers = [one for one in scene.ours if one.name.startswith(f"{method},")]
        for name, one in [
            (BEST, scene.best),
            *sorted((one.name.partition(", ")[2], one) for one in samplers),
        ]:
            if one.ratio is not None:
                found.setdefault(name, []).append((scene, one.ratio))
    return [_efficiency(name, pairs) for name, pairs in found.items()]


def _efficiency(name: str, pairs: Sequence[tuple[Scene, Row]]) -> Efficiency:
    ratios = [_number(row) for _, row in pairs]
    degrees = [int(_number(scene.facts["seeds"])) - 1 for scene, _ in pairs]
    mean, interval = mean_of_ratios(ratios, [_ends(row) for _, row in pairs], degrees)
    worst = min(ratios)
    name_of_worst = pairs[ratios.index(worst)][0].name
    ahead = sum(ratio > 1.0 for ratio in ratios)
    return Efficiency(name, len(ratios), mean, interval, worst, name_of_worst, ahead)


def _ranked(scenes: Sequence[Scene]) -> list[tuple[str, str, float, Interval, str, int]]:
    """Return scene, best peer's program, ratio, interval, tooltip and colour."""
    rows = []
    for scene in scenes:
        ratio, peer = scene.best.ratio, scene.best_peer
        if ratio is None or peer is None:
            continue
        value, ends = _number(ratio), _ends(ratio)
        rows.append(
            (
                scene.name,
                f"best peer: {peer.program}",
                value,
                ends,
                f"{scene.name}: {scene.best.name} is {number(value)} times as fast "
                f"({interval_text(ends)}) as {peer.name}",
                COLOURS.get(peer.program, OTHER_COLOUR),
            )
        )
    return rows


def noisy_chart(scene: Scene) -> Markup:
    """Draw seconds against error: our best, our default, the best peers; others hidden."""
    seen: dict[str, int] = {}
    series, shown = [], scene.shown
    for one in scene.curves:
        mark = seen[one.program] = seen.get(one.program, -1) + 1
        filling = 0 if one.program == OURS else 1
        series.append(
            Series(
                one.name,
                _points(one),
                6 * filling + mark % 6,
                colour=COLOURS.get(one.program, OTHER_COLOUR),
                visible=one.name in shown,
            )
        )
    return log_log_chart(
        sorted(series, key=lambda one: not one.visible),
        x_label="seconds",
        y_label="relative MSE",
        guide_slope=-1.0,
        height=480,
        description=f"Seconds against relative MSE on {scene.name}: " + ", ".join(shown),
    )


def _points(curve: Curve) -> tuple[Point, ...]:
    return tuple(
        Point(
            _number(time),
            max(_number(error), SMALLEST),
            tooltip=f"{curve.name}: {error.at:g} samples, {seconds(_number(time))}, "
            f"relative MSE {number(_number(error))} ({interval_text(_ends(error))})",
            x_range=_ends(time),
            y_range=_ends(error),
        )
        for error, time in zip(curve.errors, curve.seconds, strict=True)
    )


def table_of(scene: Scene) -> list[tuple[str, list[str]]]:
    """Return a name and the cells of each contender, best first."""
    found = []
    for one in scene.curves:
        error, time, ratio = one.errors[-1], one.seconds[-1], one.ratio
        cells = [f"{error.at:g}", seconds(_number(time)), number(_number(error))]
        cells.append(interval_text(_ends(error)))
        cells.append(number(_number(ratio)) if ratio else "")
        cells.append(interval_text(_ends(ratio)) if ratio else "")
        found.append((one.name, cells))
    return found


def noiseless_chart(case: str, table: Table) -> tuple[Markup, list[tuple[str, list[str]]]]:
    """Draw seconds against the distance to the truth; return the table, too."""
    errors = {row.contender: _number(row) for row in table.where(quantity="error")}
    off = {row.contender: _number(row) for row in table.where(quantity="pixels off")}
    families: dict[str, list[tuple[str, Row]]] = {}
    fastest: dict[float, Row] = {}  # at an error; named in the chart
    rows = []
    for row in sorted(table.where(quantity="seconds"), key=_number):
        family, _, structure = row.contender.rpartition(", ")
        if row.contender in errors:  # a peer
            family, structure = row.contender, ""
        families.setdefault(family, []).append((structure, row))
        fastest.setdefault(errors[family], row)
        time, error = seconds(_number(row)), number(errors[family])
        rows.append((row.contender, [time, error, f"{off[family]:g}"]))
    series: list[Series] = []
    for family, members in families.items():
        ours = family.startswith(OURS)
        program = OURS if ours else family.partition(",")[0]
        series.append(
            Series(
                family,
                tuple(
                    Point(
                        _number(row),
                        max(errors[family], SMALLEST),
                        structure if fastest[errors[family]] is row else "",
                        f"{row.contender}: {seconds(_number(row))}, error "
                        f"{number(errors[family])}, {off[family]:g} pixels off",
                        _ends(row),
                    )
                    for structure, row in members
                ),
                len(series) % 6 + (0 if ours else 6),
                connected=False,
                colour=COLOURS.get(program, OTHER_COLOUR),
            )
        )
    return (
        log_log_chart(
            series,
            x_label="seconds",
            y_label="error compared with the truth",
            guide_slope=None,
            height=480,
            description=f"Seconds against the distance to the truth on {case}, a point for "
            "each structure; a label names the fastest at its error.",
        ),
        rows,
    )


def interval_text(interval: Interval) -> str:
    """Return both ends of an interval."""
    return " to ".join(number(end) for end in interval)


def _number(row: Row) -> float:
    """Return the value of a row that holds a number."""
    return row.value if isinstance(row.value, float | int) else 0.0


def _ends(row: Row) -> Interval:
    return row.interval or (_number(row), _number(row))
