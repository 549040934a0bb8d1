"""Hand-made scenes of a results.json, and the pages that the studies draw of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from reports.bench.runner import Request, run_study
from reports.bench.store import Store
from reports.bench.study import find_study
from reports.command import draw
from reports.pages.index_page import index_page

SHAPE = (12, 16, 3)


def metric(
    value: float | None, tolerance: float | None, passed: bool | None
) -> dict[str, Any]:
    return {
        "value": value,
        "floor": 0.02,
        "tolerance": tolerance,
        "passed": passed,
        "meaning": "What it says.",
    }


def scene(name: str, verdict: str, **changes: Any) -> dict[str, Any]:
    """Return one entry of results.json; `changes` replace fields."""
    passed = verdict == "pass"
    entry = {
        "name": name,
        "title": f"Title of {name}",
        "shows": "What it shows.",
        "path": f"scenes/{name}/scene.xml",
        "integrator": "path",
        "reference_integrator": "path",
        "reference_note": "",
        "method": "bvh",
        "explain": "modelled: triangles",
        "width": SHAPE[1],
        "height": SHAPE[0],
        "spp": 16,
        "seed": 1,
        "deterministic": False,
        "verdict": verdict,
        "reasons": [] if passed else ["RMSE 0.5 is above 0.025"],
        "finite": {"ours_nan": 0, "ours_inf": 0, "reference_nan": 0, "reference_inf": 0},
        "metrics": {
            "rmse": metric(0.021 if passed else 0.5, 0.025, passed),
            "ssim": metric(0.95, None, None),
            "flip": metric(0.04, None, None),
        },
        "aovs": [
            {
                "name": "depth",
                "value": 1e-7,
                "tolerance": 1e-5,
                "passed": True,
                "meaning": "Distance.",
                "compared_pixels": 180,
                "edge_pixels": 12,
            }
        ],
        "seconds": {
            "ours": 0.31,
            "ours_compile": 2.5,
            "reference": 2.4,
            "ours_threads": 2,
            "reference_threads": 2,
        },
        "commands": {"ours": f"python -m renderer scenes/{name}/scene.xml"},
        "settings": {"film": "float32 instead of float16"},
        "images": {
            "ours": f"{name}/ours.npy",
            "reference": f"{name}/reference.npy",
            "reference_other_seed": f"{name}/other.npy",
        },
        "ladder": {
            "reference_spp": 1024,
            "note": "Measured in turn",
            "points": [
                {
                    "renderer": renderer,
                    "spp": spp,
                    "seconds": second * spp,
                    "rmse": 0.4 / spp**0.5,
                    "trimmed_rmse": 0.2 / spp**0.5,
                }
                for renderer, second in (("mitsuba scalar_rgb", 0.04), ("lightproof", 0.01))
                for spp in (4, 16, 64)
            ],
        },
    }
    return entry | changes


def stopped_scene(name: str) -> dict[str, Any]:
    """Return an entry for a scene that could not be rendered at all."""
    return {
        "name": name,
        "title": f"Title of {name}",
        "path": f"scenes/{name}/scene.xml",
        "verdict": "error",
        "reasons": ["scene.xml:14: bsdf 'principled' is not supported"],
        "images": {},
        "ladder": None,
    }


def write_results(folder: Path, scenes: list[dict[str, Any]]) -> Path:
    """Write results.json and the pictures it names; return its path."""
    noise = np.random.default_rng(7)
    for entry in scenes:
        light = np.linspace(0.1, 0.9, SHAPE[1], dtype=np.float32)[None, :, None]
        for name in entry["images"].values():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            pixels = light + 0.02 * noise.standard_normal(SHAPE, dtype=np.float32)
            if name.endswith("p_histogram.npy"):  # rows of lower end, upper end, count
                pixels = np.float32([[0.0, 0.5, 90.0], [0.5, 1.0, 102.0]])
            np.save(path, pixels.astype(np.float32))
    results = {
        "schema": 1,
        "created": "2026-01-02T03:04:05Z",
        "command": "python -m reports",
        "machine": {"cpu": "Example CPU", "cores": 2, "memory_gib": 8.0, "os": "Linux"},
        "versions": {"python": "3.11", "mitsuba": "3.9.1"},
        "commit": "0123abc",
        "scenes": scenes,
    }
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "results.json"
    path.write_text(json.dumps(results), encoding="utf-8")
    return path


def benchmark(**changes: Any) -> dict[str, Any]:
    """Return a benchmark.json; `changes` replace fields."""
    return {
        "schema": 1,
        "created": "2026-01-02T03:04:05Z",
        "command": "python -m reports benchmark",
        "commit": "0123abc",
        "machine": {"cpu": "Example CPU"},
        "versions": {"python": "3.11"},
        "scene": {"name": "cornell-box", "integrator": "path", "max_depth": 8},
        "width": 100,
        "height": 100,
        "spp": 100,
        "workers": 2,
        "rays_per_path": 8.0,
        "check": {
            "passed": True,
            "seeds": 8,
            "spp": 16,
            "z": [0.1, -0.5, 1.0],
            "limit": 5.0,
            "ours_mean": [0.25, 0.2, 0.1],
            "reference_mean": [0.25, 0.2, 0.1],
        },
        "renderers": [
            {"name": "lightproof", "seconds": [0.5, 0.4, 0.5]},
            {"name": "mitsuba scalar_rgb", "seconds": [4.0, 4.0, 3.5]},
            {"name": "mitsuba llvm_ad_rgb", "seconds": [], "unavailable": "no libLLVM"},
        ],
        "starts": {"warm": [1.5, 1.4], "cold": [31.0], "command": "python -m renderer"},
        "targets": {"speed_ratio": 6, "warm_seconds": 2, "cold_seconds": 30},
        **changes,
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
    pixels = SHAPE[0] * SHAPE[1]
    return {
        "spp": spp,
        "seed": 0,
        "pixels": pixels,
        "divergent": divergent,
        "divergent_allowed": 1,
        "rmse": 2.5e-7,
        "rmse_limit": 1e-5,
        "passed": divergent <= 1,
        "sentence": f"{pixels - divergent} of {pixels} pixels took the same paths",
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
    """Return a scene with two replays, a ladder and its maps."""
    shift = rung("registration", 1e-9, detectable="shift of the picture in pixels")
    entry = scene(name, verdict, ladder=None)
    files = ("replay_ours", "replay_reference", "p_map", "signed_error", "p_histogram")
    entry["images"] |= {kind: f"{name}/{kind}.npy" for kind in files}
    return entry | {
        "replay": [replay(1), replay(16)],
        "rungs": [shift, rung("pixels", 0.5), rung("mean", 0.02)],
        **changes,
    }


def compared(folder: Path, *scenes: dict[str, Any], study: str = "scenes") -> Store:
    """Let a study take hand-made scenes, and draw its pages and the index."""
    source = write_results(folder / "harness", list(scenes))
    store, found = Store(folder / "data", folder / "none"), find_study(study)
    cases = [entry["name"] for entry in scenes]
    options = {"from": str(source)}
    request = Request(store, [study], cases=cases, options=options, folder=folder)
    run_study(study, found, request, lambda stage: None)
    draw(study, found, store, folder)
    tables = {
        one: (find_study(one), store.read(one)) for one in dict.fromkeys(["scenes", study])
    }
    (folder / "index.html").write_text(index_page(tables, folder), encoding="utf-8")
    return store
