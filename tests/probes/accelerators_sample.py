"""A hand-made accelerators.json: three structures, one peer there and one absent."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from reports.accelerator_study.record import AcceleratorStudy, read_accelerators

KINDS = ("camera", "shadow", "shadow_nearest", "diffuse", "random")
WIDTH, HEIGHT = 6, 4


def times(nanoseconds: float, threads: tuple[int, ...] = (1, 2)) -> dict[str, Any]:
    """Three rounds of each kind; any-hit rays take 0.7 of it, more threads divide it."""
    return {
        kind: {
            str(n): [
                nanoseconds * (0.7 if kind == "shadow" else 1.0) * turn / n
                for turn in (1.0, 1.1, 0.9)
            ]
            for n in threads
        }
        for kind in KINDS
    }


def structure(name: str, nanoseconds: float, **changes: Any) -> dict[str, Any]:
    work = {"nodes": 12.5, "boxes": 20.0, "primitives": 7.0, "saved": 1.5, "stack": 9}
    return {
        "name": name,
        "fault": "",
        "build_seconds": [0.25, 0.2],
        "bytes": 3 * 2**20,
        "depth": 17,
        "cost": 23.5,
        "work": dict.fromkeys(("camera", "shadow", "diffuse", "random"), work),
        "rays": dict.fromkeys(KINDS, 1024),
        "nanoseconds": times(nanoseconds),
    } | changes


def scene(name: str) -> dict[str, Any]:
    agreement = {"same_primitive": 0.9995, "same_distance": 1.0}
    return {
        "name": name,
        "title": f"Title of {name}",
        "about": "What it is for.",
        "triangles": 5002,
        "rays": dict.fromkeys(KINDS, 4096) | {"camera": 1024},
        "structures": [
            structure("brute", 5000.0, depth=None, cost=None),
            structure("quick-tree", 50.0),
            structure("slow-tree", 200.0),
        ],
        "peers": [
            {
                "name": "embreex",
                "fault": "not available: No module named 'embreex'",
                "build_seconds": [],
                "agreement": {},
                "nanoseconds": {},
            },
            {
                "name": "mitsuba llvm_ad_rgb",
                "fault": "",
                "build_seconds": [0.3, 0.4],
                "agreement": dict.fromkeys(KINDS, agreement)
                | {"shadow": {"same_distance": 1.0}},  # any hit has no primitive
                "nanoseconds": times(75.0),
            },
        ],
        "auto": {"1000000": "quick-tree", "100000000": "slow-tree"},
    }


def growth(name: str, power: float, stopped: str = "") -> dict[str, Any]:
    points = [
        {
            "triangles": n,
            "build_seconds": n * 1e-6,
            "bytes": 40 * n,
            "nanoseconds": {"camera": 0.4 * n**power, "random": 0.5 * n**power},
        }
        for n in (1000, 10_000, 100_000)
    ]
    return {"name": name, "stopped": stopped, "points": points}


def study(**changes: Any) -> dict[str, Any]:
    """Return accelerators.json; `changes` replace fields."""
    work = (np.arange(WIDTH * HEIGHT) * 3).reshape(HEIGHT, WIDTH).tolist()
    return {
        "schema": 2,
        "created": "2026-01-02T03:04:05Z",
        "command": "python -m reports.accelerators",
        "commit": "0123abc",
        "machine": {"cpu": "Example CPU"},
        "versions": {"python": "3.11"},
        "size": "quick",
        "threads": 2,
        "rounds": 3,
        "naive": "brute",
        "kinds": [{"name": k, "title": k, "about": f"about {k}"} for k in KINDS],
        "scenes": [scene("icosphere"), scene("stadium")],
        "figure": {
            "width": 1920,
            "height": 1080,
            "triangles": 6320,
            "rows": [
                {
                    "name": name,
                    "rays": rays,
                    "nanoseconds": {"1": each, "2": each / 2},
                    "tests": tests,
                }
                for name, rays, each, tests in (
                    ("brute", 20736, 2500.0, 6320.0),
                    ("quick-tree", 2073600, 25.0, 8.0),
                )
            ],
        },
        "maps": [
            {
                "scene": "stadium",
                "width": WIDTH,
                "height": HEIGHT,
                "maps": [
                    {"name": n, "mean": 34.5, "ball_tests": b, "work": work}
                    for n, b in (("quick-tree", 12.5), ("slow-tree", 4900.0))
                ],
            }
        ],
        "growth": {
            "title": "A growing ball",
            "kinds": ["camera", "random"],
            "memory_limit": 8 * 2**30,
            "peak_bytes": 2**31,
            "series": [
                growth("brute", 1.0),
                growth("quick-tree", 0.25),
                growth("slow-tree", 0.5, "1,000,000 triangles would build for about 9 s"),
            ],
        },
        "further": {},
        **changes,
    }


def write_study(folder: Path, **changes: Any) -> Path:
    path = folder / "accelerators.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(study(**changes)), encoding="utf-8")
    return path


def record(folder: Path, **changes: Any) -> AcceleratorStudy:
    return read_accelerators(write_study(folder, **changes))
