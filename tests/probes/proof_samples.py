"""Hand-made records for the page "proof": scenes, register, matrix and false alarms."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from report_samples import SHAPE, scene, write_results

from reports.proof_page.record import (
    ALARMS,
    MATRIX,
    REGISTER,
    ProofRecord,
    read_proof_record,
)

PIXELS = SHAPE[0] * SHAPE[1]
MADE = {
    "created": "2026-01-02T03:04:05Z",
    "commit": "0123abc",
    "machine": {"cpu": "Example CPU"},
    "versions": {"python": "3.11"},
}


def replay(spp: int, divergent: int = 0, **changes: Any) -> dict[str, Any]:
    """Return one replay with so many divergent pixels, all of them listed."""
    pixel = {
        "y": 4,
        "ours": [0.5, 0.25, 0.125],
        "reference": [0.5, 0.25, 0.25],
        "relative": 0.25,
        "cause": "bounce 2: a shadow ray passes an edge by 3e-8",
    }
    return {
        "spp": spp,
        "seed": 0,
        "pixels": PIXELS,
        "divergent": divergent,
        "divergent_allowed": 1,
        "rmse": 2.5e-7,
        "rmse_limit": 1e-5,
        "largest": 1e-6,
        "passed": divergent <= 1,
        "sentence": f"{PIXELS - divergent} of {PIXELS} pixels took the same paths",
        "seconds_ours": 0.5,
        "seconds_reference": 1.25,
        "listed": [{"x": 3 + k, **pixel} for k in range(divergent)],
        **changes,
    }


def rung(name: str, bias: float | None = 0.04, **changes: Any) -> dict[str, Any]:
    """Return one rung that holds."""
    return {
        "name": name,
        "passed": True,
        "statistic": 1.5,
        "limit": 4.5,
        "p_value": 0.25,
        "false_alarm_rate": 0.001,
        "detectable_bias": bias,
        "detectable": "relative bias of the whole picture",
        "sentence": f"Rung {name} came out well.",
        **changes,
    }


def proven(name: str, verdict: str = "pass", **changes: Any) -> dict[str, Any]:
    """Return a scene with two replays, a ladder and all maps."""
    finite = rung("finite", None, p_value=None, detectable="a value that is no number")
    shift = rung("registration", 1e-9, detectable="shift of the picture in pixels")
    entry: dict[str, Any] = scene(name, verdict, ladder=None)
    files = ("replay_ours", "replay_reference", "p_map", "signed_error")
    files += ("p_histogram", "z_histogram")
    entry["images"] |= {kind: f"{name}/{kind}.npy" for kind in files}
    return entry | {
        "replay": [replay(1), replay(16)],
        "rungs": [finite, shift, rung("pixels", 0.5), rung("mean", 0.02)],
        **changes,
    }


def seen(name: str, caught: bool, **changes: Any) -> dict[str, Any]:
    """Return what one rung says of a mutation."""
    why = f"what {name} found" if caught else ""
    return {
        "name": name,
        "caught": caught,
        "why": why,
        "spp": 16,
        "seconds": 2.5,
        **changes,
    }


def mutation(name: str, *rungs: dict[str, Any], **changes: Any) -> dict[str, Any]:
    """Return a row of the matrix."""
    return {
        "mutation": name,
        "does": f"does {name}",
        "harmful": True,
        "scene": "cornell-box",
        "rungs": list(rungs),
        "compile_seconds": 9.0,
        "remark": "",
        "broken": [],
        **changes,
    }


def matrix(*rows: dict[str, Any]) -> dict[str, Any]:
    """Return a matrix.json; without rows one defect, one harmless change, one control."""
    found = [
        mutation("unchanged", seen("replay", False), harmful=False),
        mutation(
            "cosine-dropped",
            seen("runs", False),
            seen("replay", True, spp=1),
            seen("statistics", True, spp=64),
        ),
        mutation("worse-sah", seen("replay", False), harmful=False),
    ]
    command = "python -m mitsuba_ref.mutations"
    return {"schema": 1, **MADE, "command": command, "rows": list(rows) or found}


def rate(count: int, low: float, high: float) -> dict[str, Any]:
    return {"count": count, "trials": 200, "low": low, "high": high}


def alarms(low: float = 0.0) -> dict[str, Any]:
    """Return a false_alarms.json; the interval of the whole ladder begins at `low`."""
    pixels = {
        "name": "pixels",
        "alarms": rate(0, 0.0, 0.0183),
        "claimed": 0.001,
        "below_often": rate(11, 0.0277, 0.0962),
        "detectable_bias": 0.0456,
        "detectable": "relative bias of a single pixel of median noise",
    }
    whole = {"name": "whole ladder", "alarms": rate(1, low, 0.0275), "claimed": 0.007}
    comparison = {"scene": "cornell-box", "comparison": "Mitsuba against Mitsuba"}
    size = {"width": 32, "height": 32, "spp": 16, "seeds": 8}
    none = {"below_often": None, "detectable_bias": None, "detectable": ""}
    rungs = [pixels, {**whole, **none}]
    return {
        "versions": {"python": "3.11"},
        "pairs": 200,
        "comparisons": [{**comparison, **size, "rungs": rungs}],
    }


def entry(name: str, **changes: Any) -> dict[str, Any]:
    """Return an entry of the register that still disagrees."""
    return {
        "name": name,
        "what": f"what {name} measures",
        "reason": f"why {name} fails",
        "expected": 0.5,
        "band": [0.4, 0.6],
        "agreement": [0.9, None],
        "measured": 0.51,
        "verdict": "still disagrees",
        **changes,
    }


def register(*entries: dict[str, Any]) -> dict[str, Any]:
    """Return a register.json."""
    command = "python -m mitsuba_ref.expected_failures"
    found = list(entries) or [entry("far spheres"), entry("caustic")]
    return {"schema": 1, **MADE, "command": command, "entries": found}


def write_proof(folder: Path, *scenes: dict[str, Any], **files: dict[str, Any]) -> Path:
    """Write results.json with its maps, and other records by name; return the path."""
    given = list(scenes) or [proven("box")]
    path = write_results(folder, given)
    for one in given:
        if "p_map" in one["images"]:
            write_maps(folder, one["images"])
    for name, content in files.items():
        (folder / f"{name}.json").write_text(json.dumps(content), encoding="utf-8")
    return path


def write_maps(folder: Path, images: dict[str, str]) -> None:
    """Write even p-values, histograms, and equal pictures of the replay."""
    p = np.linspace(1e-3, 1.0, PIXELS * 3, dtype=np.float32).reshape(SHAPE)
    np.save(folder / images["p_map"], p)
    np.save(folder / images["replay_reference"], np.load(folder / images["replay_ours"]))
    for kind, low, high, counts in (
        ("p_histogram", 0.0, 1.0, [50, 30, 30, 30]),
        ("z_histogram", -2.0, 2.0, [20, 50, 50, 20]),
    ):
        edges = np.linspace(low, high, 5)
        rows = np.column_stack([edges[:-1], edges[1:], counts])
        np.save(folder / images[kind], rows.astype(np.float32))


def record(folder: Path, *scenes: dict[str, Any], **files: dict[str, Any]) -> ProofRecord:
    """Write and read a whole proof; `matrix`, `register`, `false_alarms` replace parts."""
    parts = {"matrix": matrix(), "register": register(), "false_alarms": alarms()} | files
    assert {f"{name}.json" for name in parts} == {MATRIX, REGISTER, ALARMS}
    return read_proof_record(write_proof(folder, *scenes, **parts))
