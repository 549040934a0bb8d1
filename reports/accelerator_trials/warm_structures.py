"""The kernels of all structures compiled side by side, before anything is measured.

`python -m reports.accelerator_trials.warm_structures NAME...` builds and traces a tiny
mesh with each.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from mitsuba_ref.records.machine import usable_cores
from renderer.accelerators.build import BUILDERS
from renderer.kernels.jit import KERNEL_CACHE
from reports.accelerator_trials import tracing
from reports.accelerator_trials.contenders import build, reach_of, study_queries
from reports.accelerator_trials.meshes import displaced_icosphere, triangle_surfaces

MOST_PROCESSES = 4  # each takes half a gigabyte


def warm(names: Sequence[str]) -> None:
    """Compile what measuring the structures needs, in this process."""
    mesh = displaced_icosphere(2)
    surfaces, reach = triangle_surfaces(mesh), reach_of(mesh)
    for name in names:
        accel, _ = build(name, surfaces, reach)
        for query in study_queries(mesh, accel, 16).values():
            tracing.trace(accel, query, query.batches)
            tracing.tallied(accel, query, query.batches)


def warm_side_by_side() -> None:
    """Compile for all structures in several processes, if nobody has done so before.

    What fails there fails again, and says so, where it is measured.
    """
    stamp = _stamp()
    if stamp.exists():
        return
    names = list(BUILDERS)
    processes = min(usable_cores(), MOST_PROCESSES, len(names))
    # neighbours in the registry share kernels, so each process gets a run of them
    cuts = [len(names) * k // processes for k in range(processes + 1)]
    root = str(Path(__file__).resolve().parents[2])
    paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    running = [
        subprocess.Popen(
            [
                sys.executable,
                "-m",
                "reports.accelerator_trials.warm_structures",
                *names[first:end],
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=environment,
        )
        for first, end in pairwise(cuts)
    ]
    try:
        statuses = [process.wait() for process in running]
    finally:
        for process in running:
            process.kill()
            process.wait()
    if not any(statuses):
        stamp.parent.mkdir(parents=True, exist_ok=True)
        stamp.touch()


def _stamp() -> Path:
    digest = hashlib.sha256(" ".join(BUILDERS).encode())
    digest.update(Path(tracing.__file__).read_bytes())
    return KERNEL_CACHE / "warm" / f"structures-{digest.hexdigest()[:16]}"


if __name__ == "__main__":
    warm(sys.argv[1:])
