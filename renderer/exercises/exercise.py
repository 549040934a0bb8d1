"""What an exercise is made of, and the file with the stub that a student fills in."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from renderer.exercises.vectors import Vector, unit

Functions = SimpleNamespace  # the functions of an exercise, by name
Variants = frozenset[str]  # names of mistakes and conventions that are switched on
RIGHT: Variants = frozenset()
SEED = 38
WIDTH = 92  # characters of a line in a student's file


@dataclass(frozen=True)
class Mistake:
    """A typical mistake: a variant of the right functions."""

    name: str
    sentence: str  # what is wrong
    advice: str  # what to do
    variants: tuple[str, ...]  # its forms, of which a student makes one


def mistakes_of(table: str) -> tuple[Mistake, ...]:
    """Read mistakes: each `name: What is wrong. | What to do.` begins a line.

    `name (variant, variant): ` if a mistake has several forms.
    """
    begin = r"^(?=[a-z0-9-]+(?: \([^)]*\))?: )"
    found = []
    for entry in filter(None, re.split(begin, inspect.cleandoc(table), flags=re.MULTILINE)):
        head, text = " ".join(entry.split()).split(": ", 1)
        name, *variants = re.findall(r"[a-z0-9-]+", head)
        sentence, advice = text.split(" | ")
        found.append(Mistake(name, sentence, advice, tuple(variants or [name])))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Case:
    """A question to the functions of an exercise."""

    about: str  # completes "First failure: "
    function: str
    arguments: tuple[Any, ...] = ()
    # takes all functions; None: call the function with the arguments
    measure: Callable[[Functions], Any] | None = None
    read: Callable[[Any], Any] | None = None  # brings equivalent answers to one form
    tolerance: float = 1e-5  # relative

    def answer_of(self, functions: Functions) -> Any:
        """Return the answer of the functions, whose arguments are their own copies."""
        if self.measure is not None:
            return self.measure(functions)
        copies = (a.copy() if isinstance(a, np.ndarray) else a for a in self.arguments)
        found = getattr(functions, self.function)(*copies)
        return found if self.read is None else self.read(found)


def direction_cases(
    about: str, function: str, arguments: tuple[Any, ...]
) -> Iterator[Case]:
    """Give two questions: where a direction points, and whether its length is 1."""
    yield Case(about, function, arguments, read=partial(_of_vector, unit))
    about = f"{about}; whether the length is 1"
    yield Case(about, function, arguments, read=partial(_of_vector, _is_unit))


def _is_unit(w: Vector) -> bool:
    return abs(float(w @ w) - 1.0) < 1e-5


def _of_vector(read: Callable[[Vector], Any], answer: Any) -> Any:
    """Apply `read` to a vector that is not 0; anything else stays as it is."""
    try:
        w = np.asarray(answer, np.float64)
    except (TypeError, ValueError):
        return answer
    return read(w) if w.shape == (3,) and np.isfinite(w).all() and w.any() else answer


@dataclass(frozen=True, eq=False)
class Exercise:
    """One exercise; an entry of a chapter's file.

    Parameters
    ----------
    name
        A word of the command line, and the stem of the student's file.
    summary
        One sentence for the list, without a full stop.
    task
        What to write; paragraphs are separated by empty lines.
    source
        Where the formulas are from.
    functions
        The right functions. Each has a keyword `variants`, a set of names of mistakes.
    hints
        From a nudge to nearly the answer.
    mistakes
        At least five.
    cases
        Takes a random generator and gives the questions, simple ones first.
    picture
        Takes the functions and returns (height, width, 3) in [0, 1], NaN where a function
        fails; None: a picture would show nothing.
    conventions
        Variants that are right too.
    slow
        The answers take long. Those to two mistakes at once are made up of theirs.
    """

    name: str
    summary: str
    task: str
    source: str
    functions: Sequence[Callable[..., Any]]
    hints: Sequence[str]
    mistakes: Sequence[Mistake]
    cases: Callable[[np.random.Generator], Iterator[Case]]
    picture: Callable[[Functions], Vector] | None = None
    conventions: Sequence[str] = ()
    slow: bool = False

    def right(self, variants: Variants = RIGHT) -> Functions:
        """Return the right functions, or variants of them."""
        found: Mapping[str, Any] = {
            f.__name__: partial(f, variants=variants) for f in self.functions
        }
        return SimpleNamespace(**found)

    def questions(self) -> list[Case]:
        """Return the cases; the same in every process."""
        return list(self.cases(np.random.default_rng(SEED)))

    def words(self, function: str) -> list[str]:
        """Return the names of a function's arguments."""
        found = next(f for f in self.functions if f.__name__ == function)
        return [word for word in inspect.signature(found).parameters if word != "variants"]


@dataclass(frozen=True, eq=False)
class Chapter:
    """The exercises of one chapter of the lecture."""

    title: str
    exercises: Sequence[Exercise]


def stub(exercise: Exercise, path: Path) -> str:
    """Return the text of a file that a student fills in."""
    name = exercise.name
    parts = [
        f'"""Exercise {name}: {exercise.summary}.',
        "",
        *_paragraphs(exercise.task),
        "",
    ]
    parts += _paragraphs(f"Source: {exercise.source}")
    parts.append("")
    if exercise.picture is not None:
        parts.append(f"The picture to reach: {path.stem}_goal.png")
    parts += [f"The check:            lightproof check {path.name}"]
    parts += [f"A hint:               lightproof exercise {name} --hint", '"""', ""]
    parts += ["import math", "", "import numpy as np", "", f'EXERCISE = "{name}"']
    for function in exercise.functions:
        words = ", ".join(exercise.words(function.__name__))
        document = textwrap.indent(inspect.getdoc(function) or "", "    ").strip()
        parts += ["", "", f"def {function.__name__}({words}):", f'    """{document}']
        parts += ['    """', "    raise NotImplementedError"]
    return "\n".join(parts) + "\n"


def _paragraphs(text: str) -> list[str]:
    """Wrap each paragraph; one that is indented is a formula and stays as it is."""
    lines: list[str] = []
    for paragraph in inspect.cleandoc(text).split("\n\n"):
        lines += [""] if lines else []
        formula = paragraph.startswith(" ")
        lines += paragraph.split("\n") if formula else textwrap.wrap(paragraph, WIDTH)
    return lines
