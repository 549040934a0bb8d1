"""The verdict and the sentences for a scene that could not be compared."""

from __future__ import annotations

import traceback
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mitsuba_ref.missing_packages import failed_package
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.verdicts import VERDICTS, Verdict, most_severe
from mitsuba_ref.reference.cache import ReferenceCache
from mitsuba_ref.reference.errors import (
    MitsubaCrashed,
    MitsubaError,
    MitsubaRefused,
    MitsubaTimeout,
)
from renderer.errors import PluginError, SceneError
from renderer.scene_file.document.named_files import check_named_files

VERDICT_OF: tuple[tuple[type[Exception], Verdict], ...] = (
    (PluginError, "bad-request"),
    (MitsubaRefused, "refused-by-mitsuba"),
    (MitsubaCrashed, "mitsuba-crashed"),
    (MitsubaTimeout, "mitsuba-timeout"),
    (SceneError, "refused-by-us"),
    (MemoryError, "refused-by-us"),  # as Mitsuba's refusal of a film of 10^6 x 10^6 is
)


@dataclass(frozen=True)
class NotCompared:
    """Why nothing was compared: each side's message, with its stage."""

    verdict: Verdict
    said: tuple[str, ...]  # "stage: sentence"
    other_side: str = ""  # what the other renderer did; empty if unknown

    @property
    def reasons(self) -> tuple[str, ...]:
        """One sentence for each side: what, where, and what can be done."""
        facts = VERDICTS[self.verdict]
        beside = f"; {self.other_side}" if self.other_side else ""
        return tuple(f"{one}{beside}; {facts.advice}" for one in self.said)


def stopped_by(error: Exception, stage: str) -> NotCompared:
    """Return what an exception means; any other exception is a bug on our side.

    Parameters
    ----------
    error
        What a side raised.
    stage
        What was being done.
    """
    if failed_package(error):  # which is not about the scene, and ends the command
        raise error
    for kind, verdict in VERDICT_OF:
        if isinstance(error, kind):
            said = (_said(stage, _one_line(error)),)
            return NotCompared(verdict, said, _seen_of_us(verdict, stage))
    what = _one_line(error)
    if not isinstance(error, MitsubaError):
        what = f"unexpected {type(error).__name__}: {what}{_place(error)}"
    return NotCompared("broken", (_said(stage, what),))


def with_the_other_side(
    ours: NotCompared, request: RenderRequest, references: ReferenceCache
) -> NotCompared:
    """Find out whether Mitsuba renders a scene that we refuse.

    It renders one sample per pixel at the file's size: a scene that loads may still fail to
    render. The picture is not cached, as the files of a scene that we cannot read are not
    known.

    Mitsuba is not started for a scene that names, anywhere, a file that may not be read.
    Our error may concern an earlier line.
    """
    asked = replace(request, kind="image", spp=1, box_filter=False)
    try:
        check_named_files(Path(request.path), request.parameters, request.allow_outside)
    except SceneError as error:
        return replace(ours, other_side=f"Mitsuba was not run: {_one_line(error)}")
    try:
        picture = references.render_uncached(asked).pixels
    except Exception as error:
        theirs = stopped_by(error, "Mitsuba, tried as well")
        verdict = most_severe((ours.verdict, theirs.verdict))
        if theirs.verdict == "refused-by-mitsuba":
            verdict = "refused-by-both"
        return NotCompared(verdict, ours.said + theirs.said)
    bad = int(np.count_nonzero(~np.isfinite(picture)))
    values = f", with NaN or infinite values: {bad}" if bad else ""
    return replace(ours, other_side=f"Mitsuba renders it at 1 sample per pixel{values}")


def bad_request(error: SceneError) -> NotCompared:
    """Return what a wrong proof.toml or -D means: nothing was rendered."""
    return NotCompared("bad-request", (_one_line(error),))


def _seen_of_us(verdict: Verdict, stage: str) -> str:
    """Return how far our renderer got with a scene that Mitsuba refuses at this stage."""
    if verdict != "refused-by-mitsuba":
        return ""
    # The reference of a replay is rendered first, when we have but read the scene.
    return "we read it" if stage == "replay" else "we render it"


def _said(stage: str, what: str) -> str:
    if stage.startswith("Mitsuba"):  # the sentence names Mitsuba already
        what = what.removeprefix("Mitsuba: ")
    return f"{stage}: {what}"


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()).rstrip(".!") or type(error).__name__


def _place(error: Exception) -> str:
    """Return where a bug is: the last line of ours that was running."""
    frames: Sequence[traceback.FrameSummary] = traceback.extract_tb(error.__traceback__)
    if not frames:
        return ""
    last = frames[-1]
    return f" (in {last.name}, {Path(last.filename).name}:{last.lineno})"
