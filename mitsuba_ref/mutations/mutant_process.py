"""The process of a mutant: renders what standard input asks for, a JSON line each."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np


def serve() -> None:
    """Answer each line until the input closes."""
    # Kernels may print: keep the real output for answers, send the rest to stderr.
    output = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    for line in sys.stdin:
        try:
            answer = _answer(json.loads(line))
        except Exception as error:  # whatever a defect brings about
            kind = type(error).__name__
            answer = {"error": " ".join(str(error).split())[:500], "kind": kind}
        output.write(json.dumps(answer) + "\n")
        output.flush()


def _answer(question: dict[str, Any]) -> dict[str, Any]:
    import renderer
    from mitsuba_ref.our_renderer.picture import render_ours
    from mitsuba_ref.records.request import RenderRequest

    if Path(renderer.__file__).resolve().parents[1] != Path.cwd().resolve():
        raise RuntimeError(f"{renderer.__file__} is not the mutant of {Path.cwd()}")
    picture = render_ours(RenderRequest(**question["request"]))
    arrays: dict[str, Any] = dict(picture.arrays)
    np.savez(question["path"], **arrays)
    return {
        "spp": picture.spp,
        "files": list(picture.files),
        "seconds": picture.seconds,
        "compile_seconds": picture.compile_seconds,
        "threads": picture.threads,
        "integrator": picture.integrator,
        "method": picture.method,
        "explain": picture.explain,
    }


if __name__ == "__main__":
    serve()
