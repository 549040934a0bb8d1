"""The checks that the harness makes of a scene, rung by rung, on any renderer.

A rung is one kind of evidence. The order is that of the ladder: the first rung that sees a
defect is the cheapest that does.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from mitsuba_ref.command.validation import validate_scene
from mitsuba_ref.our_renderer.picture import OurPicture, RenderOurs
from mitsuba_ref.records.options import Options, scene_request
from mitsuba_ref.records.proof_file import read_proof
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.results import SceneResult
from mitsuba_ref.records.verdicts import COMPARED
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.replay.replay_scene import replay_scene
from renderer.errors import NotReplayable

RUNS = "runs"
FINITE = "finite"
AOVS = "AOVs"
DETERMINISTIC = "deterministic radiance"
REPLAY = "replay"
STATISTICS = "statistics"
TESTS = "unit tests"
CLIMB = "ladder: "
"""Before the names of the rungs of `mitsuba_ref.ladder.climb`, a check by itself."""

CLIMBED = tuple(
    CLIMB + name
    for name in (
        "finite",
        "registration",
        "aovs",
        "radiance",
        "pixels",
        "tiles",
        "mean",
        "uniformity",
        "noise-free mse",
        "floors",
    )
)
LADDER = (RUNS, FINITE, AOVS, DETERMINISTIC, REPLAY, STATISTICS, *CLIMBED, TESTS)


@dataclass(frozen=True)
class Rung:
    """What one rung says of one renderer on one scene."""

    name: str  # one of LADDER
    caught: bool  # a difference was seen
    why: str  # the sentence of the check; "" where nothing was seen
    spp: int | None  # samples per pixel of each picture that it looked at
    seconds: float  # until it was judged, from the start of its check, not compiling
    seeds: int = 1  # pictures of ours that it used, each with another seed


@dataclass
class CountedRender:
    """A renderer that notes how long its kernels took to compile."""

    render: RenderOurs
    compile_seconds: float = 0.0
    spp: int | None = field(default=None)

    def __call__(self, request: RenderRequest) -> OurPicture:
        """Render."""
        picture = self.render(request)
        self.compile_seconds += picture.compile_seconds or 0.0
        if request.kind == "image":
            self.spp = picture.spp
        return picture


WITHOUT_REPLAY = Options(size="test", checks="statistics")
"""What `make test` checks on each scene, except for the replay, a separate check."""

NO_PICTURE = ("broken", "refused-by-us", "size-mismatch", "error")
"""Verdicts of a mutant that gives no picture to compare."""

Check = Callable[[Path, CountedRender, ReferenceCache], Sequence[Rung]]


def comparison(
    scene: Path, ours: CountedRender, references: ReferenceCache
) -> Sequence[Rung]:
    """Compare one picture and its AOVs at the scene's test size, as `make test` does.

    Parameters
    ----------
    scene
        The file, with a proof.toml in its folder.
    ours
        The renderer that is judged.
    references
        Mitsuba's pictures; time to make those that are missing is counted.
    """
    before, started = ours.compile_seconds, time.perf_counter()
    result = validate_scene(scene, WITHOUT_REPLAY, ours, references).result
    seconds = time.perf_counter() - started - (ours.compile_seconds - before)
    return rungs_of(result, ours.spp, seconds)


def rungs_of(result: SceneResult, spp: int | None, seconds: float) -> list[Rung]:
    """Sort the reasons of a comparison by the rung that gives them.

    Raises
    ------
    MitsubaError
        If the comparison ended on Mitsuba's side, which says nothing of ours.
    """

    def rung(name: str, reasons: Sequence[str], samples: int | None = spp) -> Rung:
        return Rung(name, bool(reasons), "; ".join(reasons), samples, seconds)

    if result.verdict in NO_PICTURE:
        return [rung(RUNS, result.reasons)]
    if result.verdict == "not-finite":
        return [rung(RUNS, ()), rung(FINITE, result.reasons)]
    if result.verdict not in COMPARED:
        raise MitsubaError(f"{result.verdict}: {'; '.join(result.reasons)}")
    aovs = [reason for reason in result.reasons if reason.startswith("AOV ")]
    radiance = [reason for reason in result.reasons if reason not in aovs]
    judged_by = DETERMINISTIC if result.deterministic else STATISTICS
    return [
        rung(RUNS, ()),
        rung(FINITE, ()),
        rung(AOVS, aovs, 1),
        rung(judged_by, radiance),
    ]


REPLAYED_SAMPLES = (1, 16)
"""Samples per pixel of a replay; the second only where the first sees nothing."""


def replay(scene: Path, ours: CountedRender, references: ReferenceCache) -> Sequence[Rung]:
    """Compare pictures that are drawn with the same random numbers.

    Parameters
    ----------
    scene, ours, references
        As for `comparison`. A scene that cannot be replayed has no rung.
    """
    proof = read_proof(scene)
    request = scene_request(scene, proof, WITHOUT_REPLAY)
    # Causes would be traced with the renderer of this process, which lacks the defect.
    strict = msgspec.structs.replace(proof.replay, traced=0)
    before, started = ours.compile_seconds, time.perf_counter()
    rung = None
    for spp in REPLAYED_SAMPLES:
        try:
            result = replay_scene(request, spp, ours, references, strict)[0]
        except (NotReplayable, MitsubaError):
            return []
        except Exception as error:  # whatever a defect brings about
            return [Rung(RUNS, True, f"replay: {error}", spp, 0.0)]
        compiled = ours.compile_seconds - before
        seconds = time.perf_counter() - started - compiled
        why = "" if result.passed else result.sentence
        rung = Rung(REPLAY, not result.passed, why, spp, seconds)
        if rung.caught:
            break
    return [] if rung is None else [rung]
