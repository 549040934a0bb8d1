"""`lightproof check`: judge a student's file, show where it fails, name the mistake."""

from __future__ import annotations

import argparse
import ast
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from renderer.errors import SceneError, printable
from renderer.exercises.answers import shown, shown_argument
from renderer.exercises.exercise import Case, Exercise
from renderer.exercises.judge import NAMED, Explanation, Verdict, judge
from renderer.exercises.pictures import compared
from renderer.exercises.registry import EXERCISES
from renderer.exercises.student_process import Run, StudentFileError, run_student
from renderer.process.short_command import INTERRUPTED, WRONG_USE, run_command
from renderer.process.whole_file import write_whole

CORRECT, WRONG = 0, 1
SECONDS = 60.0
NOT_DONE = "NotImplementedError"


@dataclass(frozen=True, eq=False)
class Checked:
    """A student's file, and what came of it."""

    path: Path
    exercise: Exercise
    run: Run
    verdict: Verdict

    @property
    def status(self) -> str:
        """One of right, wrong and unfinished."""
        if len(self.run.answers) < len(self.verdict.cases):
            return "wrong"
        if not self.verdict.failures:
            return "right"
        first = self.verdict.found[self.verdict.failures[0]]
        return "unfinished" if _is_stub(first) else "wrong"


def main(arguments: Sequence[str] | None = None) -> int:
    """Check a file; print the verdict; return the exit status."""
    given = _parser().parse_args(sys.argv[1:] if arguments is None else arguments)
    return run_command("lightproof check", lambda: _run(given))


def _run(given: argparse.Namespace) -> int:
    try:
        checked = check(given.file, given.time_limit, draw=not given.no_picture)
    except StudentFileError as error:
        place = given.file if error.line is None else f"{given.file}:{error.line}"
        raise SceneError(f"{place}: {error}") from None
    for line in sentences(checked):
        sys.stdout.write(line + "\n")
    if not given.no_picture:
        _draw(checked)
    if given.json:
        text = json.dumps(as_record(checked), indent=1)
        write_whole(given.json, f"{text}\n".encode())
    return CORRECT if checked.status == "right" else WRONG


def check(path: Path, seconds: float = SECONDS, *, draw: bool = False) -> Checked:
    """Return the verdict on a student's file.

    Parameters
    ----------
    path
        The file; a constant EXERCISE in it, or a function's name, tells the exercise.
    seconds
        The most time that the student's functions may take.
    draw
        Whether the picture is wanted.

    Raises
    ------
    StudentFileError
        If the file cannot be executed, or is not one of an exercise.
    OSError
        If it cannot be read.
    """
    exercise = exercise_of(path)
    run = run_student(path, exercise, seconds, draw=draw)
    return Checked(path, exercise, run, judge(exercise, run.answers))


def exercise_of(path: Path) -> Exercise:
    """Return the exercise of a student's file, without executing it."""
    try:
        tree = ast.parse(path.read_bytes(), filename=str(path))
    except SyntaxError as error:
        raise StudentFileError(f"syntax error: {error.msg}", error.lineno) from error
    except ValueError as error:
        raise StudentFileError(f"this is not a Python file: {error}") from error
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant):
            names = {one.id for one in node.targets if isinstance(one, ast.Name)}
            if "EXERCISE" in names:
                if (found := EXERCISES.get(str(node.value.value))) is not None:
                    return found
                raise StudentFileError(
                    f"there is no exercise {node.value.value!r}; possible is: "
                    f"{', '.join(EXERCISES)}",
                    node.lineno,
                )
    defined = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    for exercise in EXERCISES.values():
        if defined & {function.__name__ for function in exercise.functions}:
            return exercise
    raise StudentFileError(
        'which exercise is this? A line such as EXERCISE = "triangle" tells'
    )


def sentences(checked: Checked) -> Iterator[str]:
    """Give the verdict in words, most important first."""
    path, exercise, verdict, run = (
        checked.path,
        checked.exercise,
        checked.verdict,
        checked.run,
    )
    count = len(verdict.cases)
    if checked.status == "right":
        yield f"{path}: right. All {count} cases of the exercise {exercise.name} agree."
        if run.stopped:
            yield f"The picture is missing: the file {run.stopped}."
        return
    if checked.status == "unfinished":
        found = verdict.found[verdict.failures[0]]
        function = _function(verdict.cases[verdict.failures[0]], exercise)
        yield f"{path}:{found['line']}: {function} is not written yet."
        yield f"A hint:  lightproof exercise {exercise.name} --hint"
        return
    if len(run.answers) < count:
        place = path if run.line is None else f"{path}:{run.line}"
        yield printable(f"{place}: wrong. The file {run.stopped}.")
        yield from _question(verdict.cases[len(run.answers)], exercise, "It was at")
        return
    failed = len(verdict.failures)
    yield f"{path}: wrong. {failed} of {count} cases of {exercise.name} fail."
    first = verdict.failures[0]
    yield from _question(verdict.cases[first], exercise, "First failure")
    yield f"    expected: {shown(verdict.expected[first])}"
    yield printable(f"    found:    {shown(verdict.found[first])}")
    yield from _mistake(verdict, exercise)


