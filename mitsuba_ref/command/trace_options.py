"""The options of `--trace`, without what a trace imports."""

from __future__ import annotations

import argparse
import math

from mitsuba_ref.replay.paths.path_comparison import TOLERANCE


def add_trace_options(parser: argparse.ArgumentParser) -> None:
    """Add `--trace` and what belongs to it."""
    group = parser.add_argument_group(
        "trace",
        "Compare one path instead of pictures: both renderers draw Mitsuba's random "
        "numbers. Exit status 0: the paths agree, 1: they do not, 2: there is no such "
        "path; the others as below.",
    )
    group.add_argument(
        "--trace",
        type=_pixel,
        metavar="X,Y",
        help="print both paths at a pixel of the picture as shown (counted from 0 at the "
        "top left, inside the crop window), bounce by bounce; for path, direct, volpath",
    )
    group.add_argument(
        "--sample",
        type=_sample,
        metavar="S",
        help="which of the pixel's samples, from 0 (default: 0)",
    )
    group.add_argument(
        "--tolerance",
        type=_tolerance,
        metavar="R",
        help=f"relative error from which on a quantity differs (default: {TOLERANCE:g}; "
        "for a step that rounding does not explain, the limit of a verdict)",
    )


def asks_for_trace(given: argparse.Namespace) -> bool:
    """Return whether one of the options of `add_trace_options` is given."""
    return any(value is not None for value in (given.trace, given.sample, given.tolerance))


def _pixel(text: str) -> tuple[int, int]:
    x, comma, y = text.partition(",")
    if not (comma and x.isdecimal() and y.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r}: must be X,Y, whole numbers from 0")
    return int(x), int(y)


def _sample(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r}: must be a whole number from 0")
    return int(text)


def _tolerance(text: str) -> float:
    value = float(text)
    if not (value > 0.0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"{text}: must be above 0")
    return value
