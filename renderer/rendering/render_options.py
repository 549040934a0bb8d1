"""`RenderOptions`: every option of a render, declared once, and checks of values."""

from __future__ import annotations

import dataclasses
import math
import operator
import os
import reprlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any, NamedTuple

from renderer.errors import SceneError, did_you_mean
from renderer.mitsuba_version import RULES, why_unknown
from renderer.process.memory import parse_size
from renderer.process.names import (
    ACCELERATORS,
    INTEGRATORS,
    LIGHT_CHOICES,
    RAY_OFFSETS,
    REPLAY,
    SAMPLERS,
)
from renderer.process.worker_pool import default_threads
from renderer.rendering.progress_display import Progress

# ------------------------------------------------------------------------ option values
# Values of options: checks of arguments, and parsers for the command line.
#
# Checks raise SceneError or TypeError, parsers ValueError; messages name possible values.

MOST_LOCAL = 256  # processes of a local cluster
PROTOCOLS = ("tcp://", "tls://", "ucx://", "ws://", "wss://")
MOST_SEED = 2**32 - 1


def shown_value(value: object) -> str:
    """Return a value and its type on one line, cut if it is long."""
    shown = " ".join(reprlib.repr(value).split())
    return f"{shown} (of type {type(value).__name__})"


def whole(least: int, most: int) -> Callable[[str, Any], int]:
    """Return a check for integers (also NumPy's) in [least, most]."""

    def check(name: str, value: Any) -> int:
        try:
            if isinstance(value, bool):
                raise TypeError
            number = operator.index(value)
        except TypeError:
            possible = f"whole numbers from {least} to {most} are possible"
            raise TypeError(f"{name} is {shown_value(value)}; {possible}") from None
        if not least <= number <= most:
            raise SceneError(f"{name} is {number}; {least} to {most} are possible")
        return number

    return check


