"""What the command line says, and the request that follows from it for one scene."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from mitsuba_ref.records.machine import usable_cores
from mitsuba_ref.records.proof_file import Proof
from mitsuba_ref.records.request import MIN_THREADS, TIME_LIMIT, RenderRequest
from renderer.errors import SceneError


@dataclass(frozen=True)
class Options:
    """What the command line says for all scenes."""

    size: Literal["demo", "test"] = "demo"
    spp: int | None = None
    seed: int = 0
    threads: int | None = None
    parameters: dict[str, str] = field(default_factory=dict)
    ladder: bool = False
    checks: Literal["all", "replay", "statistics"] = "all"
    replay: tuple[int, ...] = (1, 16)  # samples per pixel of the replays
    causes: int = 0  # divergent pixels of a replay to be traced
    time_limit: float = TIME_LIMIT  # seconds for one answer of Mitsuba to a trace
    seeds: int = 1  # pictures of each renderer for the ladder of tests; 1: not climbed
    plugins: Path | None = None  # a Python file of the user's (`plugin_file`)
    allow_outside: tuple[Path, ...] = ()  # folders besides the scenes' own
    convergence: bool = False  # with the rungs that need pictures at many sample counts

    @property
    def workers(self) -> int:
        """Threads of both renderers; Mitsuba needs two."""
        return max(MIN_THREADS, self.threads or usable_cores())


def scene_request(path: Path, proof: Proof, options: Options) -> RenderRequest:
    """Return the request to both renderers.

    Noisy scenes are rendered with the box filter on both sides: other filters share
    samples between pixels, and then neither the floor nor a test of the mean is valid.

    Raises
    ------
    SceneError
        If -D gives a scene that has a proof.toml no sample count.
    """
    size = proof.size(options.size)
    parameters = (size.parameters if size else {}) | options.parameters
    spp = options.spp
    if size:
        spp = spp or _sample_count(parameters["spp"])
        parameters["spp"] = str(spp)
    return RenderRequest(
        path=str(path.resolve()),
        parameters=parameters,
        spp=spp,
        seed=options.seed,
        threads=options.workers,
        box_filter=not proof.deterministic,
        plugins=str(options.plugins.resolve()) if options.plugins else None,
        allow_outside=tuple(str(folder.resolve()) for folder in options.allow_outside),
    )


def _sample_count(text: str) -> int:
    """Return the proof's samples per pixel, or those of -D spp=..., which go before."""
    if not (text.isdecimal() and int(text) >= 1):
        raise SceneError(f"-D spp={text}: a whole number of 1 or more is possible")
    return int(text)


def scene_name(path: Path) -> str:
    """Return the folder's name for `NAME/scene.xml`, else the file's."""
    return path.resolve().parent.name if path.name == "scene.xml" else path.stem


def shown_path(path: Path) -> str:
    """Return the path as seen from here where possible: reports travel."""
    resolved, here = path.resolve(), Path.cwd().resolve()
    inside = resolved.is_relative_to(here)
    return (
        resolved.relative_to(here).as_posix()
        if inside
        else f"{resolved.parent.name}/{path.name}"
    )
