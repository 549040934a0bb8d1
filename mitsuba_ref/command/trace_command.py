"""`--trace X,Y`: one path of one pixel in both renderers, and where the two part.

The first thing to look at when a new BSDF, light or shape gives another picture than
Mitsuba's: the table shows which quantity of which bounce differs first.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from mitsuba_ref.command.verdict_of_error import NotCompared, bad_request, stopped_by
from mitsuba_ref.records.options import Options, scene_request
from mitsuba_ref.records.proof_file import read_proof
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.records.verdicts import exit_status
from mitsuba_ref.replay.paths.path_comparison import (
    CAMERA,
    TOLERANCE,
    Quantity,
    compare_paths,
    first_difference,
    largest_error,
)
from mitsuba_ref.replay.paths.path_from_reference_rays import Finding, cause_of
from mitsuba_ref.replay.paths.path_table import print_paths
from mitsuba_ref.replay.paths.traced_pair import NotTraceable, TracedPair
from renderer.errors import NotReplayable, SceneError

WRONG_USE, INTERRUPTED = 2, 130
WIDTH = 128
"""Columns of the table: a narrower terminal wraps its lines, rich would cut the numbers."""


def run_trace(given: argparse.Namespace, scenes: list[Path], options: Options) -> int:
    """Trace, print and return the exit status.

    Parameters
    ----------
    given
        The command line, with the options of `trace_options`.
    scenes
        Its scene files; one of them.
    options
        Size, samples, seed and parameters, as for pictures.
    """
    if given.trace is None:
        return _refuse("--sample and --tolerance go with --trace", WRONG_USE)
    if len(scenes) != 1:
        return _refuse(f"--trace takes one scene; {len(scenes)} are given", WRONG_USE)
    request: RenderRequest | None = None
    try:
        request = scene_request(scenes[0], read_proof(scenes[0]), options)
        with TracedPair(request, given.time_limit) as pair:
            return _trace(given, pair, f"{scenes[0]}, seed {request.seed}")
    except (NotTraceable, NotReplayable) as error:
        return _refuse(str(error), WRONG_USE)
    except Exception as error:  # a bug on our side is a verdict too
        stopped = _stopped(error, request)
        sentence = f"{stopped.verdict}: {stopped.said[0]}"
        return _refuse(sentence, exit_status([stopped.verdict]))
    except KeyboardInterrupt:
        Console(stderr=True).print("interrupted")
        return INTERRUPTED


def _stopped(error: Exception, request: RenderRequest | None) -> NotCompared:
    """Return what an error means; without a request neither side has rendered."""
    if request is None and isinstance(error, SceneError):
        return bad_request(error)
    return stopped_by(error, "trace")


def _refuse(sentence: str, status: int) -> int:
    """Print why there is nothing to show; return the exit status."""
    said = " ".join(sentence.split())
    errors = Console(stderr=True)
    errors.print(f"lightproof-validate: {said}", markup=False, soft_wrap=True)
    return status


def _trace(given: argparse.Namespace, pair: TracedPair, scene: str) -> int:
    """Trace and print; return 0 if the paths agree, else 1."""
    pixel, sample = given.trace, given.sample or 0
    tolerance = given.tolerance or TOLERANCE
    ours, reference = pair.trace(pixel, sample)
    quantities = compare_paths(ours, reference)
    found = pair.led(pixel, sample, reference).examine()
    if given.tolerance is None:
        # what a verdict calls a defect is one here, though paths may differ by more
        tolerance = _tolerance_of(found, quantities) or tolerance
    first = first_difference(quantities, tolerance)
    why = "" if first is None else cause_of(found, quantities[first])
    notes = []
    if first is not None and sample > 0 and quantities[first].bounce == CAMERA:
        notes = [
            "A pixel's samples share one stream of numbers.",
            pair.cause(pixel, tolerance),
        ]
    output = Console(width=max(WIDTH, Console().width), highlight=False)
    title = f"{scene}: pixel {pixel[0]},{pixel[1]}, sample {sample} of {pair.spp}"
    output.print(title, markup=False, soft_wrap=True)
    print_paths(quantities, (ours.renderer, reference.renderer), tolerance, output, why)
    for note in notes:
        output.print(note, markup=False, soft_wrap=True)
    return 0 if first is None else 1


def _tolerance_of(found: Finding, quantities: Sequence[Quantity]) -> float | None:
    """Return the tolerance by which the step that `found` calls a defect differs first.

    None if it calls none so, or if the paths have parted before.
    """
    step = found.quantity
    if found.within_rounding or step is None:
        return None
    for index, quantity in enumerate(quantities):
        if (quantity.bounce, quantity.name) == (step.bounce, step.name):
            lower = max(found.limit, largest_error(quantities[:index]))
            if quantity.differs(lower):
                return lower
    return None
