"""Reads what results.json says of a scene's replay and of its ladder of tests."""

from __future__ import annotations

from mitsuba_ref.records.results import DivergentPixel, ReplayResult, Rung
from mitsuba_ref.records.verdicts import VERDICTS
from reports.errors import ReportError
from reports.json_fields import JsonFields


def read_replay(fields: JsonFields) -> ReplayResult:
    """Read one replay; `passed` is taken back where the numbers say otherwise."""
    pixels, divergent = _count(fields, "pixels"), _count(fields, "divergent")
    if divergent > pixels:
        raise ReportError(f"{fields.where}.divergent: {divergent} of {pixels} pixels")
    allowed = _count(fields, "divergent_allowed")
    rmse, limit = fields.number("rmse"), fields.number("rmse_limit") or 0.0
    within = divergent <= allowed and rmse is not None and rmse <= limit
    passed = _judged(fields) and within
    verdict = fields.text("verdict", "pass" if passed else "fail")
    if verdict not in VERDICTS:
        raise ReportError(f"{fields.where}.verdict: {verdict!r} is not known")
    return ReplayResult(
        spp=_count(fields, "spp"),
        seed=_count(fields, "seed"),
        pixels=pixels,
        divergent=divergent,
        divergent_allowed=allowed,
        rmse=rmse,
        rmse_limit=limit,
        largest=fields.number("largest"),
        passed=passed,
        verdict="fail" if verdict == "pass" and not passed else verdict,
        sentence=fields.text("sentence"),
        seconds_ours=fields.number("seconds_ours"),
        seconds_reference=fields.number("seconds_reference"),
        listed=tuple(_pixel(one) for one in fields.objects("listed")),
    )


def read_rung(fields: JsonFields) -> Rung:
    """Read one rung."""
    return Rung(
        name=fields.text("name"),
        passed=_judged(fields),
        statistic=fields.number("statistic"),
        limit=fields.number("limit"),
        p_value=_share(fields, "p_value"),
        false_alarm_rate=_share(fields, "false_alarm_rate"),
        detectable_bias=fields.number("detectable_bias"),
        detectable=fields.text("detectable", ""),
        sentence=fields.text("sentence"),
    )


def _pixel(fields: JsonFields) -> DivergentPixel:
    relative = fields.number("relative")
    if relative is None:
        raise ReportError(f"{fields.where}.relative: expected a number, found nothing")
    return DivergentPixel(
        x=_count(fields, "x", None),
        y=_count(fields, "y", None),
        ours=fields.numbers("ours"),
        reference=fields.numbers("reference"),
        relative=relative,
        cause=fields.text("cause", ""),
    )


def _judged(fields: JsonFields) -> bool:
    passed = fields.flag("passed")
    if passed is None:
        raise ReportError(f"{fields.where}.passed: expected true or false, found nothing")
    return passed


def _count(fields: JsonFields, key: str, default: int | None = 0) -> int:
    value = fields.integer(key, default)
    if value < 0:
        raise ReportError(f"{fields.where}.{key}: expected 0 or more, found {value}")
    return value


def _share(fields: JsonFields, key: str) -> float | None:
    value = fields.number(key)
    if value is not None and not 0.0 <= value <= 1.0:
        raise ReportError(f"{fields.where}.{key}: expected 0 to 1, found {value}")
    return value