def _question(case: Case, exercise: Exercise, title: str) -> Iterator[str]:
    yield f"{title}: {case.about}."
    if case.measure is None:
        words = exercise.words(case.function)
        for word, value in zip(words, case.arguments, strict=True):
            yield f"    {word} = {shown_argument(value)}"


def _mistake(verdict: Verdict, exercise: Exercise) -> Iterator[str]:
    named = verdict.named
    if named is None and verdict.constant:
        yield "The answer is the same in every case."
        return
    if named is None:
        yield f"None of the {len(exercise.mistakes)} known mistakes explains the failures."
        return
    probably = "" if named.share >= NAMED else "probably "
    explains = f"explains {named.explained} of {named.failures} failures"
    if named.by_cases:
        explains = "it fails in the same cases, with other answers"
    several = len(named.mistakes) > 1
    names = " and ".join(one.name for one in named.mistakes)
    yield f"The mistake{'s are' if several else ' is'} {probably}{names} ({explains}):"
    for one in named.mistakes:
        yield f"    {one.sentence} {one.advice}"


def _function(case: Case, exercise: Exercise) -> str:
    return case.function or exercise.functions[0].__name__


def _is_stub(answer: object) -> bool:
    return isinstance(answer, dict) and str(answer.get("raised", "")).startswith(NOT_DONE)


def _draw(checked: Checked) -> None:
    """Write the student's picture, the right one and the difference."""
    yours, draw = checked.run.picture, checked.exercise.picture
    if yours is None or draw is None or checked.status == "unfinished":
        return
    path = checked.path.with_name(f"{checked.path.stem}_check.png")
    write_whole(path, compared(yours, draw(checked.exercise.right())))
    sys.stdout.write(f"wrote {path}: yours, the truth, and the difference\n")


def as_record(checked: Checked) -> dict[str, object]:
    """Return what programs read: plain values."""
    verdict, run = checked.verdict, checked.run
    record: dict[str, object] = {
        "exercise": checked.exercise.name,
        "status": checked.status,
        "cases": len(verdict.cases),
        "failures": len(verdict.failures),
        "stopped": run.stopped or None,
        "mistakes": [_explained(one) for one in verdict.explanations[:5]],
    }
    if verdict.failures:
        first = verdict.failures[0]
        record["first_failure"] = {
            "about": verdict.cases[first].about,
            "arguments": [shown_argument(one) for one in verdict.cases[first].arguments],
            "expected": shown(verdict.expected[first]),
            "found": shown(verdict.found[first]),
        }
    return record


def _explained(one: Explanation) -> dict[str, object]:
    return {
        "names": [mistake.name for mistake in one.mistakes],
        "sentences": [mistake.sentence for mistake in one.mistakes],
        "advice": [mistake.advice for mistake in one.mistakes],
        "share": one.share,
    }


def _seconds(text: str) -> float:
    value = float(text)
    if not 0.0 < value <= 86400.0:
        raise ValueError
    return value


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lightproof check",
        allow_abbrev=False,
        description="Check the file of an exercise: say whether it is right, show the "
        "first input where it fails, and name the mistake. The file runs in a process of "
        "its own.",
        epilog=f"Exit status: {CORRECT} right, {WRONG} wrong or not written yet, "
        f"{WRONG_USE} the file or the command line cannot be used, {INTERRUPTED} "
        "interrupted. "
        "Example: lightproof check triangle.py",
    )
    add = parser.add_argument
    add("file", type=Path, metavar="FILE.py", help="from: lightproof exercise NAME")
    add(
        "--time-limit",
        type=_seconds,
        default=SECONDS,
        metavar="SECONDS",
        help=f"of the file's functions (default: {SECONDS:g})",
    )
    add("--no-picture", action="store_true", help="do not write FILE_check.png")
    add("--json", type=Path, metavar="FILE", help="write the verdict for programs")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
