"""The process of a mutant: renders each request into the file that it names."""

from __future__ import annotations

import resource
import time
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.json_process import Answerer, answer_requests

PROCESSOR_LIMIT = 200
"""Seconds of processor time for one picture: a defect may make a loop endless. Compiling
takes up to 60, and on a busy machine a time limit by the clock would end sound mutants."""


def load(job: dict[str, Any]) -> tuple[dict[str, Any], Answerer]:
    """Return what renders; the renderer is imported with the first picture."""

    def render(wanted: dict[str, Any]) -> dict[str, Any]:
        import renderer
        from mitsuba_ref.our_renderer.picture import render_ours

        most = int(time.process_time()) + PROCESSOR_LIMIT
        resource.setrlimit(resource.RLIMIT_CPU, (most, resource.RLIM_INFINITY))
        if Path(renderer.__file__).resolve().parents[1] != Path.cwd().resolve():
            raise ImportError(f"{renderer.__file__} is not the mutant of {Path.cwd()}")
        # defects of the renderer as it is used: with its own choice of lights
        answer = vars(render_ours(RenderRequest(**wanted["request"]), light_choice=None))
        arrays: dict[str, Any] = answer.pop("arrays")
        np.savez(wanted["path"], **arrays)
        return answer

    return {}, render


if __name__ == "__main__":
    answer_requests(load)
