"""Reads the files behind the page "proof" into their records, trusting nothing in them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from mitsuba_ref.false_alarms.alarm_counts import FalseAlarms, RungAlarms
from mitsuba_ref.false_alarms.binomial import Rate
from mitsuba_ref.mutations.matrix import Row
from mitsuba_ref.mutations.rungs import Rung as Seen
from reports.errors import ReportError
from reports.json_fields import JsonFields, load_json
from reports.proof_record import (
    AlarmStudy,
    Circumstances,
    Ends,
    Matrix,
    ProofRecord,
    Register,
    RegisterEntry,
)
from reports.results import read_results

SCHEMA = 1
REGISTER, MATRIX, ALARMS = "register.json", "matrix.json", "false_alarms.json"

Part = TypeVar("Part")


def read_proof_record(source: Path) -> ProofRecord:
    """Read results.json, and the other files beside it or in the folder above.

    Raises
    ------
    ReportError
        One line: what is wrong and where.
    """
    return ProofRecord(
        results=read_results(source),
        register=_if_there(REGISTER, source.parent, read_register),
        matrix=_if_there(MATRIX, source.parent, read_matrix),
        alarms=_if_there(ALARMS, source.parent, read_alarms),
    )


def _if_there(name: str, folder: Path, read: Callable[[Path], Part]) -> Part | None:
    for place in (folder, folder.parent):
        if (place / name).exists():
            return read(place / name)
    return None


def read_register(path: Path) -> Register:
    """Read register.json; raise ReportError for what is wrong."""
    top = _top(path)
    entries = tuple(_entry(one) for one in top.objects("entries"))
    return Register(_circumstances(top), _some(entries, path, "entry"))


def _entry(fields: JsonFields) -> RegisterEntry:
    return RegisterEntry(
        name=fields.text("name"),
        what=fields.text("what"),
        reason=fields.text("reason"),
        expected=_needed(fields, "expected"),
        band=_ends(fields, "band"),
        agreement=_ends(fields, "agreement"),
        measured=fields.number("measured"),
        verdict=fields.text("verdict"),
    )


def _ends(fields: JsonFields, key: str) -> Ends:
    given = fields.data.get(key)
    if not isinstance(given, list) or len(given) != 2:
        raise ReportError(f"{fields.where}.{key}: expected a list of two ends")
    both = JsonFields({"low": given[0], "high": given[1]}, f"{fields.where}.{key}")
    return both.number("low"), both.number("high")


def read_matrix(path: Path) -> Matrix:
    """Read matrix.json; raise ReportError for what is wrong.

    What catches a mutation, and whether that is as expected, follows from its rungs.
    """
    top = _top(path)
    rows = tuple(_row(one) for one in top.objects("rows"))
    return Matrix(_circumstances(top), _some(rows, path, "row"))


def _row(fields: JsonFields) -> Row:
    return Row(
        mutation=fields.text("mutation"),
        does=fields.text("does"),
        harmful=_yes_or_no(fields, "harmful"),
        scene=fields.text("scene"),
        rungs=tuple(_seen(one) for one in fields.objects("rungs")),
        compile_seconds=fields.number("compile_seconds") or 0.0,
        remark=fields.text("remark", ""),
        broken=fields.texts("broken"),
    )


def _seen(fields: JsonFields) -> Seen:
    return Seen(
        name=fields.text("name"),
        caught=_yes_or_no(fields, "caught"),
        why=fields.text("why", ""),
        spp=fields.integer("spp") if fields.data.get("spp") is not None else None,
        seconds=_needed(fields, "seconds"),
        seeds=fields.integer("seeds", 1),
    )


def read_alarms(path: Path) -> AlarmStudy:
    """Read false_alarms.json; raise ReportError for what is wrong."""
    top = load_json(path)  # its first version has no schema
    found = tuple(_comparison(one) for one in top.objects("comparisons"))
    return AlarmStudy(
        _circumstances(top), top.integer("pairs"), _some(found, path, "comparison")
    )


def _comparison(fields: JsonFields) -> FalseAlarms:
    rungs = tuple(_rung_alarms(one) for one in fields.objects("rungs"))
    if not rungs:
        raise ReportError(f"{fields.where}.rungs: there is none")
    return FalseAlarms(
        scene=fields.text("scene"),
        comparison=fields.text("comparison"),
        width=fields.integer("width"),
        height=fields.integer("height"),
        spp=fields.integer("spp"),
        seeds=fields.integer("seeds"),
        rungs=rungs,
    )


def _rung_alarms(fields: JsonFields) -> RungAlarms:
    often = fields.data.get("below_often") is not None
    return RungAlarms(
        name=fields.text("name"),
        alarms=_rate(fields.object("alarms")),
        claimed=fields.number("claimed"),
        below_often=_rate(fields.object("below_often")) if often else None,
        detectable_bias=fields.number("detectable_bias"),
        detectable=fields.text("detectable", ""),
    )


def _rate(fields: JsonFields) -> Rate:
    count, trials = fields.integer("count"), fields.integer("trials")
    low, high = _needed(fields, "low"), _needed(fields, "high")
    if not (0 <= count <= trials and trials > 0 and 0.0 <= low <= high <= 1.0):
        raise ReportError(
            f"{fields.where}: {count} of {trials}, interval {low} to {high}: no share"
        )
    return Rate(count, trials, low, high)


def _top(path: Path) -> JsonFields:
    top = load_json(path)
    schema = top.integer("schema")
    if schema != SCHEMA:
        raise ReportError(f"{path}: schema {schema}; this version reads schema {SCHEMA}")
    return top


def _circumstances(top: JsonFields) -> Circumstances:
    return Circumstances(
        created=top.text("created", ""),
        command=top.text("command", ""),
        commit=top.text("commit", "unknown"),
        machine=top.strings("machine"),
        versions=top.strings("versions"),
    )


def _some(found: tuple[Part, ...], path: Path, called: str) -> tuple[Part, ...]:
    if not found:
        raise ReportError(f"{path}: holds no {called}")
    return found


def _needed(fields: JsonFields, key: str) -> float:
    value = fields.number(key)
    if value is None:
        raise ReportError(f"{fields.where}.{key}: expected a number, found nothing")
    return value


def _yes_or_no(fields: JsonFields, key: str) -> bool:
    value = fields.flag(key)
    if value is None:
        raise ReportError(f"{fields.where}.{key}: expected true or false, found nothing")
    return value
