"""Every exercise: its stub, right solutions of several forms, and the mistakes named."""

from __future__ import annotations

import ast
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from student_faults import FAULTS, MORE_FAULTS
from student_solutions import SOLUTIONS

from renderer.exercises.answers import is_broken
from renderer.exercises.exercise import RIGHT, Exercise, stub
from renderer.exercises.judge import NAMED, answer, answers_of, judge
from renderer.exercises.registry import EXERCISES
from renderer.exercises.student_process import functions_of

ALL = list(EXERCISES.values())
every_exercise = pytest.mark.parametrize("exercise", ALL, ids=[one.name for one in ALL])
MISTAKES = [(one, m, form) for one in ALL for m in one.mistakes for form in m.variants]


def verdict_on(source: str, exercise: Exercise) -> Any:
    """Judge a student's source in this process."""
    module = types.ModuleType("student")
    exec(
        compile(f"import math\nimport numpy as np\n{source}", "s.py", "exec"), vars(module)
    )
    functions = functions_of(module, exercise)
    return judge(exercise, [answer(case, functions) for case in exercise.questions()])


def names(verdict: Any) -> str:
    """Return the mistakes that are named."""
    named = verdict.named
    return "+".join(sorted(one.name for one in named.mistakes)) if named else "none"


def test_there_are_exercises_for_the_whole_lecture() -> None:
    assert all(len(one.mistakes) >= 5 and len(one.hints) >= 2 for one in ALL)
    assert all(name.isidentifier() and one.name == name for name, one in EXERCISES.items())
    assert len({f.__name__ for one in ALL for f in one.functions}) == sum(
        len(one.functions) for one in ALL
    )


@every_exercise
def test_the_stub_is_a_python_file_that_is_not_done(exercise: Exercise) -> None:
    text = stub(exercise, Path(f"{exercise.name}.py"))
    assert max(map(len, text.splitlines())) <= 92
    tree = ast.parse(text)
    assert [node.name for node in tree.body if isinstance(node, ast.FunctionDef)] == [
        function.__name__ for function in exercise.functions
    ]
    assert "variants" not in text
    verdict = verdict_on(text, exercise)
    assert len(verdict.failures) == len(verdict.cases)
    assert "NotImplementedError" in verdict.found[0]["raised"]


@every_exercise
def test_the_truth_is_right_and_never_broken(exercise: Exercise) -> None:
    """The conventions that are left free are right too, and differ somewhere."""
    right = answers_of(exercise, RIGHT)
    assert not any(is_broken(one) for one in right)
    for convention in exercise.conventions:
        other = answers_of(exercise, frozenset({convention}))
        assert not judge(exercise, other).failures
        assert other != right


@every_exercise
def test_the_questions_are_the_same_each_time(exercise: Exercise) -> None:
    """The student's process makes them anew."""
    again = [answer(case, exercise.right()) for case in exercise.questions()]
    assert again == answers_of(exercise, RIGHT)


@pytest.mark.parametrize(
    ("name", "source"),
    [(name, source) for name, sources in SOLUTIONS.items() for source in sources],
)
def test_a_right_solution_in_another_form_is_right(name: str, source: str) -> None:
    verdict = verdict_on(source, EXERCISES[name])
    assert not verdict.failures, names(verdict)


@pytest.mark.parametrize(
    ("exercise", "mistake", "form"),
    MISTAKES,
    ids=[f"{e.name}-{form}" for e, _, form in MISTAKES],
)
def test_every_seeded_mistake_is_wrong_and_named_first(
    exercise: Exercise, mistake: Any, form: str
) -> None:
    verdict = judge(exercise, answers_of(exercise, frozenset({form})))
    assert verdict.failures
    assert names(verdict) == mistake.name
    second = verdict.explanations[1]
    assert second.share < NAMED, second.mistakes


def assert_named(source: str, right: str, wrong: str, expected: str) -> None:
    """Judge a solution with one place replaced."""
    assert right in source
    function = source.split("(")[0].split()[-1]
    exercise = next(one for one in ALL if function in {f.__name__ for f in one.functions})
    verdict = verdict_on(source.replace(right, wrong), exercise)
    assert verdict.failures
    assert names(verdict) == expected


@pytest.mark.parametrize(("source", "right", "wrong", "expected"), FAULTS)
def test_a_students_own_mistake_is_named(
    source: str, right: str, wrong: str, expected: str
) -> None:
    """The mistakes are edits of solutions that are written otherwise than ours."""
    assert_named(source, right, wrong, expected)


@pytest.mark.slow
@pytest.mark.parametrize(("source", "right", "wrong", "expected"), MORE_FAULTS)
def test_another_of_a_students_mistakes_is_named(
    source: str, right: str, wrong: str, expected: str
) -> None:
    """Written before they were tried; the names found first are in docs/exercises.md."""
    assert_named(source, right, wrong, expected)


@every_exercise
def test_the_picture_is_drawn_and_a_mistake_changes_one(exercise: Exercise) -> None:
    if exercise.picture is None:
        return
    picture = exercise.picture(exercise.right())
    assert picture.shape[2] == 3 and np.isfinite(picture).all()
    assert picture.std() > 0.02  # not empty


def test_a_picture_of_failing_functions_is_drawn_too() -> None:
    def fails(*_: Any) -> None:
        raise ValueError

    for exercise in ALL:
        functions: dict[str, Callable[..., Any]] = {
            f.__name__: fails for f in exercise.functions
        }
        if exercise.picture is not None:
            picture = exercise.picture(types.SimpleNamespace(**functions))
            assert np.isnan(picture).any()
