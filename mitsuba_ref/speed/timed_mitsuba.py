"""Mitsuba for time measurements: a loaded, warm scene in a separate process."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_ref.records.request import MIN_THREADS
from mitsuba_ref.reference.edited_scene import SceneNodes, files_beside, refuse_code
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.reference.variant import load_mitsuba
from mitsuba_ref.reference.variant_process import Answerer, VariantProcess, answer_requests


@dataclass(frozen=True)
class TimedRender:
    """One render: seconds from the call until the array is in memory, and its mean."""

    seconds: float
    mean: tuple[float, float, float]  # linear sRGB, over all pixels


class TimedMitsuba(VariantProcess):
    """A scene file in one Mitsuba variant, loaded and ready; a context manager.

    `loaded["seconds"]` is how long loading took, without the start of Mitsuba.

    Parameters
    ----------
    variant
        `scalar_rgb`, `llvm_ad_rgb`, ...
    path
        Mitsuba 3 XML, rendered as it is.
    parameters
        Values for the file's `$name`.
    threads
        Worker threads, at least 2.
    samplers
        Samplers that may stand in the place of the file's.
    stand_ins
        Whether what Mitsuba lacks and the harness has in Python, `whitted` and `merl`, may
        take part: its pictures are right, its seconds are Python's. In scalar_rgb alone.

    Raises
    ------
    MitsubaError
        Why this variant cannot render the scene here.
    """

    def __init__(
        self,
        variant: str,
        path: Path,
        parameters: Mapping[str, str],
        threads: int,
        samplers: Sequence[str] = (),
        *,
        stand_ins: bool = False,
    ) -> None:
        if threads < MIN_THREADS:
            raise MitsubaError(
                f"Mitsuba needs {MIN_THREADS} threads or more, not {threads}"
            )
        job = {
            "path": str(path),
            "parameters": {name: str(value) for name, value in parameters.items()},
            "threads": threads,
            "samplers": list(samplers),
            "stand_ins": stand_ins,
        }
        super().__init__("mitsuba_ref.speed.timed_mitsuba", variant, job)

    def render(
        self, seed: int, spp: int, keep: Path | None = None, sampler: str | None = None
    ) -> TimedRender:
        """Render once; the picture goes to the file `keep` (.npy), if there is one.

        The sampler is the file's, or one of `samplers`.

        Raises
        ------
        MitsubaError
            When Mitsuba refuses, ends, or does not answer.
        """
        wanted = {"seed": seed, "spp": spp, "sampler": sampler}
        answer = self.ask({**wanted, "keep": keep and str(keep)})
        red, green, blue = answer["mean"]
        return TimedRender(float(answer["seconds"]), (red, green, blue))


def load(job: dict[str, Any]) -> tuple[dict[str, Any], Answerer]:
    """Load the scene, once for each sampler; return what renders it for each request."""
    import drjit
    import mitsuba

    if job["stand_ins"]:
        load_mitsuba()
    mitsuba.set_variant(job["variant"])
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    drjit.set_thread_count(job["threads"])
    start = time.perf_counter()
    scenes = {
        sampler: _load(mitsuba, Path(job["path"]), job["parameters"], sampler)
        for sampler in job["samplers"] or [None]
    }

    seconds = time.perf_counter() - start

    def render(wanted: dict[str, Any]) -> dict[str, Any]:
        scene = scenes[wanted["sampler"]]
        start = time.perf_counter()
        # A JIT variant only records the work until the numbers are read.
        image = np.array(mitsuba.render(scene, spp=wanted["spp"], seed=wanted["seed"]))
        seconds = time.perf_counter() - start
        if wanted["keep"]:
            np.save(wanted["keep"], image[..., :3])
        mean = image[..., :3].mean(axis=(0, 1), dtype=np.float64)
        return {"seconds": seconds, "mean": [float(value) for value in mean]}

    return {"seconds": seconds}, render


def _load(mi: Any, path: Path, parameters: dict[str, str], sampler: str | None) -> Any:
    """Return the scene as the file says, but for the sampler if one is given."""
    refuse_code(path, parameters)
    if sampler is None:
        return mi.load_file(str(path), **parameters)
    config = mi.parser.ParserConfig(mi.variant())
    with files_beside(mi, path):
        state = mi.parser.parse_file(config, str(path), **parameters)
        mi.parser.transform_upgrade(config, state)
        SceneNodes(mi, state).replace("Sampler", sampler, {})
        mi.parser.transform_all(config, state)
        return mi.parser.instantiate(config, state)


if __name__ == "__main__":
    answer_requests(load)
