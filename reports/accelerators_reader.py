"""Reads accelerators.json into its records, trusting nothing in it."""

from __future__ import annotations

from pathlib import Path

from reports.accelerators_record import (
    SCHEMA,
    AcceleratorStudy,
    Figure,
    FigureRow,
    Growth,
    GrowthPoint,
    GrowthSeries,
    Kind,
    PeerRow,
    StructureRow,
    StudyScene,
    Times,
    Work,
    WorkMap,
    WorkMaps,
)
from reports.errors import ReportError
from reports.json_fields import JsonFields, load_json
from reports.packed_map import unpacked


def read_accelerators(path: Path) -> AcceleratorStudy:
    """Read and check accelerators.json.

    Raises
    ------
    ReportError
        One line: what is wrong and where.
    """
    top = load_json(path)
    schema = top.integer("schema")
    if schema != SCHEMA:
        raise ReportError(f"{path}: schema {schema}; this version reads schema {SCHEMA}")
    scenes = tuple(_scene(one) for one in top.objects("scenes"))
    if not scenes:
        raise ReportError(f"{path}: holds no scene")
    return AcceleratorStudy(
        created=top.text("created", ""),
        command=top.text("command", ""),
        commit=top.text("commit", "unknown"),
        machine=top.strings("machine"),
        versions=top.strings("versions"),
        size=top.text("size"),
        threads=top.integer("threads"),
        rounds=top.integer("rounds"),
        naive=top.text("naive"),
        kinds=tuple(
            Kind(one.text("name"), one.text("title"), one.text("about"))
            for one in top.objects("kinds")
        ),
        scenes=scenes,
        figure=_figure(top.object("figure")),
        maps=tuple(_maps(one) for one in top.objects("maps")),
        growth=_growth(top.object("growth")),
        further=top.object("further").data,
    )


def _scene(fields: JsonFields) -> StudyScene:
    rows = tuple(_structure(one) for one in fields.objects("structures"))
    if not rows:
        raise ReportError(f"{fields.where}: structures: there is none")
    return StudyScene(
        name=fields.text("name"),
        title=fields.text("title"),
        about=fields.text("about"),
        triangles=fields.integer("triangles"),
        rays=_integers(fields.object("rays")),
        structures=rows,
        peers=tuple(_peer(one) for one in fields.objects("peers")),
        auto={
            _whole(key, fields): fields.object("auto").text(key)
            for key in fields.object("auto").data
        },
    )


def _structure(fields: JsonFields) -> StructureRow:
    depth = fields.number("depth")
    return StructureRow(
        name=fields.text("name"),
        fault=fields.text("fault", ""),
        build_seconds=fields.numbers("build_seconds"),
        bytes=fields.integer("bytes"),
        depth=None if depth is None else round(depth),
        cost=fields.number("cost"),
        work={kind: _work(one) for kind, one in fields.named_objects("work")},
        rays=_integers(fields.object("rays")),
        nanoseconds=_times(fields),
    )


def _work(fields: JsonFields) -> Work:
    return Work(
        nodes=_number(fields, "nodes"),
        boxes=_number(fields, "boxes"),
        primitives=_number(fields, "primitives"),
        saved=_number(fields, "saved"),
        stack=fields.integer("stack"),
    )


def _peer(fields: JsonFields) -> PeerRow:
    agreement = dict(fields.named_objects("agreement"))

    def shares(key: str) -> dict[str, float]:
        return {
            kind: _number(one, key) for kind, one in agreement.items() if key in one.data
        }

    return PeerRow(
        name=fields.text("name"),
        fault=fields.text("fault", ""),
        build_seconds=fields.numbers("build_seconds"),
        same_primitive=shares("same_primitive"),
        same_distance=shares("same_distance"),
        nanoseconds=_times(fields),
    )


def _times(fields: JsonFields) -> Times:
    times: Times = {}
    for kind, by_threads in fields.named_objects("nanoseconds"):
        times[kind] = {
            _whole(threads, by_threads): _above_zero(by_threads, threads)
            for threads in by_threads.data
        }
    return times


def _growth(fields: JsonFields) -> Growth:
    return Growth(
        title=fields.text("title"),
        kinds=fields.texts("kinds"),
        memory_limit=fields.integer("memory_limit"),
        peak_bytes=fields.integer("peak_bytes"),
        series=tuple(
            GrowthSeries(
                one.text("name"),
                one.text("stopped", ""),
                tuple(_growth_point(point) for point in one.objects("points")),
            )
            for one in fields.objects("series")
        ),
    )


def _growth_point(fields: JsonFields) -> GrowthPoint:
    nanoseconds = fields.object("nanoseconds")
    return GrowthPoint(
        triangles=fields.integer("triangles"),
        build_seconds=_number(fields, "build_seconds"),
        bytes=fields.integer("bytes"),
        nanoseconds={kind: _number(nanoseconds, kind) for kind in nanoseconds.data},
    )


def _figure(fields: JsonFields) -> Figure | None:
    if not fields.data:
        return None
    return Figure(
        width=fields.integer("width"),
        height=fields.integer("height"),
        triangles=fields.integer("triangles"),
        rows=tuple(
            FigureRow(
                name=one.text("name"),
                rays=one.integer("rays"),
                nanoseconds={
                    _whole(threads, one): _number(one.object("nanoseconds"), threads)
                    for threads in one.object("nanoseconds").data
                },
                tests=_number(one, "tests"),
            )
            for one in fields.objects("rows")
        ),
    )


def _maps(fields: JsonFields) -> WorkMaps:
    width, height = fields.integer("width"), fields.integer("height")
    maps = []
    for one in fields.objects("maps"):
        work = one.text("work")
        try:
            unpacked(work, width, height)
        except ValueError as error:
            raise ReportError(f"{one.where}.work: {error}") from None
        maps.append(
            WorkMap(one.text("name"), _number(one, "mean"), one.number("ball_tests"), work)
        )
    return WorkMaps(fields.text("scene"), width, height, tuple(maps))


# ----------------------------------------------------------------------------- fields


def _number(fields: JsonFields, key: str) -> float:
    value = fields.number(key)
    if value is None:
        raise ReportError(f"{fields.where}.{key}: expected a number, found nothing")
    return value


def _above_zero(fields: JsonFields, key: str) -> tuple[float, ...]:
    values = fields.numbers(key)
    if not values or min(values) <= 0.0:
        raise ReportError(f"{fields.where}.{key}: expected times above 0, found {values}")
    return values


def _integers(fields: JsonFields) -> dict[str, int]:
    return {key: fields.integer(key) for key in fields.data}


def _whole(key: str, fields: JsonFields) -> int:
    if not key.isdecimal():
        raise ReportError(f"{fields.where}: expected a whole number as key, found {key!r}")
    return int(key)
