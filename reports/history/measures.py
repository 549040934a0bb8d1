"""The few numbers of each record that are worth a curve over commits."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Content = dict[str, Any]


@dataclass(frozen=True)
class Measure:
    """One chart: some numbers of a record, in one unit."""

    record: str  # the file
    title: str
    unit: str
    values: Callable[[Content], dict[str, float]]  # by the name of the curve


def values_of(measure: Measure, content: Content) -> dict[str, float]:
    """Return the numbers of a record; what an older form of it lacks is left out."""
    try:
        found = measure.values(content)
    except (KeyError, TypeError, ValueError, IndexError, ZeroDivisionError):
        return {}
    return {name: value for name, value in found.items() if math.isfinite(value)}


def _caught(matrix: Content) -> dict[str, float]:
    harmful = [row for row in matrix["rows"] if row["harmful"]]
    return {
        "defects tried": len(harmful),
        "seen by a check": sum(row["caught_by"] is not None for row in harmful),
        "rows not as expected": sum(not row["as_expected"] for row in matrix["rows"]),
    }


def _alarms(study: Content) -> dict[str, float]:
    return {
        f"{one['scene']}, {one['comparison']}": max(
            100.0 * rung["alarms"]["count"] / rung["alarms"]["trials"]
            for rung in one["rungs"]
        )
        for one in study["comparisons"]
    }


def _register(register: Content) -> dict[str, float]:
    entries = register["entries"]
    held = sum(one["verdict"] == "still disagrees" for one in entries)
    return {"entries": len(entries), "still disagree": held}


def _right(calibration: Content) -> dict[str, float]:
    def share(scene: Content) -> float:
        pairs = list(zip(scene["claimed"], scene["true"], strict=True))
        return sum(abs(a - b) <= 0.2 * b for a, b in pairs) / len(pairs)

    shares = [share(scene) for scene in calibration["scenes"]]
    return {
        "mean of all scenes": 100.0 * statistics.fmean(shares),
        "worst scene": 100.0 * min(shares),
    }


def _speed(benchmark: Content) -> dict[str, float]:
    ours, *others = benchmark["renderers"]
    mine = statistics.median(ours["seconds"])
    return {
        one["name"]: statistics.median(one["seconds"]) / mine
        for one in others
        if one["seconds"]
    }


def _starts(benchmark: Content) -> dict[str, float]:
    starts = benchmark["starts"]
    return {name: statistics.median(starts[name]) for name in ("warm", "cold")}


def _compiling(times: Content) -> dict[str, float]:
    return {scene["scene"]: scene["seconds"] for scene in times["scenes"]}


def _structures(study: Content) -> dict[str, float]:
    rows = study["scenes"][0]["structures"]
    return {
        row["name"]: statistics.median(row["nanoseconds"]["diffuse"]["1"]) for row in rows
    }


def _limits(limits: Content) -> dict[str, float]:
    alarms = sum(row["verdict"] != "as said" for row in limits["rows"])
    return {"rows": len(limits["rows"]), "not as the atlas says": alarms}


def _needs(record: Content) -> dict[str, float]:
    least = [scene["least"] for scene in record["scenes"] if scene["least"]]
    times = [one["time"] for one in least]
    return {"mean over the scenes": statistics.geometric_mean(times)}


def _soaked(soak: Content) -> dict[str, float]:
    parts = soak["parts"].items()
    return {name: math.log10(part["done"]) for name, part in parts if part["done"]}


def _soak_faults(soak: Content) -> dict[str, float]:
    return {name: part["fault_count"] for name, part in soak["parts"].items()}


MEASURES = (
    Measure("matrix.json", "Mutations", "rows", _caught),
    Measure("false_alarms.json", "False alarms of the worst rung", "per cent", _alarms),
    Measure("register.json", "Known disagreements", "entries", _register),
    Measure("calibration.json", "Claimed errors that are right", "per cent", _right),
    Measure("benchmark.json", "Time of others, ours is 1", "ratio", _speed),
    Measure("benchmark.json", "Time of a start", "seconds", _starts),
    Measure("compile_times.json", "Compiling, scene by scene", "seconds", _compiling),
    Measure("accelerators.json", "Structures, diffuse rays", "ns a ray", _structures),
    Measure("limits.json", "The atlas of limits", "rows", _limits),
    Measure(
        "needs.json", "Time of the least model, the full scene's is 1", "ratio", _needs
    ),
    Measure("soak.json", "Soaked so far", "log10 of the count", _soaked),
    Measure("soak.json", "Faults found by soaking", "faults", _soak_faults),
)
