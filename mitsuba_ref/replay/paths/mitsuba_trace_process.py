"""As a program: what Mitsuba's paths meet, as JSON lines for one scene."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from mitsuba_ref.reference.edited_scene import load_edited_scene
from mitsuba_ref.reference.render import camera_entries
from mitsuba_ref.reference.user_plugins import twins_explained
from mitsuba_ref.reference.variant import load_mitsuba
from mitsuba_ref.reference.variant_process import Answerer, answer_requests
from mitsuba_ref.replay.integrator_method import read_method
from mitsuba_ref.replay.paths.mitsuba_trace import MitsubaTracer
from mitsuba_ref.replay.paths.mitsuba_volpath import VolpathTracer
from renderer.replay.pixel_seeds import pixel_seeds


def tracer_of(
    scene: Any, spp: int, integrator: Any = None, densities: int = 3
) -> MitsubaTracer:
    """Return what traces a scene by an integrator, None for its own.

    Other parameters and errors are those of `MitsubaTracer` and `read_method`.
    """
    method = read_method(integrator or scene.integrator(), densities)
    return (VolpathTracer if method.media else MitsubaTracer)(scene, spp, method)


def start(job: dict[str, Any]) -> tuple[dict[str, Any], Answerer]:
    """Load the job's scene; return the camera's entries and what traces each request."""
    edited = load_edited_scene(
        Path(job["path"]),
        job["parameters"],
        box_filter=True,
        keep_shapes_apart=True,
        colors_alone=True,
        plugins=job["plugins"],
    )
    sensor = edited.scene.sensors()[0]
    spp = job["spp"] or sensor.sampler().sample_count()
    tracer = tracer_of(edited.scene, spp, densities=job["densities"])
    width, height = (int(n) for n in sensor.film().crop_size())
    seeds = pixel_seeds(width, height, job["seed"])

    def answer(wanted: dict[str, Any]) -> dict[str, Any]:
        x, y = wanted["pixel"]
        seed = int(seeds[y, x])
        with twins_explained(job["plugins"]):
            if wanted["sample"] is None:
                return {"paths": [asdict(path) for path in tracer.trace_all((x, y), seed)]}
            return asdict(tracer.trace((x, y), seed, wanted["sample"]))

    entries = camera_entries(load_mitsuba(), sensor)
    return {"camera": [float(entry) for entry in entries]}, answer


if __name__ == "__main__":
    answer_requests(start)
