"""Compare a student's functions with the right ones, and name the mistake.

The answers of the student, of the right functions and of every mistake are tables over the
same cases. A mistake explains a case if it gives the student's answer there. Its share
counts the cases in which it or the student is wrong: a mistake that predicts failures which
did not happen loses as much as one that misses failures which did.
"""

from __future__ import annotations

import functools
import itertools
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from renderer.exercises.answers import agree, is_broken, plain, raised
from renderer.exercises.exercise import RIGHT, Case, Exercise, Functions, Mistake, Variants

NAMED = 0.9  # a mistake with this share is called the mistake
PARTLY = 0.5  # and with this one probable


@dataclass(frozen=True, eq=False)
class Explanation:
    """One mistake or two at once, and the share of wrong cases that they explain."""

    mistakes: tuple[Mistake, ...]
    share: float  # in [0, 1]
    explained: int  # failures
    failures: int


@dataclass(frozen=True, eq=False)
class Verdict:
    """What a student's answers are worth."""

    cases: Sequence[Case]
    expected: Sequence[Any]  # by the convention that fits best
    found: Sequence[Any]
    failures: Sequence[int]  # of cases
    explanations: Sequence[Explanation]  # best first, empty if there are no failures

    @property
    def named(self) -> Explanation | None:
        """The mistake, if one is known that explains at least half."""
        best = next(iter(self.explanations), None)
        return best if best is not None and best.share >= PARTLY else None


def answer(case: Case, functions: Functions) -> Any:
    """Return the plain answer to one case; an exception is an answer too."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            return plain(case.ask(functions))
        except Exception as error:
            return raised(f"{type(error).__name__}: {error}", None)


@functools.cache
def _questions(exercise: Exercise) -> Sequence[Case]:
    return exercise.questions()


@functools.cache
def answers_of(exercise: Exercise, variants: Variants) -> Sequence[Any]:
    """Return the answers of a variant of the right functions to every case."""
    functions = exercise.right(variants)
    return [answer(case, functions) for case in _questions(exercise)]


def judge(exercise: Exercise, found: Sequence[Any]) -> Verdict:
    """Return the verdict on the answers of a student's functions.

    There may be fewer answers than cases; then those are judged.
    """
    cases = _questions(exercise)
    conventions = [RIGHT, *(frozenset({name}) for name in exercise.conventions)]

    def failures(convention: Variants) -> list[int]:
        return _different(cases, found, answers_of(exercise, convention))

    convention = min(conventions, key=lambda one: len(failures(one)))
    wrong = failures(convention)
    explanations: list[Explanation] = []
    if wrong:
        explanations = _explanations(exercise, found, conventions)
    return Verdict(cases, answers_of(exercise, convention), found, wrong, explanations)


def _different(cases: Sequence[Case], a: Sequence[Any], b: Sequence[Any]) -> list[int]:
    """Return the numbers of the cases whose answers differ."""
    triples = zip(cases, a, b, strict=False)  # a student's file may have been stopped
    return [k for k, (case, x, y) in enumerate(triples) if not agree(x, y, case.tolerance)]


def _explanations(
    exercise: Exercise, found: Sequence[Any], conventions: Sequence[Variants]
) -> list[Explanation]:
    """Return every mistake with its share, best first; pairs if no single one suffices."""
    tried = _tried(exercise, found, conventions, [(one,) for one in exercise.mistakes])
    # what raises an exception everywhere has no second mistake yet
    if tried[0].share < NAMED and not all(is_broken(one) for one in found):
        pairs = itertools.combinations(exercise.mistakes, 2)
        both = _tried(exercise, found, conventions, pairs)
        tried = [*(one for one in both[:1] if one.share >= NAMED), *tried]
    return tried


def _tried(
    exercise: Exercise,
    found: Sequence[Any],
    conventions: Sequence[Variants],
    candidates: Iterable[tuple[Mistake, ...]],
) -> list[Explanation]:
    explanations = [
        max(
            (
                _explanation(exercise, found, one, convention, frozenset(forms))
                for convention in conventions
                for forms in itertools.product(*(mistake.variants for mistake in one))
            ),
            key=lambda explanation: explanation.share,
        )
        for one in candidates
    ]
    return sorted(explanations, key=lambda one: -one.share)


def _explanation(
    exercise: Exercise,
    found: Sequence[Any],
    mistakes: tuple[Mistake, ...],
    convention: Variants,
    forms: Variants,
) -> Explanation:
    cases = _questions(exercise)
    right = answers_of(exercise, convention)
    if len(forms) == 2 and exercise.slow:
        first, second = (answers_of(exercise, convention | {one}) for one in forms)
        changed = set(_different(cases, first, right))
        predicted = [first[k] if k in changed else second[k] for k in range(len(cases))]
    else:
        predicted = list(answers_of(exercise, convention | forms))
    failures = set(_different(cases, found, right))
    concerned = failures | set(_different(cases, predicted, right))
    unexplained = set(_different(cases, found, predicted)) & concerned
    share = 1.0 - len(unexplained) / max(len(concerned), 1)
    return Explanation(mistakes, share, len(failures - unexplained), len(failures))
