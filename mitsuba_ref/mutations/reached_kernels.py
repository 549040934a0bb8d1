"""Which kernels a scene compiles: those of the others cannot change its picture.

Numba compiles what is called, so a process with an empty cache that renders the scene
knows all kernels that the scene needs. `python -m ... SCENE.xml` prints their names.
"""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from mitsuba_ref.mutations.mutation import sources_hash
from mitsuba_ref.mutations.rungs import WITHOUT_REPLAY
from mitsuba_ref.records.json_files import from_json, write_atomically
from mitsuba_ref.records.options import scene_request
from mitsuba_ref.records.proof_file import read_proof
from mitsuba_ref.records.request import RenderRequest
from renderer.process.cache_folder import cache_folder


def picture_request(scene: Path) -> RenderRequest:
    """Return the request of the picture that must change, at the scene's test size."""
    return scene_request(scene, read_proof(scene), WITHOUT_REPLAY)


def reached_kernels(scene: Path) -> frozenset[str]:
    """Return the kernels of a scene, "plugins.bsdfs.diffuse.eval_pdf"; kept until a change.

    Raises
    ------
    RuntimeError
        If the scene cannot be rendered.
    """
    kept = cache_folder("mutants") / f"reached-{scene.parent.name}-{scene.stem}.json"
    state = sources_hash({})
    if kept.is_file():
        known = from_json(kept.read_bytes(), dict[str, list[str]])
        if state in known:
            return frozenset(known[state])
    with tempfile.TemporaryDirectory() as empty:
        environment = {**os.environ, "LIGHTPROOF_CACHE": empty, "NUMBA_OPT": "1"}
        command = [
            sys.executable,
            "-m",
            "mitsuba_ref.mutations.reached_kernels",
            str(scene),
        ]
        run = subprocess.run(command, env=environment, capture_output=True, text=True)
    if run.returncode:
        raise RuntimeError(f"{scene}: not rendered: {run.stderr[-500:]}")
    names = json.loads(run.stdout.splitlines()[-1])
    write_atomically(kept, json.dumps({state: names}).encode())
    return frozenset(names)


def compiled_kernels() -> list[str]:
    """Return the renderer's kernels that this process has compiled."""
    from numba.core.dispatcher import Dispatcher

    functions = [
        found.py_func
        for found in gc.get_objects()
        if isinstance(found, Dispatcher) and found.overloads
    ]
    names = {f"{f.__module__}.{f.__qualname__.partition('.')[0]}" for f in functions}
    ours = "renderer."
    return sorted(name.removeprefix(ours) for name in names if name.startswith(ours))


if __name__ == "__main__":
    from mitsuba_ref.our_renderer.picture import render_ours

    render_ours(picture_request(Path(sys.argv[1])), light_choice=None)
    sys.stdout.write(json.dumps(compiled_kernels()) + "\n")
