"""Compare a student's functions with the right ones, and name the mistake.

The answers of the student, of the right functions and of every mistake are tables over the
same cases. A mistake explains a case if it gives the student's answer there. Its share
counts the cases in which it or the student is wrong: a mistake that predicts failures which
did not happen loses as much as one that misses failures which did.

If no mistake gives the student's answers, the cases that fail may still tell which it is:
a forgotten length of the direction, say, fails where that length is not 1.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from renderer.exercises.answers import agree, distance, is_broken, plain, raised
from renderer.exercises.exercise import RIGHT, Case, Exercise, Functions, Mistake, Variants

NAMED = 0.9  # a mistake with this share is called the mistake
BOTH = 0.95  # two at once need this share: there are many pairs
PARTLY = 0.5  # and with this one probable
MOST = 0.7  # of all cases: if more fail, which ones fail tells nothing


@dataclass(frozen=True, eq=False)
class Explanation:
    """One mistake or two at once, and the share of wrong cases that they explain."""

    mistakes: tuple[Mistake, ...]
    share: float  # in [0, 1]
    explained: int  # failures
    failures: int
    overlap: float  # of the student's failures and those of the mistake, in [0, 1]
    distance: float  # the largest of an estimate that agrees, in standard deviations
    by_cases: bool = False  # named for where it fails, and not for the answers


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
        if best is None or (self.constant and best.share < NAMED):
            return None
        return best if best.share >= PARTLY or best.by_cases else None

    @property
    def constant(self) -> bool:
        """Whether the answer is wrong and the same in every case."""
        return (
            bool(self.failures)
            and len(self.found) > 1
            and all(agree(one, self.found[0], 0.0) for one in self.found)
        )


def answer(case: Case, functions: Functions) -> Any:
    """Return the plain answer to one case; an exception is an answer too."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            return plain(case.answer_of(functions))
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
    every_case = range(len(found))
    failures = {
        convention: _different(cases, found, answers_of(exercise, convention), every_case)
        for convention in (RIGHT, *(frozenset({name}) for name in exercise.conventions))
    }
    best = min(failures, key=lambda convention: len(failures[convention]))
    explanations = _explanations(exercise, found, failures) if failures[best] else []
    expected = answers_of(exercise, best)
    return Verdict(cases, expected, found, sorted(failures[best]), explanations)


def _different(
    cases: Sequence[Case], a: Sequence[Any], b: Sequence[Any], numbers: Iterable[int]
) -> frozenset[int]:
    """Return those numbers of cases whose answers differ."""
    return frozenset(k for k in numbers if not agree(a[k], b[k], cases[k].tolerance))


def _explanations(
    exercise: Exercise, found: Sequence[Any], failures: Mapping[Variants, frozenset[int]]
) -> list[Explanation]:
    """Return every mistake with its share, best first; pairs if no single one suffices.

    Parameters
    ----------
    failures
        Of the student, by the convention that is taken to be right.
    """
    tried = _tried(exercise, found, failures, [(one,) for one in exercise.mistakes])
    # what raises an exception everywhere has no second mistake yet
    if tried[0].share < NAMED and not all(is_broken(one) for one in found):
        pairs = itertools.combinations(exercise.mistakes, 2)
        both = _tried(exercise, found, failures, pairs)
        tried = [*(one for one in both[:1] if one.share >= BOTH), *tried]
    if tried[0].share < PARTLY and tried[0].failures < MOST * len(found):
        alike = [one for one in tried if one.overlap >= NAMED]
        if len(alike) == 1:
            named = dataclasses.replace(alike[0], by_cases=True)
            tried = [named, *(one for one in tried if one is not alike[0])]
    return tried


def _tried(
    exercise: Exercise,
    found: Sequence[Any],
    failures: Mapping[Variants, frozenset[int]],
    candidates: Iterable[tuple[Mistake, ...]],
) -> list[Explanation]:
    """Return the best form of each candidate, best candidate first."""
    explanations = []
    for mistakes in candidates:
        forms = itertools.product(*(one.variants for one in mistakes))
        tried = [
            _explanation(exercise, found, wrong, mistakes, convention, frozenset(form))
            for form, (convention, wrong) in itertools.product(forms, failures.items())
        ]
        explanations.append(max(tried, key=_order))
    return sorted(explanations, key=_order, reverse=True)


def _order(one: Explanation) -> tuple[float, float]:
    return one.share, -one.distance


def _explanation(
    exercise: Exercise,
    found: Sequence[Any],
    failures: frozenset[int],
    mistakes: tuple[Mistake, ...],
    convention: Variants,
    forms: Variants,
) -> Explanation:
    predicted, mistaken = _prediction(exercise, convention, forms)
    mistaken = mistaken & frozenset(range(len(found)))
    concerned = failures | mistaken
    unexplained = _different(_questions(exercise), found, predicted, concerned)
    count = max(len(concerned), 1)
    return Explanation(
        mistakes,
        share=1.0 - len(unexplained) / count,
        explained=len(failures - unexplained),
        failures=len(failures),
        overlap=len(failures & mistaken) / count,
        distance=max((distance(found[k], predicted[k]) for k in concerned), default=0.0),
    )


@functools.cache
def _prediction(
    exercise: Exercise, convention: Variants, forms: Variants
) -> tuple[Sequence[Any], frozenset[int]]:
    """Return the answers with one or two mistakes, and the cases that they change."""
    cases, right = _questions(exercise), answers_of(exercise, convention)
    every_case = range(len(cases))
    if len(forms) == 2 and exercise.slow:
        first, second = (_prediction(exercise, convention, frozenset({f})) for f in forms)
        answers = [(first if k in first[1] else second)[0][k] for k in every_case]
    else:
        answers = list(answers_of(exercise, convention | forms))
    return answers, _different(cases, answers, right, every_case)
