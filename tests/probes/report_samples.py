"""A hand-made results.json: one scene that passes, one that fails, one that stopped."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

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
    path = folder / "results.json"
    path.write_text(json.dumps(results), encoding="utf-8")
    return path