def positive(name: str, value: Any) -> float:
    """Return the value as a positive, finite float."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name} is {shown_value(value)}; positive numbers are possible")
    if not 0.0 < float(value) < float("inf"):
        raise SceneError(f"{name} is {value}; positive numbers are possible")
    return float(value)


def error_goal(name: str, value: Any) -> float:
    """Return a relative error, given as a number or as a text such as 2%."""
    if not isinstance(value, str):
        return positive(name, value)
    try:
        return parse_error(value)
    except ValueError as error:
        raise SceneError(f"{name}: {error}; 0.02 and '2%' are possible") from None


def truth(name: str, value: Any) -> bool:
    """Return True or False."""
    if type(value).__name__ not in ("bool", "bool_"):  # of Python or NumPy
        raise TypeError(f"{name} is {shown_value(value)}; True and False are possible")
    return bool(value)


def six_numbers(name: str, value: Any) -> tuple[float, ...]:
    """Return six finite numbers."""
    try:
        numbers = tuple(map(float, value))
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != 6 or not all(map(math.isfinite, numbers)):
        raise TypeError(f"{name} is {shown_value(value)}; six numbers are possible")
    return numbers


def names_and_texts(name: str, value: Any) -> Mapping[str, str]:
    """Return a mapping from texts to texts."""
    texts = [*value, *value.values()] if isinstance(value, Mapping) else [None]
    if not all(isinstance(text, str) for text in texts):
        possible = "a dictionary of names and texts is possible"
        raise TypeError(f"{name} is {shown_value(value)}; {possible}")
    return value  # type: ignore[no-any-return]


def known_version(name: str, value: Any) -> str:
    """Check that the rules of this version of Mitsuba are implemented."""
    if value not in RULES:
        raise SceneError(f"{name}: {why_unknown(value)}")
    return str(value)


def parse_count(text: str) -> int:
    """Parse an integer of at least 1."""
    if (value := parse_whole(text)) < 1:
        raise ValueError(f"{value} is less than 1")
    return value


def parse_whole(text: str) -> int:
    """Parse an integer."""
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"{text!r} is no whole number") from None


def parse_seed(text: str) -> int:
    """Parse a seed."""
    if not 0 <= (value := parse_whole(text)) <= MOST_SEED:
        raise ValueError(f"{value} is not in 0 to {MOST_SEED}")
    return value


def parse_error(text: str) -> float:
    """Parse a relative error, such as 2% or 0.02."""
    number = parse_number(text.removesuffix("%"))
    if text.endswith("%"):
        return number / 100
    if number >= 1:
        raise ValueError(f"{text} is 100 % or more; is {text}% meant?")
    return number


def parse_seconds(text: str) -> float:
    """Parse a time in seconds, such as 90 or 90s."""
    return parse_number(text.removesuffix("s"))


def parse_number(text: str) -> float:
    """Parse a positive, finite number."""
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{text!r} is no number") from None
    if not 0.0 < value < float("inf"):
        raise ValueError(f"{text} is not more than 0, and finite")
    return value


def parse_cluster(where: str) -> str:
    """Return the address of a cluster, or `local:N`."""
    kind, _, count = where.partition(":")
    if kind == "local":
        if not (count.isdecimal() and 1 <= int(count) <= MOST_LOCAL):
            raise ValueError(f"{where!r}: local:N starts N processes, 1 to {MOST_LOCAL}")
    elif not where.startswith(PROTOCOLS):
        raise ValueError(f"{where!r} is neither local:N nor an address tcp://host:8786")
    return where


# ------------------------------------------------------------------------------ options
# `RenderOptions`: all options of `render`, each declared once.
#
# Several things are derived from these fields: the keyword arguments of `render` and their
# documentation, the command line options, what must be equal to resume a checkpoint, what
# is sent to workers of a cluster, and what `--explain` repeats. A new option needs a field
# here and the code that uses it.
#
# Numba and NumPy are not imported here, so that `lightproof --help` starts fast.

# ruff: noqa: RUF009  `_option` returns the result of `dataclasses.field`


MOST_SAMPLES = 1 << 24  # per pixel; scene files have the same limit
MOST_THREADS = 1024


class Option(NamedTuple):
    """Metadata of an option, in addition to its name, type and default value.

    Its roles are some of these words. `plan`: `make_plan` uses it. `picture`: it is part of
    the command that reproduces the picture. `identity`: a checkpoint can only be resumed
    with the same value. `travels`: it is sent to the workers of a cluster. `bands`: it is
    supported for a film that is rendered in bands.
    """

    help: str
    flag: str  # on the command line; empty: Python only
    metavar: str | None
    roles: frozenset[str]
    parse: Callable[[str], Any]  # parses the text of the command line
    choices: tuple[str, ...]
    noun: str  # used in messages for the choice; empty: the name
    check: Callable[[str, Any], Any] | None  # (name, value) -> value, or raises


def _option(
    default: Any,
    flag: str,
    roles: str,
    help: str,
    *,
    parse: Callable[[str], Any] = str,
    choices: tuple[str, ...] = (),
    noun: str = "",
    check: Callable[[str, Any], Any] | None = None,
) -> Any:
    """Return a dataclass field with its `Option`; `flag` is such as "--spp N"."""
    name, _, metavar = flag.partition(" ")
    words = frozenset(roles.split())
    option = Option(help, name, metavar or None, words, parse, choices, noun, check)
    return dataclasses.field(default=default, metadata={"option": option})


@dataclass(frozen=True)
class RenderOptions:
    """The options of a render; values are checked when an object is created.

    Raises
    ------
    SceneError
        For a number that is out of range, and a name that does not exist.
    TypeError
        For a value of the wrong type.
    """

    spp: int | None = _option(
        None,
        "--spp N",
        "plan picture bands",
        "samples per pixel (default: the file's)",
        parse=parse_count,
        check=whole(1, MOST_SAMPLES),
    )
    seed: int = _option(
        0,
        "--seed N",
        "picture identity travels bands",
        "the same seed gives the same picture, bit for bit, at any number of threads "
        "(default: 0)",
        parse=parse_seed,
        check=whole(0, MOST_SEED),
    )
    threads: int | None = _option(
        None,
        "--threads N",
        "plan bands",
        "threads that render (default: one for each processor)",
        parse=parse_count,
        check=whole(1, MOST_THREADS),
    )
    integrator: str | None = _option(
        None,
        "--integrator NAME",
        "plan picture bands",
        f"{', '.join(INTEGRATORS)}; auto, the default, is the least method that gives "
        "what the file requests",
        choices=INTEGRATORS,
    )
    accel: str | None = _option(
        None,
        "--accel NAME",
        "plan picture travels bands",
        f"{', '.join(ACCELERATORS)}; the picture is the same; auto, the default, takes for "
        "each kind of primitive what a cost model expects to be the fastest",
        choices=ACCELERATORS,
        noun="accelerator",
    )
    sampler: str | None = _option(
        None,
        "--sampler NAME",
        "plan picture bands",
        f"{', '.join(SAMPLERS)} (default: the file's), or {REPLAY}: the file's, with the "
        "random numbers that Mitsuba scalar draws, so that both take the same paths",
        choices=(*SAMPLERS, REPLAY),
    )
    progress: Callable[[Progress], None] | bool | None = _option(
        None,
        "",
        "bands",
        "called with a `Progress` in the calling thread, several times a second; True: a "
        "bar with the time left, in a terminal or a notebook, else a line now and then",
    )
    live: bool = _option(
        False,
        "",
        "",
        "draw the picture in the notebook while it is rendered",
        check=truth,
    )
    ray_offset: str | None = _option(
        None,
        "--ray-offset NAME",
        "plan picture bands",
        "how far off their surface rays start: tight (default) or mitsuba",
        choices=RAY_OFFSETS,
        noun="ray offset",
    )
    mitsuba_version: str | None = _option(
        None,
        "",
        "plan bands",
        f"with the sampler {REPLAY} or the ray offset mitsuba: the version of Mitsuba that "
        f"is followed, {' or '.join(RULES)} (default: the installed one, else the newest)",
        check=known_version,
    )
    measured_camera: Sequence[float] | None = _option(
        None,
        "",
        "identity",
        f"with the sampler {REPLAY}: six numbers of the matrix of Mitsuba's camera on this "
        "machine, whose rounding is taken (`replay.camera`)",
        check=six_numbers,
    )
    target_error: float | str | None = _option(
        None,
        "--target-error 2%",
        "",
        "render until the picture's estimated relative error is no more (0.02 is 2%; "
        "`rendering.accuracy` has the formula); --spp is then the most samples that it may "
        "take, and a file's sampler whose points depend on their number gives way to "
        "independent",
        parse=parse_error,
        check=error_goal,
    )
    time_limit: float | None = _option(
        None,
        "--time SECONDS",
        "",
        "render for about so many seconds, compilation not included, and say the error "
        "that was reached",
        parse=parse_seconds,
        check=positive,
    )
    checkpoint: str | os.PathLike[str] | None = _option(
        None,
        "--checkpoint FILE",
        "",
        "keep the state of the render in this file, now and then, after an interrupt and "
        "at its end (docs/checkpoints.md)",
        parse=Path,
    )
    checkpoint_every: float = _option(
        60.0,
        "--every SECONDS",
        "",
        "seconds between two writings of the checkpoint (default: 60)",
        parse=parse_seconds,
        check=positive,
    )
    resume: bool = _option(
        False,
        "--resume",
        "",
        "go on from the checkpoint, to the same picture as without a break; also to more "
        "--spp than it was made with, if the sampler is independent; with --frames: render "
        "those that are not there yet",
        check=truth,
    )
    cluster: Any = _option(
        None,
        "--cluster WHERE",
        "",
        "render on a Dask cluster, the same picture (docs/cluster.md); in Python a "
        "`distributed.Client`; on the command line local:4, which starts 4 processes, or "
        "the address of one that runs, tcp://host:8786",
        parse=parse_cluster,
    )
    memory: int | float | str | None = _option(
        None,
        "--memory SIZE",
        "bands",
        "refuse what would take this process beyond a size such as 4GiB (default: what "
        "the machine has free); does not cover the workers of --cluster, nor the frames "
        "that begin ahead there",
        parse=parse_size,
    )
    light_choice: str | None = _option(
        None,
        "--light-choice NAME",
        "plan picture bands",
        "how one of several lights is chosen at a point: importance (default), by what it "
        "can give there, or uniform, each as often as any other, as in Mitsuba; with "
        "uniform, panes of glass block light samples, and none are taken near lamps in fog",
        choices=LIGHT_CHOICES,
        noun="light choice",
    )
    denoise: bool = _option(
        False,
        "--denoise",
        "picture",
        "let Open Image Denoise guess the picture without noise, by albedo and normals "
        "(needs the extra `denoise`); the file says so and keeps the picture before it as "
        "the AOV `noisy`, and errors are those of that picture",
        check=truth,
    )
    metadata: Mapping[str, str] | None = _option(
        None,
        "",
        "bands",
        "names and texts for the header of the picture's file",
        check=names_and_texts,
    )

    def __post_init__(self) -> None:
        """Check all values, and combinations of options."""
        for name, option in OPTIONS.items():
            value = getattr(self, name)
            if value is None and name not in NEEDED:
                continue
            if option.check is not None:
                object.__setattr__(self, name, option.check(name, value))
            if option.choices and value not in option.choices:
                known, noun = ", ".join(option.choices), option.noun or name
                near = did_you_mean(str(value), option.choices)
                raise SceneError(f"{noun} {value!r} is unknown; there are: {known}{near}")
        if self.resume and self.checkpoint is None:
            raise SceneError("resume is true, and no checkpoint is given to go on from")

    @property
    def thread_count(self) -> int:
        """Number of rendering threads."""
        return default_threads() if self.threads is None else self.threads

    @property
    def accelerator(self) -> str:
        """The name of the accelerator, or "auto"."""
        return self.accel or "auto"

    @property
    def has_goal(self) -> bool:
        """Whether an error or a time limit ends the render."""
        return self.target_error is not None or self.time_limit is not None

    def given(self) -> dict[str, Any]:
        """Return the options that differ from their defaults."""
        found = {}
        for name, default in DEFAULTS.items():
            value = getattr(self, name)
            if value is not default and (default is None or value != default):
                found[name] = value
        return found

    def only(self, role: str) -> dict[str, Any]:
        """Return the options that have a role, such as "plan"; see `Option`."""
        return {name: getattr(self, name) for name in names_of(role)}


OPTIONS: dict[str, Option] = {
    field.name: field.metadata["option"] for field in dataclasses.fields(RenderOptions)
}
DEFAULTS = {field.name: field.default for field in dataclasses.fields(RenderOptions)}
NEEDED = {name for name, default in DEFAULTS.items() if default is not None}


def names_of(role: str) -> list[str]:
    """Return the names of the options that have a role; see `Option`."""
    return [name for name, option in OPTIONS.items() if role in option.roles]
